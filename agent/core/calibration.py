"""What one UAV's agent measures of its flight: how long legs take, and how fast the battery drains.

**A leg** counts from departure, at rest in the air, to arrival, where it was predicted to take
`_SHORTEST_S` or more. One that was broken off, held, diverted or flown on another way does not, nor
one that began on the ground: take-off is no part of the prediction. **The drain** counts over each
`_SPAN_FRAC` of the charge used in one flight, hovering included.

Each is a share of the prediction by the brief, and has one vote among the last `_WINDOW` in a
running median, which begins with `_PRIOR` votes for what is known already. So one leg or two change
little, an odd one nothing, and after four the estimate is what was measured. What is told of it in
the own register moves in steps of `STEP_FRAC` or more, so that neither decisions nor problems
change with each leg. A later life begins with what the register says.

Leaves out: what follows (swarm.protocol.calibration, and agent.core.field_tasking for the battery).
"""

from __future__ import annotations

from collections import deque
from dataclasses import dataclass
from statistics import median
from typing import Final

from agent.core.context import AgentContext, AgentPart
from swarm.protocol.calibration import (
    AS_BRIEFED,
    DRAIN_FRAC_RANGE,
    TIME_FRAC_RANGE,
    FlightRates,
    clamped,
    is_calibrated,
)
from swarm.protocol.uav_messages import Calibration

STEP_FRAC: Final = 0.02
"""Least change of an estimate that is told, as a share of what was told before."""
_PRIOR, _WINDOW = 2, 9
_SHORTEST_S: Final = 3.0
_SPAN_FRAC: Final = 0.04
_RISE_FRAC: Final = 0.005
"""Charge that goes up by more is another battery, or one that has recovered: a new span."""


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


def told_anew(told: float, estimate: float, within: tuple[float, float]) -> float:
    """What to tell of an estimate: what was told before, unless that is a step away."""
    believed = clamped(estimate, within)
    return told if abs(believed / told - 1.0) < STEP_FRAC else round(believed, 2)


@dataclass(frozen=True, slots=True)
class _Departure:
    leg: int
    predicted_s: float
    """By the brief."""
    at_s: float


class FlightMeter(AgentPart):
    """Measures the flights of one UAV, and tells how it flies."""

    def __init__(self, context: AgentContext) -> None:
        super().__init__(context)
        self.now_s = 0.0
        """Of the step that is under way, on the own clock."""
        self._known: tuple[RunningMedian, RunningMedian] | None = None
        """Of times and of drain; None before the first measurement of this life."""
        self._legs_before = 0
        self._departure: _Departure | None = None
        self._at_rest = False
        """Whether the vehicle hovers where its last leg has ended."""
        self._span: tuple[float, float] | None = None
        """When the charge was what, at the beginning of what is being measured."""

    @property
    def rates(self) -> FlightRates:
        """What this UAV has told of itself, as everybody believes it."""
        return AS_BRIEFED if not self._counts else self._told

    # -- legs --------------------------------------------------------------------------

    def hover(self) -> None:
        """The vehicle is under command, at rest in the air."""
        self._departure, self._at_rest, self._span = None, True, None

    def land(self) -> None:
        """It is on the ground, or about to land."""
        self._departure, self._at_rest, self._span = None, False, None

    def depart(self, leg: int, predicted_s: float | None = None) -> None:
        """It sets off now, and should take so long by the brief; None: nobody can tell."""
        at_rest, self._at_rest, self._departure = self._at_rest, False, None
        if at_rest and predicted_s is not None and predicted_s >= _SHORTEST_S:
            self._departure = _Departure(leg, predicted_s, self.now_s)

    def arrive(self, leg: int) -> bool:
        """It is where that leg ends, the last one; whether that is news of how it flies."""
        departure, self._departure, self._at_rest = self._departure, None, True
        if departure is None or departure.leg != leg or not self._counts:
            return False
        self._medians[0].add((self.now_s - departure.at_s) / departure.predicted_s)
        return self._tell()

    # -- battery -----------------------------------------------------------------------

    def measure(self, endurance_s: float | None, battery_frac: float | None, now_s: float) -> bool:
        """In flight it tells its charge; whether that is news of how it flies."""
        if endurance_s is None or battery_frac is None or not self._counts:
            return False
        if self._span is None or battery_frac > self._span[1] + _RISE_FRAC:
            self._span = now_s, battery_frac
            return False
        since_s, before_frac = self._span
        used_frac, flown_s = before_frac - battery_frac, now_s - since_s
        if used_frac < _SPAN_FRAC or flown_s <= 0.0:
            return False
        self._span = now_s, battery_frac
        self._medians[1].add(used_frac * endurance_s / flown_s)
        return self._tell()

    # -- what comes of it --------------------------------------------------------------

    @property
    def _counts(self) -> bool:
        brief = self._replica.brief
        return brief is not None and is_calibrated(brief) and self._mission_view.running

    @property
    def _told(self) -> FlightRates:
        return FlightRates.believed(self._replica.calibrations.get(self._uav))

    @property
    def _medians(self) -> tuple[RunningMedian, RunningMedian]:
        """Of times and of drain, begun with what an earlier life has told."""
        if self._known is None:
            told, before = self._told, self._replica.calibrations.get(self._uav)
            self._known = RunningMedian(told.time_frac), RunningMedian(told.drain_frac)
            self._legs_before = 0 if before is None else before.legs
        return self._known

    def _tell(self) -> bool:
        """State the register anew, if the estimates have moved by a step."""
        told, (times, drains) = self._told, self._medians
        now = FlightRates(
            told_anew(told.time_frac, times.value, TIME_FRAC_RANGE),
            told_anew(told.drain_frac, drains.value, DRAIN_FRAC_RANGE),
        )
        if now == told:
            return False
        legs = self._legs_before + times.count
        self._say(Calibration(now.time_frac, now.drain_frac, legs))
        self._log("calibrated", time_frac=now.time_frac, drain_frac=now.drain_frac, legs=legs)
        return True
