"""How UAVs fly, by what they have measured in flight: whose factors count, and where they enter.

**Measured**, by each agent of its own UAV (agent.core.calibration): the time of each leg over the
predicted one, the charge drained over what the airborne time should take, and how long it takes to
land and to climb again, which no mission says and a vehicle is known for beforehand. **Filtered**
by running medians, and **told** in the register ``uav/<id>/calibration`` when an estimate has
changed by a fiftieth, so that faultless flights say nothing. **Entering** here alone: the board's
problems have the times of each UAV's legs and its airborne time by these factors, those to bases
and home with the landing and those from bases with the climb, and so all decisions, limits,
predictions and plans that rest on the board, wherever registers are equal.

Off unless the brief gives any UAV's acceleration, airspeed or endurance. What a UAV tells is
clamped to what is believable, and changes predictions about itself only. Leaves out: service times.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Final

from swarm.allocation import field
from swarm.model import Mission, Uav
from swarm.protocol.messages import MissionConfig
from swarm.protocol.registers import Replica
from swarm.protocol.uav_messages import Calibration

TIME_FRAC_RANGE: Final = (0.5, 3.0)
"""What is believed of times of legs."""
DRAIN_FRAC_RANGE: Final = (0.8, 3.0)
"""What is believed of batteries: that one lasts far longer than it should less than the reverse."""
LONGEST_VERTICAL_S: Final = 300.0
"""What is believed of landing and of climbing at most [s]."""
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

    @property
    def as_briefed(self) -> bool:
        """Whether it flies as the brief says, however long it takes down and up."""
        return self.time_frac == 1.0 and self.drain_frac == 1.0

    @classmethod
    def believed(cls, told: Calibration | None) -> FlightRates:
        """As much of what a UAV has told as is believable."""
        if told is None:
            return AS_BRIEFED
        return cls(
            clamped(told.time_frac, TIME_FRAC_RANGE),
            clamped(told.drain_frac, DRAIN_FRAC_RANGE),
            min(told.land_s, LONGEST_VERTICAL_S),
            min(told.climb_s, LONGEST_VERTICAL_S),
        )


AS_BRIEFED: Final = FlightRates()


def clamped(frac: float, within: tuple[float, float]) -> float:
    """``frac``, or the end of that range which is nearer."""
    return min(max(frac, within[0]), within[1])


def is_calibrated(brief: MissionConfig) -> bool:
    """Whether what is measured in flight counts in that mission."""
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
    believed = {uav: FlightRates.believed(told) for uav, told in replica.calibrations.items()}
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
    ]


def fleet_as_flown(fleet: Mission, rates: Mapping[str, FlightRates]) -> Mission:
    """``fleet`` with the speeds that UAVs really have; the same one where all fly as briefed."""
    if all(each.time_frac == 1.0 for each in rates.values()):
        return fleet
    uavs = tuple(_as_flown(uav, rates.get(uav.id, AS_BRIEFED)) for uav in fleet.uavs)
    return replace(fleet, uavs=uavs)


def field_as_flown(
    problem: field.FieldProblem, rates: Mapping[str, FlightRates]
) -> field.FieldProblem:
    """``problem`` with the times and batteries that UAVs really have; the same one likewise.

    Who has to climb has used up some charge at mission time 0, when the last one is in the air.
    """
    known = [rates.get(uav, AS_BRIEFED) for uav in problem.uav_ids]
    return problem.calibrated(
        [each.time_frac for each in known],
        [each.drain_frac for each in known],
        [each.land_s for each in known],
        [each.climb_s for each in known],
        aloft_s=max(each.climb_s for each in known),
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
