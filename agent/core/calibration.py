"""What one UAV's agent measures of its flight: times of legs, drain, and how it lands and climbs.

**Acceleration and speed** by the vehicle's parameters are told as soon as it has said them, which
it does before it takes off.

**Landing and climbing** are known for a vehicle before it has flown, and told at once, as plans
need them; measured they count from the order to land to `Landed`, and as what the first leg from
the ground takes longer. What takes longer than was known is believed at once.

**A leg** counts from departure, at rest in the air, to arrival, where it was predicted to take
`_SHORTEST_S` or more. One that was broken off, held, diverted or flown on another way does not, nor
one that began on the ground. **The drain** counts over each
4 % of the charge used in one flight, hovering included (`DrainGauge`).

Each of these two is a share of the prediction by brief and parameters, and has one vote among the
last `_WINDOW` in a running median, which begins with `_PRIOR` votes for what is known already. So
one leg or two change little, an odd one nothing, and after four the estimate is what was measured.
Votes that nobody would believe are none. What is told of it in
the own register moves in steps of `STEP_FRAC` or more, so that neither decisions nor problems
change with each leg. A later life begins with what the register says.

Only the own battery is watched with more caution: where the votes without those for what is known
say worse than what is told, its sortie ends by them (`FlightMeter.cautious_drain_frac`), so that a
UAV that finds itself slow on its first two legs turns home in time. So it does by a span of the
drain that is too short to have a vote, if that is fast even where words came late.

Leaves out: what follows (swarm.protocol.calibration, and agent.core.field_tasking for the battery).
"""

from __future__ import annotations

from collections import deque
from dataclasses import asdict, dataclass, replace
from statistics import median
from typing import Final

from agent.core.context import AgentContext, AgentPart
from agent.core.energy import DrainGauge, SortieClock
from agent.core.interface import FlightLimits
from agent.core.states import AgentState
from swarm.protocol.calibration import (
    AS_BRIEFED,
    DRAIN_FRAC_RANGE,
    LONGEST_VERTICAL_S,
    TIME_FRAC_RANGE,
    FlightRates,
    clamped,
    is_calibrated,
)
from swarm.protocol.uav_messages import Calibration

STEP_FRAC: Final = 0.02
"""Least change of an estimate that is told, as a share of what was told before."""
STEP_S: Final = 1.0
"""Least change of the times of landing and climbing that is told [s]."""
_PRIOR, _WINDOW = 2, 9
_SHORTEST_S: Final = 3.0


class RunningMedian:
    """Of the last votes; the first ones are for what is known beforehand."""

    def __init__(self, known: float = 1.0) -> None:
        self._votes = deque([known] * _PRIOR, maxlen=_WINDOW)
        self.count = 0
        """Votes so far."""

    def add(self, vote: float) -> None:
        """One more measurement; it takes the place of the oldest where there are many."""
        self._votes.append(vote)
        self.count += 1

    @property
    def value(self) -> float:
        """The median of those that count."""
        return median(self._votes)

    @property
    def measured(self) -> float | None:
        """The same without what was known beforehand; None before the first vote."""
        votes = list(self._votes)[-self.count :] if self.count else []
        return median(votes) if votes else None


def told_anew(told: float, estimate: float, within: tuple[float, float]) -> float:
    """What to tell of an estimate: what was told before, unless that is a step away."""
    believed = clamped(estimate, within)
    return told if abs(believed / told - 1.0) < STEP_FRAC else round(believed, 2)


@dataclass(frozen=True, slots=True)
class _Departure:
    predicted_s: float
    """By the brief."""
    at_s: float
    climbs: bool = False
    """It departs from the ground."""


@dataclass(frozen=True, slots=True)
class _Estimates:
    times: RunningMedian
    drains: RunningMedian
    landings: RunningMedian
    climbs: RunningMedian


_VERTICAL_RANGE = (0.0, LONGEST_VERTICAL_S)


