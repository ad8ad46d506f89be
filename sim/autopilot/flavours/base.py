"""What a firmware decides for the simulated vehicle; everything else is common.

Leaves out: any firmware in particular.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Protocol

from sim.autopilot.config import VehicleConfig
from sim.autopilot.modes import Mode
from sim.autopilot.params import Parameter
from sim.autopilot.readiness import Stage

__all__ = ["Flavour"]


class Flavour(Protocol):
    """Numbers, names and habits of one firmware."""

    autopilot: int
    """MAV_AUTOPILOT."""
    capabilities: int
    """MAV_PROTOCOL_CAPABILITY."""
    version: int
    """``flight_sw_version`` of AUTOPILOT_VERSION."""
    boot_mode: Mode
    """Mode after power-up."""
    reposition_mode: Mode
    """Mode in which DO_REPOSITION is flown."""
    take_off_above_home: bool
    """Whether NAV_TAKEOFF by command gives its height above home, rather than above the sea."""
    uploads_by_int: bool
    """Whether mission items are asked for by MISSION_REQUEST_INT."""
    first_item: int
    """Number of the first mission item that is flown: 1 where item 0 is home."""
    reports_parameter_errors: bool
    """Whether an unknown parameter is answered by PARAM_ERROR; otherwise by nothing."""
    unanswered_parameters: frozenset[str]
    """Unknown parameters that are answered by nothing all the same."""
    unasked_streams: Mapping[int, float]
    """Messages and intervals [s] streamed on a new channel; heartbeats go without saying."""

    stage_texts: Mapping[Stage, str]
    """What is said to people when something has become ready."""
    unarmable_modes: frozenset[Mode]
    """Modes in which a ground station can't arm."""
    forgets_speed: bool
    """Whether a speed ordered before the first target, after the commanded mode was entered
    or after a take-off, is lost."""

    def cannot_arm(self, obstacle: str) -> str:
        """What is said to people when arming is refused."""
        ...

    def not_ready(self, obstacle: str) -> str:
        """What is said to people, now and then, while arming would be refused."""
        ...

    def parameters(self, config: VehicleConfig) -> tuple[Parameter, ...]:
        """The parameter table at power-up; it has every `Setting`."""
        ...

    def custom_mode(self, mode: Mode) -> int:
        """Number of the mode in a heartbeat."""
        ...

    def mode_of(self, custom_mode: int) -> Mode | None:
        """The mode of that number; None where the firmware, or its simulation, has none."""
        ...

    def mode_commanded(self, main: float, sub: float) -> int | None:
        """``custom_mode`` from parameters 2 and 3 of DO_SET_MODE; None if they make no sense."""
        ...

    def base_mode(self, mode: Mode, *, armed: bool, on_ground: bool, booted: bool) -> int:
        """MAV_MODE_FLAG bits of a heartbeat."""
        ...
