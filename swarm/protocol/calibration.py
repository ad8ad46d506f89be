"""How UAVs fly, by their parameters and in flight: whose words count, and where they enter.

**Read** from the vehicle, before it takes off: with what acceleration it flies, and that it flies
no faster than some speed. An acceleration counts where the brief gives none, a speed where it is
below that of the brief. **Measured**, by each agent of its own UAV (agent.core.calibration): the
time of each leg over the predicted one, the charge drained over what the airborne time should take,
and how long it takes to land and to climb again, which no mission says and a vehicle is known for
beforehand. **Filtered** by running medians, and **told** in the register ``uav/<id>/calibration``
when an estimate has changed by a fiftieth, so that faultless flights say nothing. **Entering** here
alone: the board's problems are those of UAVs with the accelerations and speeds that were told
(`fleet_as_told`), and have the times of each UAV's legs and its airborne time by these factors,
those to bases and home with the landing and those from bases with the climb, and so all decisions,
limits, predictions and plans that rest on the board, wherever registers are equal.

Off unless the brief gives any UAV's acceleration, airspeed or endurance. What a UAV tells is
clamped to what is believable, and changes predictions about itself only. Leaves out: service times.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from typing import Final

from swarm.allocation import field
from swarm.model import Mission, Uav
from swarm.protocol.messages import MissionConfig, UavSpec
from swarm.protocol.registers import Replica
from swarm.protocol.uav_messages import Calibration

TIME_FRAC_RANGE: Final = (0.5, 3.0)
"""What is believed of times of legs."""
DRAIN_FRAC_RANGE: Final = (0.8, 3.0)
"""What is believed of batteries: that one lasts far longer than it should less than the reverse."""
LONGEST_VERTICAL_S: Final = 300.0
"""What is believed of landing and of climbing at most [s]."""
ACCELERATION_RANGE_M_S2: Final = (0.1, 50.0)
"""What is believed of accelerations [m/s²]."""
LEAST_SPEED_FRAC: Final = 0.1
"""Of the speed that the brief says: no UAV is believed to be slower by its parameters."""
_NOTICEABLE_FRAC: Final = 0.05
_NOTICEABLE_S: Final = 5.0
"""Of landing and climbing together [s]."""


@dataclass(frozen=True, slots=True)
class FlightRates:
    """How one UAV flies: multiples of what the brief says, and times that it leaves out."""

    time_frac: float = 1.0
    """Of the times of its legs."""
    drain_frac: float = 1.0
    """Of the charge that a second in the air takes."""
    land_s: float = 0.0
    """From above a base or its start until it has touched down [s]."""
    climb_s: float = 0.0
    """From a base back to where its legs begin [s]."""
    acceleration_m_s2: float | None = None
    """By its parameters, where the brief gives none [m/s²]."""
    speed_m_s: float | None = None
    """By its parameters, where it is below that of the brief [m/s]."""

    @property
    def as_briefed(self) -> bool:
        """Whether it flies as the brief says, however long it takes down and up."""
        return self.as_measured and self.acceleration_m_s2 is None and self.speed_m_s is None

    @property
    def as_measured(self) -> bool:
        """Whether nothing was measured that is otherwise than brief and parameters say."""
        return self.time_frac == 1.0 and self.drain_frac == 1.0

    @classmethod
    def believed(cls, told: Calibration | None, briefed: UavSpec) -> FlightRates:
        """As much of what a UAV has told as is believable, and the brief does not say."""
        if told is None:
            return AS_BRIEFED
        acceleration_m_s2, speed_m_s = told.acceleration_m_s2, told.speed_m_s
        if acceleration_m_s2 is not None:
            acceleration_m_s2 = clamped(acceleration_m_s2, ACCELERATION_RANGE_M_S2)
        if speed_m_s is not None:
            speed_m_s = max(speed_m_s, LEAST_SPEED_FRAC * briefed.speed_m_s)
        return cls(
            clamped(told.time_frac, TIME_FRAC_RANGE),
            clamped(told.drain_frac, DRAIN_FRAC_RANGE),
            min(told.land_s, LONGEST_VERTICAL_S),
            min(told.climb_s, LONGEST_VERTICAL_S),
            None if briefed.acceleration_m_s2 is not None else acceleration_m_s2,
            speed_m_s if speed_m_s is not None and speed_m_s < briefed.speed_m_s else None,
        )


AS_BRIEFED: Final = FlightRates()


def clamped(frac: float, within: tuple[float, float]) -> float:
    """``frac``, or the end of that range which is nearer."""
    return min(max(frac, within[0]), within[1])


def is_calibrated(brief: MissionConfig) -> bool:
    """Whether parameters, and what is measured in flight, count in that mission."""
    return any(
        given is not None
        for uav in brief.uavs
        for given in (uav.acceleration_m_s2, uav.airspeed_m_s, uav.endurance_s)
    )


def flight_rates(replica: Replica) -> dict[str, FlightRates]:
    """By UAV id, the rates of those that fly otherwise than the brief says."""
    brief = replica.brief
    if brief is None or not replica.calibrations or not is_calibrated(brief):
        return {}
    told, by_id = replica.calibrations, {uav.id: uav for uav in brief.uavs}
    believed = {uav: FlightRates.believed(told[uav], by_id[uav]) for uav in told if uav in by_id}
    return {uav: rates for uav, rates in believed.items() if rates != AS_BRIEFED}


def noticeably_otherwise(
    known: Mapping[str, FlightRates], found: Mapping[str, FlightRates]
) -> list[str]:
    """UAVs that fly so far otherwise than was known that plans for them should be made anew."""
    pairs = {
        uav: (known.get(uav, AS_BRIEFED), found.get(uav, AS_BRIEFED))
        for uav in sorted(known.keys() | found.keys())
    }
    return [
        uav
        for uav, (old, new) in pairs.items()
        if abs(new.time_frac / old.time_frac - 1.0) > _NOTICEABLE_FRAC
        or abs(new.drain_frac / old.drain_frac - 1.0) > _NOTICEABLE_FRAC
        or abs(new.land_s + new.climb_s - old.land_s - old.climb_s) > _NOTICEABLE_S
        or _differs(old.acceleration_m_s2, new.acceleration_m_s2)
        or _differs(old.speed_m_s, new.speed_m_s)
    ]


def _differs(old: float | None, new: float | None) -> bool:
    if old is None or new is None:
        return old is not new
    return abs(new / old - 1.0) > _NOTICEABLE_FRAC


def told_by(rates: Mapping[str, FlightRates]) -> dict[str, tuple[float | None, float | None]]:
    """By UAV id, the accelerations [m/s²] and speeds [m/s] that count as vehicles told them."""
    known = {uav: (each.acceleration_m_s2, each.speed_m_s) for uav, each in rates.items()}
    return {uav: told for uav, told in known.items() if told != (None, None)}


def fleet_as_told(fleet: Mission, rates: Mapping[str, FlightRates]) -> Mission:
    """``fleet`` with what vehicles have told of their parameters; the same one where none has."""
    told = told_by(rates)
    if not told:
        return fleet
    uavs = tuple(_as_told(uav, *told.get(uav.id, (None, None))) for uav in fleet.uavs)
    return replace(fleet, uavs=uavs)


def field_as_told(
    mission: Mission,
    rates: Mapping[str, FlightRates],
    make: Callable[[Mission], field.FieldProblem],
) -> field.FieldProblem:
    """What ``make`` makes of ``mission`` with what vehicles have told of their parameters.

    Where UAVs that fly alike no longer do, and tables of legs would get too large by it, it is made
    of the mission as it is.
    """
    told = fleet_as_told(mission, rates)
    if told is not mission:
        from swarm.allocation.field.network import TooManyLegsError  # plain missions start sooner

        try:
            return make(told)
        except TooManyLegsError:
            pass
    return make(mission)


def fleet_as_flown(fleet: Mission, rates: Mapping[str, FlightRates]) -> Mission:
    """``fleet`` with the speeds that UAVs really have; the same one where all fly as briefed."""
    fleet = fleet_as_told(fleet, rates)
    if all(each.time_frac == 1.0 for each in rates.values()):
        return fleet
    uavs = tuple(_as_flown(uav, rates.get(uav.id, AS_BRIEFED)) for uav in fleet.uavs)
    return replace(fleet, uavs=uavs)


def field_as_flown(
    problem: field.FieldProblem, rates: Mapping[str, FlightRates]
) -> field.FieldProblem:
    """``problem``, made by `field_as_told`, as UAVs really fly and drain their batteries.

    The same one where nobody has measured anything. Who has to climb has used up some charge at
    mission time 0, when the last one is in the air.
    """
    known = [rates.get(uav, AS_BRIEFED) for uav in problem.uav_ids]
    return problem.calibrated(
        [each.time_frac for each in known],
        [each.drain_frac for each in known],
        [each.land_s for each in known],
        [each.climb_s for each in known],
        aloft_s=max(each.climb_s for each in known),
    )


def _as_told(uav: Uav, acceleration_m_s2: float | None, speed_m_s: float | None) -> Uav:
    return replace(
        uav,
        speed_m_s=uav.speed_m_s if speed_m_s is None else speed_m_s,
        acceleration_m_s2=uav.acceleration_m_s2 if acceleration_m_s2 is None else acceleration_m_s2,
    )


def _as_flown(uav: Uav, rates: FlightRates) -> Uav:
    """One whose legs take so much longer: d/v + v/a and 2·√(d/a) alike, with v/f and a/f²."""
    frac, change_m_s2 = rates.time_frac, uav.acceleration_m_s2
    if frac == 1.0:
        return uav
    return replace(
        uav,
        speed_m_s=uav.speed_m_s / frac,
        acceleration_m_s2=None if change_m_s2 is None else change_m_s2 / (frac * frac),
    )
