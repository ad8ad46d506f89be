"""What the bridge hears from and says to an autopilot, in SI units.

Names follow https://mavlink.io/en/messages/common.html; only what the bridge uses is here.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from enum import IntEnum


class LandedState(IntEnum):
    """MAV_LANDED_STATE."""

    UNDEFINED = 0
    ON_GROUND = 1
    IN_AIR = 2
    TAKEOFF = 3
    LANDING = 4


_RISES_M_S = 0.3
"""What rises no faster may be hovering."""


class AltitudeFrame(IntEnum):
    """Zero of an altitude; the value is the MAV_FRAME without its ``_INT`` twin."""

    MEAN_SEA_LEVEL = 0
    NONE = 2
    """MAV_FRAME_MISSION: a mission item without a place."""
    HOME = 3


class MissionKind(IntEnum):
    """MAV_MISSION_TYPE: what is transferred by the mission protocol."""

    FLIGHT = 0
    """Mission items proper."""
    FENCE = 1


@dataclass(frozen=True, slots=True)
class Heartbeat:
    """HEARTBEAT of an autopilot."""

    vehicle_type: int
    """MAV_TYPE."""
    autopilot: int
    """MAV_AUTOPILOT."""
    armed: bool
    custom_mode: int
    system_status: int
    """MAV_STATE; below 3 the autopilot is still booting."""


@dataclass(frozen=True, slots=True)
class Position:
    """GLOBAL_POSITION_INT."""

    boot_s: float
    """Time since the autopilot booted [s]."""
    lat_deg: float
    lon_deg: float
    alt_m: float
    """Height above mean sea level [m]."""
    relative_alt_m: float
    """Height above home [m]."""
    velocity_enu_m_s: tuple[float, float, float]
    known: bool
    """False while the autopilot has no position and sends zeros."""

    @property
    def rises(self) -> bool:
        """Whether it climbs straight up, as after a takeoff."""
        east_m_s, north_m_s, up_m_s = self.velocity_enu_m_s
        return up_m_s >= _RISES_M_S and math.hypot(east_m_s, north_m_s) <= 0.5 * up_m_s


@dataclass(frozen=True, slots=True)
class SystemStatus:
    """SYS_STATUS."""

    prearm_ok: bool | None
    """Pre-arm checks pass; None when the autopilot does not report them."""
    prearm_healthy: bool
    """The bit of the pre-arm checks among the healthy sensors, reported as present or not."""
    battery_frac: float | None
    fence_enabled: bool = False
    """Whether the autopilot minds a fence of its own."""


@dataclass(frozen=True, slots=True)
class BatteryStatus:
    """BATTERY_STATUS of one battery."""

    battery_frac: float | None
    number: int = 0
    lifts: bool = True
    """Whether the vehicle flies on it: it is none of avionics or payload alone."""


@dataclass(frozen=True, slots=True)
class EkfStatus:
    """EKF_STATUS_REPORT (ArduPilot) or ESTIMATOR_STATUS (PX4)."""

    flags: int
    """EKF_STATUS_FLAGS or ESTIMATOR_STATUS_FLAGS, whose bits mean the same."""


@dataclass(frozen=True, slots=True)
class ExtendedState:
    """EXTENDED_SYS_STATE."""

    landed: LandedState


@dataclass(frozen=True, slots=True)
class CommandAck:
    """COMMAND_ACK addressed to us or to everybody."""

    command: int
    result: int
    """MAV_RESULT."""


@dataclass(frozen=True, slots=True)
class StatusText:
    """STATUSTEXT."""

    severity: int
    """MAV_SEVERITY; 0 is the worst, 4 a warning, 6 information."""
    text: str


@dataclass(frozen=True, slots=True)
class AvailableMode:
    """AVAILABLE_MODES: one mode by the name that the vehicle has for it."""

    custom_mode: int
    name: str
    """Empty for those of MAVLink's standard modes that PX4 does not name."""
    index: int
    """Its number among the vehicle's modes, from 1."""
    modes: int
    """How many there are."""


@dataclass(frozen=True, slots=True)
class AvailableModesChange:
    """AVAILABLE_MODES_MONITOR."""

    sequence: int
    """Another one than before: so are the modes."""


@dataclass(frozen=True, slots=True)
class CurrentMode:
    """CURRENT_MODE."""

    custom_mode: int
    intended_mode: int
    """Which was asked for; another one if a failsafe chose, 0 if that is not told."""


