"""Kinds of vehicles, and what a mission must know of each.

A UAV that names none is a copter. What firmwares make of the kinds, in modes and numbers, stands in
agent.vehicle.firmware.

Sources: https://ardupilot.org/rover/docs/rover-control-modes.html,
https://ardupilot.org/plane/docs/quadplane-support.html and
https://docs.px4.io/main/en/flight_modes_fw/.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from enum import StrEnum
from types import MappingProxyType
from typing import Final


class VehicleKind(StrEnum):
    """Kinds as a scenario names them."""

    COPTER = "copter"
    """A multicopter or helicopter."""
    ROVER = "rover"
    """A car, or a boat."""
    QUADPLANE = "quadplane"
    """A plane that takes off and lands upright, on rotors of its own."""
    PLANE = "plane"
    """A plane that takes off and lands along a runway."""


@dataclass(frozen=True, slots=True)
class VehicleTraits:
    """What differs between the kinds."""

    drives: bool
    """It stays on the ground, or on water: no take-off, no landing, no height of its own."""
    stays: bool
    """It stops where it is told to. One that cannot passes its target, and waits on a circle
    round it."""
    needs_runway: bool = False
    """It takes off the way it stands, and lands in a direction that it must be told."""
    limits: str = ""
    """What it is not flown with, for people."""


TRAITS: Final[Mapping[VehicleKind, VehicleTraits]] = MappingProxyType(
    {
        VehicleKind.COPTER: VehicleTraits(drives=False, stays=True),
        VehicleKind.ROVER: VehicleTraits(
            drives=True,
            stays=True,
            limits="keeps no distance from others: not with separation_m, band_m or [terrain], and "
            "not commanded by missions",
        ),
        VehicleKind.QUADPLANE: VehicleTraits(
            drives=False,
            stays=False,
            limits="passes its targets, waits on a circle and lands where it took off alone: not "
            "with lines, zones, bases, separation_m, band_m or [terrain], and not commanded by "
            "missions",
        ),
        VehicleKind.PLANE: VehicleTraits(
            drives=False,
            stays=False,
            needs_runway=True,
            limits="passes its targets, waits on a circle, takes off the way it stands and lands "
            "along a runway at its start alone: not with lines, zones, bases, separation_m, band_m "
            "or [terrain], and not commanded by missions",
        ),
    }
)


def turning_acceleration_m_s2(speed_m_s: float, radius_m: float) -> float:
    """With which v/a is what turns add to a leg of a vehicle that cannot stay [m/s²].

    It waits on a circle round one target, leaves it in any direction, turns by the shorter way and
    has arrived on the circle round the next: on the average over directions that is a way of the
    distance and one radius r (0.96 to 1.05 of it from 5 r on), so d/v + v/a with the acceleration
    across of its circle, a = v²/r, is the time of a leg. Shorter legs take up to 2 r/v longer.

    Args:
        speed_m_s: v > 0, on the circle and off it.
        radius_m: r > 0 of the circle, v²/(g·tan of the bank) at the least.
    """
    return speed_m_s * speed_m_s / radius_m


def turn_radius_m(speed_m_s: float, acceleration_m_s2: float) -> float:
    """The radius of which that is the acceleration; see `turning_acceleration_m_s2` [m]."""
    return speed_m_s * speed_m_s / acceleration_m_s2