class FlightMeter(AgentPart):
    """Measures the flights of one UAV, and tells how it flies."""

    def __init__(self, context: AgentContext) -> None:
        super().__init__(context)
        self.sortie = SortieClock()
        """How long the battery lasts."""
        self._verticals = context.verticals
        self._known: _Estimates | None = None
        """None before the first measurement of this life."""
        self._legs_before = 0
        self._leg = 0
        self._departure: _Departure | None = None
        """Of that leg, if it counts."""
        self._at_rest = False
        """Whether the vehicle hovers where its last leg has ended."""
        self._stands = False
        """Whether it is about to take off."""
        self._lands_since_s: float | None = None
        """When it was told to land, in the air."""
        self._gauge = DrainGauge()
        self._least_drain_frac = 0.0
        """What the span of the drain that is under way will come to at least."""

    @property
    def cautious_drain_frac(self) -> float:
        """By how much sooner than by the brief the battery may be used up, as far as is known.

        Legs that take longer than is told use it up likewise.
        """
        told = self.rates
        if self._known is None or not self._counts:
            return told.drain_frac
        times, drains = self._known.times, self._known.drains
        slow = times.measured if times.count > 1 else None  # one leg may be odd
        longer = _worse(told.time_frac, slow, TIME_FRAC_RANGE) / told.time_frac
        drain_frac = max(drains.measured or 0.0, self._least_drain_frac)
        return longer * _worse(told.drain_frac, drain_frac, DRAIN_FRAC_RANGE)

    @property
    def rates(self) -> FlightRates:
        """What this UAV has told of itself, as everybody believes it."""
        return AS_BRIEFED if not self._counts else self._told

    def introduce(self, limits: FlightLimits | None = None) -> None:
        """Tell what is known of the vehicle before it flies, if that matters in this mission.

        Its ``limits`` are told when it has said them; None: it has not, or not yet.
        """
        brief, me, told = self._replica.brief, self._mission_view.me, self._told
        if brief is None or me is None or not is_calibrated(brief):
            return
        now = told
        if self._verticals is not None and me.endurance_s is not None and told.land_s == 0.0:
            land_s = round(self._verticals.land_s(me.layer_m), 1)
            climb_s = round(self._verticals.climb_s(me.layer_m), 1)
            now = replace(now, land_s=land_s, climb_s=climb_s)
        if limits is not None:
            said = Calibration(1.0, 1.0, 0, 0.0, 0.0, limits.acceleration_m_s2, limits.speed_m_s)
            read = FlightRates.believed(said, me)
            acceleration_m_s2 = _limit_anew(told.acceleration_m_s2, read.acceleration_m_s2)
            speed_m_s = _limit_anew(told.speed_m_s, read.speed_m_s)
            if (acceleration_m_s2, speed_m_s) != (told.acceleration_m_s2, told.speed_m_s):
                found = {"acceleration_m_s2": acceleration_m_s2, "speed_m_s": speed_m_s}
                self._log("flies by its parameters", **found)
            now = replace(now, acceleration_m_s2=acceleration_m_s2, speed_m_s=speed_m_s)
        if now != told:
            before = self._replica.calibrations.get(self._uav)
            self._say(_calibration(now, 0 if before is None else before.legs))

    # -- legs --------------------------------------------------------------------------

    def begin(self, now_s: float) -> None:
        """The vehicle is under command: at rest in the air, unless it still flies to a task."""
        self.land()
        self._at_rest = self._machine.state is not AgentState.RESUMING
        self.sortie.heed(self.rates.drain_frac, self._mission_view.mission_s(now_s))

    def land(self) -> None:
        """It is on the ground, or about to land.

        Of a flight too short to measure a drain, what it was at least is all that is learned: who
        turns back for that must know when it decides anew.
        """
        now_s, least_frac = self._mission_view.now_s, self._least_drain_frac
        self._departure, self._at_rest = None, False
        self._gauge.begin()
        self._least_drain_frac = 0.0
        if self._counts and least_frac > self.rates.drain_frac * (1.0 + STEP_FRAC):
            self._vote(self._medians.drains, least_frac, DRAIN_FRAC_RANGE, now_s)
        self._stands, self._lands_since_s = False, None

    def come_down(self, now_s: float) -> None:
        """It has been told to land, hovering in its layer."""
        self._lands_since_s = now_s

    def touch_down(self, now_s: float) -> None:
        """It has landed."""
        since_s, self._lands_since_s = self._lands_since_s, None
        if since_s is not None and self._counts and self._verticals is not None:
            self._vote(self._medians.landings, now_s - since_s, _VERTICAL_RANGE, now_s)

    def take_off(self, now_s: float) -> None:
        """It leaves the ground, and flies as it was decided there.

        More caution needs more that is measured: else it could land again and again for it.
        """
        self._stands = True
        self.sortie.heed(self.rates.drain_frac, self._mission_view.mission_s(now_s))

    def depart(self, leg: int, predicted_s: float | None = None) -> None:
        """It sets off now, and should take so long by the brief and its parameters; None: nobody
        can tell."""
        self._note_late_climb()
        at_rest, self._at_rest, self._departure, self._leg = self._at_rest, False, None, leg
        stands, self._stands = self._stands, False
        if predicted_s is None:
            return
        if stands or (at_rest and predicted_s >= _SHORTEST_S):
            self._departure = _Departure(predicted_s, self._mission_view.now_s, stands)

    def _note_late_climb(self) -> None:
        """Who turns away from its first leg later than it was to arrive has climbed for longer.

        For longer than can be told: else it might set off for the same again and again.
        """
        departure, now_s = self._departure, self._mission_view.now_s
        if departure is None or not (departure.climbs and self._counts) or self._verticals is None:
            return
        flown_s = departure.predicted_s * self.rates.time_frac
        climb_s = now_s - departure.at_s - flown_s
        if climb_s >= self.rates.climb_s:
            self._vote(self._medians.climbs, climb_s + STEP_S, _VERTICAL_RANGE, now_s)

    def disturb(self) -> None:
        """The leg under way is not flown as it was ordered."""
        self._departure = None

    def depart_late(self) -> None:
        """The leg that was told last begins only now: its way was taken until then."""
        departure, me, now_s = self._departure, self._mission_view.me, self._mission_view.now_s
        if departure is None:
            return
        self._departure = replace(departure, at_s=now_s)
        if departure.climbs and me is not None:
            self.sortie.depart(me, self._mission_view.mission_s(now_s))

    def arrive(self, leg: int, now_s: float) -> bool:
        """It is where that leg ends; whether the battery is to be looked at anew."""
        if leg != self._leg:
            return False
        departure, self._departure, self._at_rest = self._departure, None, True
        if departure is None or not self._counts:
            return False
        took_s = now_s - departure.at_s
        if not departure.climbs:
            time_frac = took_s / departure.predicted_s
            return self._vote(self._medians.times, time_frac, TIME_FRAC_RANGE, now_s)
        if self._verticals is None:
            return False
        climb_s = max(0.0, took_s - departure.predicted_s * self.rates.time_frac)
        return self._vote(self._medians.climbs, climb_s, _VERTICAL_RANGE, now_s)

    # -- battery -----------------------------------------------------------------------

    def measure(self, now_s: float) -> bool:
        """In flight it has told its charge; whether the battery is to be looked at anew."""
        me, telemetry = self._mission_view.me, self._mission_view.telemetry
        if me is None or telemetry is None or not self._mission_view.clock.is_set:
            return False
        frac, mission_s = telemetry.battery_frac, self._mission_view.mission_s(now_s)
        votes = self._counts and self._measure_drain(me.endurance_s, frac, now_s)
        return self.sortie.measure(me, frac, mission_s) or votes

    def _measure_drain(
        self, endurance_s: float | None, battery_frac: float | None, now_s: float
    ) -> bool:
        if endurance_s is None or battery_frac is None:
            return False
        before_frac, medians = self.cautious_drain_frac, self._medians
        used_1_s = self._gauge.read(battery_frac, now_s)
        least_frac = (self._gauge.least_1_s or 0.0) * endurance_s
        self._least_drain_frac = least_frac if least_frac <= DRAIN_FRAC_RANGE[1] else 0.0
        if used_1_s is not None:
            return self._vote(medians.drains, used_1_s * endurance_s, DRAIN_FRAC_RANGE, now_s)
        if self.cautious_drain_frac <= before_frac * (1.0 + STEP_FRAC):
            return False
        self.sortie.heed(self.cautious_drain_frac, self._mission_view.mission_s(now_s))
        return True

    # -- what comes of it --------------------------------------------------------------

    @property
    def _counts(self) -> bool:
        brief = self._replica.brief
        return brief is not None and is_calibrated(brief) and self._mission_view.clock.is_set

    @property
    def _told(self) -> FlightRates:
        me = self._mission_view.me
        told = self._replica.calibrations.get(self._uav)
        return AS_BRIEFED if me is None else FlightRates.believed(told, me)

    @property
    def _medians(self) -> _Estimates:
        """Begun with what an earlier life has told."""
        if self._known is None:
            told, before = self._told, self._replica.calibrations.get(self._uav)
            known = told.time_frac, told.drain_frac, told.land_s, told.climb_s
            self._known = _Estimates(*map(RunningMedian, known))
            self._legs_before = 0 if before is None else before.legs
        return self._known

    def _vote(
        self, medians: RunningMedian, vote: float, within: tuple[float, float], now_s: float
    ) -> bool:
        if not 0.5 * within[0] <= vote <= within[1]:  # held up, or no measurement at all
            return False
        before = self.rates, self.cautious_drain_frac
        medians.add(vote)
        self._tell()
        now = self.rates, self.cautious_drain_frac
        self.sortie.heed(now[1], self._mission_view.mission_s(now_s))
        return before != now

    def _tell(self) -> None:
        """State the register anew, if the estimates have moved by a step."""
        told, found = self._told, self._medians
        now = replace(
            told,
            time_frac=told_anew(told.time_frac, found.times.value, TIME_FRAC_RANGE),
            drain_frac=told_anew(told.drain_frac, found.drains.value, DRAIN_FRAC_RANGE),
            land_s=_vertical_anew(told.land_s, found.landings),
            climb_s=_vertical_anew(told.climb_s, found.climbs),
        )
        if now == told:
            return
        legs = self._legs_before + found.times.count
        self._say(_calibration(now, legs))
        upright: dict[str, object] = {"land_s": now.land_s, "climb_s": now.climb_s}
        upright = {} if self._verticals is None else upright
        fracs = {"time_frac": now.time_frac, "drain_frac": now.drain_frac}
        self._log("calibrated", **fracs, legs=legs, **upright)


def _calibration(rates: FlightRates, legs: int) -> Calibration:
    """What is told of these rates, which rest on so many legs."""
    return Calibration(legs=legs, **asdict(rates))


def _limit_anew(told: float | None, read: float | None) -> float | None:
    """What to tell of a parameter: what was told before, unless it is another one."""
    if told is not None and read is not None and abs(read / told - 1.0) < STEP_FRAC:
        return told
    return None if read is None else float(f"{read:.3g}")


def _vertical_anew(told_s: float, found: RunningMedian) -> float:
    """What to tell of landing or climbing: at once what is longer, but only in steps."""
    believed_s = max(found.value, found.measured or 0.0)
    return told_s if abs(believed_s - told_s) < STEP_S else round(believed_s, 1)


def _worse(told: float, measured: float | None, within: tuple[float, float]) -> float:
    """What is told, or measured if that is more by a step."""
    if measured is None or clamped(measured, within) < told * (1.0 + STEP_FRAC):
        return told
    return clamped(measured, within)
