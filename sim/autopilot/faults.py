"""What goes wrong with a simulated vehicle on request, and when.

A fault is written ``KIND@T`` or ``KIND@T+DURATION``, in the vehicle's own seconds. ``T`` 0 is
power-up; every other ``T`` counts from the first time the vehicle is armed, so that a fault meets
a flight at the same place however long preparations took. Without a duration it lasts.
"""

from __future__ import annotations

import math
import re
from dataclasses import dataclass
from enum import StrEnum


class FaultKind(StrEnum):
    """What goes wrong."""

    REBOOT = "reboot"
    """The autopilot loses power for a moment; in the air, the vehicle falls."""
    GPS_LOST = "gps-lost"
    """No satellites: the position told is stale, and modes that need one are refused."""
    BATTERY_LOW = "battery-low"
    """The charge drops at once, to a tenth unless ``battery-low=FRACTION`` says otherwise."""
    SILENT = "silent"
    """Nothing is heard or said on any link."""
    STUCK = "stuck"
    """Targets and missions are acknowledged and not flown."""
    PILOT = "pilot"
    """A pilot takes over with the remote control, and gives the vehicle back at the end."""
    FAILSAFE_RTL = "failsafe-rtl"
    """The remote control is lost, for which the firmware returns."""
    REFUSE_ARMING = "refuse-arming"
    """A check keeps the vehicle from arming."""
    REJECT_MISSION = "reject-mission"
    """Mission uploads are answered with an error."""
    WRONG_ID = "wrong-id"
    """The vehicle says it is another one, and heeds nothing that is said to its own id."""


_AT_ONCE = frozenset({FaultKind.REBOOT, FaultKind.BATTERY_LOW, FaultKind.FAILSAFE_RTL})
"""Faults that are over when they have happened."""
_LOW_FRAC = 0.1
_NUMBER = r"(?:\d+(?:\.\d+)?|\.\d+)"
_FAULT = re.compile(
    rf"(?P<uav>.+):(?P<kind>[a-z-]+)(?:=(?P<charge>{_NUMBER}))?@(?P<at>{_NUMBER})"
    rf"(?:\+(?P<duration>{_NUMBER}))?",
    re.ASCII,
)

FAULT_RULE = (
    "write UAV:KIND@T or UAV:KIND@T+DURATION with T and DURATION in seconds and KIND among "
    + ", ".join(FaultKind)
)


@dataclass(frozen=True, slots=True)
class VehicleFault:
    """One thing that goes wrong with one vehicle.

    Raises:
        ValueError: an instant or charge is out of range, or the kind has no duration.
    """

    kind: FaultKind
    at_s: float
    """0: at power-up; otherwise after the first arming [s]."""
    duration_s: float = math.inf
    charge_frac: float = _LOW_FRAC
    """What is left of the battery, where that is what goes wrong."""

    def __post_init__(self) -> None:
        if not 0.0 <= self.at_s < math.inf:
            raise ValueError(f"T must be 0 or more seconds, not {self.at_s:g}")
        if not self.duration_s > 0.0:
            raise ValueError(f"the duration must be above 0 s, not {self.duration_s:g}")
        if self.kind in _AT_ONCE and self.duration_s != math.inf:
            raise ValueError(f"{self.kind} is over at once and takes no duration")
        if not 0.0 <= self.charge_frac <= 1.0:
            raise ValueError(f"the charge must be within 0..1, not {self.charge_frac:g}")


def parse_fault(text: str) -> tuple[str, VehicleFault]:
    """The UAV's id and the fault in ``UAV:KIND@T+DURATION``.

    Raises:
        ValueError: the text says no fault.
    """
    match = _FAULT.fullmatch(text)
    if match is None:
        raise ValueError("no fault")
    if match["kind"] not in set(FaultKind):
        raise ValueError(f"no kind of fault {match['kind']!r}")
    kind = FaultKind(match["kind"])
    if match["charge"] is not None and kind is not FaultKind.BATTERY_LOW:
        raise ValueError(f"{kind} takes no charge")
    return match["uav"], VehicleFault(
        kind,
        float(match["at"]),
        math.inf if match["duration"] is None else float(match["duration"]),
        _LOW_FRAC if match["charge"] is None else float(match["charge"]),
    )