@dataclass(frozen=True, slots=True)
class ParameterValue:
    """PARAM_VALUE."""

    name: str
    value: float
    integer: int | None = None
    """Its bytes read as a whole number, if it is one: so some firmwares mean them."""


@dataclass(frozen=True, slots=True)
class ParameterMissing:
    """PARAM_ERROR: the autopilot has no such parameter or refuses the value."""

    name: str


@dataclass(frozen=True, slots=True)
class MissionRequest:
    """MISSION_REQUEST or MISSION_REQUEST_INT: asks for one item."""

    seq: int
    kind: MissionKind = MissionKind.FLIGHT


@dataclass(frozen=True, slots=True)
class MissionCount:
    """MISSION_COUNT: announces that many items."""

    count: int
    kind: MissionKind = MissionKind.FLIGHT


@dataclass(frozen=True, slots=True)
class MissionItem:
    """MISSION_ITEM_INT."""

    seq: int
    command: int
    """MAV_CMD."""
    frame: AltitudeFrame
    lat_deg: float
    lon_deg: float
    alt_m: float
    """Height [m] above the zero of ``frame``."""
    params: tuple[float, float, float, float] = (0.0, 0.0, 0.0, 0.0)
    current: bool = False
    autocontinue: bool = True
    kind: MissionKind = MissionKind.FLIGHT


@dataclass(frozen=True, slots=True)
class MissionAck:
    """MISSION_ACK addressed to us or to everybody."""

    result: int
    """MAV_MISSION_RESULT; 0 is accepted."""
    kind: MissionKind = MissionKind.FLIGHT


@dataclass(frozen=True, slots=True)
class MissionCurrent:
    """MISSION_CURRENT."""

    seq: int
    total: int | None = None
    """How many items there are, as the firmware counts them; None: not told."""


@dataclass(frozen=True, slots=True)
class MissionReached:
    """MISSION_ITEM_REACHED; may come several times for one item."""

    seq: int


Inbound = (
    Heartbeat
    | Position
    | SystemStatus
    | BatteryStatus
    | EkfStatus
    | ExtendedState
    | CommandAck
    | StatusText
    | AvailableMode
    | AvailableModesChange
    | CurrentMode
    | ParameterValue
    | ParameterMissing
    | MissionRequest
    | MissionCount
    | MissionItem
    | MissionAck
    | MissionCurrent
    | MissionReached
)


@dataclass(frozen=True, slots=True)
class DecodedMessage:
    """One message and who sent it."""

    system_id: int
    component_id: int
    message: Inbound


@dataclass(frozen=True, slots=True)
class GroundHeartbeat:
    """HEARTBEAT of a ground station."""


@dataclass(frozen=True, slots=True)
class CommandLong:
    """COMMAND_LONG; parameters in the units of the command's own definition."""

    command: int
    params: tuple[float, float, float, float, float, float, float]
    confirmation: int = 0
    """Number of earlier transmissions of the same command."""


@dataclass(frozen=True, slots=True)
class CommandInt:
    """COMMAND_INT with a place."""

    command: int
    frame: AltitudeFrame
    params: tuple[float, float, float, float]
    lat_deg: float
    lon_deg: float
    alt_m: float


@dataclass(frozen=True, slots=True)
class ParameterRead:
    """PARAM_REQUEST_READ by name."""

    name: str


@dataclass(frozen=True, slots=True)
class ParameterSet:
    """PARAM_SET of a real-valued parameter."""

    name: str
    value: float


@dataclass(frozen=True, slots=True)
class MissionRequestList:
    """MISSION_REQUEST_LIST: asks how many items there are."""

    kind: MissionKind = MissionKind.FLIGHT


@dataclass(frozen=True, slots=True)
class MissionSetCurrent:
    """MISSION_SET_CURRENT."""

    seq: int


@dataclass(frozen=True, slots=True)
class MissionClearAll:
    """MISSION_CLEAR_ALL, answered by a `MissionAck`."""

    kind: MissionKind = MissionKind.FLIGHT


Outbound = (
    GroundHeartbeat
    | CommandLong
    | CommandInt
    | ParameterRead
    | ParameterSet
    | MissionCount
    | MissionItem
    | MissionRequest
    | MissionRequestList
    | MissionAck
    | MissionSetCurrent
    | MissionClearAll
)
