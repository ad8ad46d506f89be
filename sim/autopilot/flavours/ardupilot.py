"""ArduCopter: 4.8 as recorded, or with the older parameter names up to 4.6.

Sources: recordings of ArduCopter 4.8.0-dev, https://ardupilot.org/copter/docs/parameters.html.
Leaves out: parameters that neither change the simulated vehicle nor are asked for
by common ground stations.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from types import MappingProxyType

from pymavlink.dialects.v20 import ardupilotmega as mavlink

from sim.autopilot.config import VehicleConfig
from sim.autopilot.modes import Mode
from sim.autopilot.params import Parameter, Setting
from sim.autopilot.readiness import Stage

__all__ = ["ArduCopter"]

_REAL = mavlink.MAV_PARAM_TYPE_REAL32
_INT8 = mavlink.MAV_PARAM_TYPE_INT8
_INT16 = mavlink.MAV_PARAM_TYPE_INT16
_INT32 = mavlink.MAV_PARAM_TYPE_INT32

_MODES = {
    0: Mode.STABILIZE,
    2: Mode.ALT_HOLD,
    3: Mode.AUTO,
    4: Mode.GUIDED,
    5: Mode.LOITER,
    6: Mode.RTL,
    9: Mode.LAND,
    16: Mode.POSHOLD,
    17: Mode.BRAKE,
}
_NUMBERS = {mode: number for number, mode in _MODES.items()}

_ALWAYS_SET = (
    mavlink.MAV_MODE_FLAG_CUSTOM_MODE_ENABLED
    | mavlink.MAV_MODE_FLAG_STABILIZE_ENABLED
    | mavlink.MAV_MODE_FLAG_MANUAL_INPUT_ENABLED
)


class ArduCopter:
    """Numbers, names and habits of ArduCopter.

    Args:
        old_names: speak with the parameter names and units of releases up to 4.6,
            which answer nothing to a question for an unknown parameter.
    """

    autopilot: int = mavlink.MAV_AUTOPILOT_ARDUPILOTMEGA
    capabilities: int = (
        mavlink.MAV_PROTOCOL_CAPABILITY_MISSION_FLOAT
        | mavlink.MAV_PROTOCOL_CAPABILITY_PARAM_FLOAT
        | mavlink.MAV_PROTOCOL_CAPABILITY_MISSION_INT
        | mavlink.MAV_PROTOCOL_CAPABILITY_COMMAND_INT
        | mavlink.MAV_PROTOCOL_CAPABILITY_SET_POSITION_TARGET_GLOBAL_INT
        | mavlink.MAV_PROTOCOL_CAPABILITY_MAVLINK2
    )
    boot_mode: Mode = Mode.STABILIZE
    reposition_mode: Mode = Mode.GUIDED
    take_off_above_home: bool = True
    uploads_by_int: bool = False
    first_item: int = 1
    unanswered_parameters: frozenset[str] = frozenset({"SYSID_THISMAV"})
    """As recorded: the old name of a renamed parameter got neither value nor error."""
    unasked_streams: Mapping[int, float] = MappingProxyType({})

    stage_texts: Mapping[Stage, str] = MappingProxyType(
        {
            Stage.BOOTED: "ArduPilot Ready",
            Stage.ORIGIN: "EKF3 IMU0 origin set",
            Stage.POSITION: "EKF3 IMU0 is using GPS",
        }
    )
    unarmable_modes: frozenset[Mode] = frozenset({Mode.AUTO, Mode.RTL, Mode.LAND, Mode.BRAKE})
    forgets_speed: bool = True
    """Its position controller starts with the speed parameter at the first target."""

    def __init__(self, *, old_names: bool = False) -> None:
        self._old_names = old_names
        self.reports_parameter_errors: bool = not old_names
        minor = 6 if old_names else 8
        self.version: int = 4 << 24 | minor << 16

    def cannot_arm(self, obstacle: str) -> str:
        """What is said to people when arming is refused."""
        return f"Arm: {obstacle}"

    def not_ready(self, obstacle: str) -> str:
        """What is said to people, now and then, while arming would be refused."""
        return f"PreArm: {obstacle}"

    def parameters(self, config: VehicleConfig) -> tuple[Parameter, ...]:
        """The parameter table at power-up."""
        own = self._old(config) if self._old_names else self._new(config)
        return (
            *own,
            Parameter("DISARM_DELAY", 10.0, _INT8, Setting.DISARM_DELAY_S, least=0.0),
            Parameter("RTL_LOIT_TIME", 5000.0, _INT32, Setting.RETURN_WAIT_S, 1e-3, least=0.0),
            Parameter("GUID_TIMEOUT", 3.0, _REAL, least=0.1),
            Parameter("FS_GCS_ENABLE", 0.0, _INT8),
            Parameter("AUTO_OPTIONS", 0.0, _INT32),
            Parameter("MIS_TOTAL", 0.0, _INT16, read_only=True),
            Parameter("MIS_RESTART", 0.0, _INT8),
        )

    def _new(self, config: VehicleConfig) -> tuple[Parameter, ...]:
        return (
            Parameter("MAV_SYSID", float(config.system_id), _INT16, read_only=True),
            Parameter("ARMING_SKIPCHK", 0.0, _INT32),
            Parameter("WP_SPD", config.cruise_m_s, _REAL, Setting.CRUISE_M_S, least=0.1),
            Parameter("WP_SPD_UP", config.climb_m_s, _REAL, Setting.CLIMB_M_S, least=0.1),
            Parameter("WP_RADIUS_M", 2.0, _REAL, least=0.05),
            Parameter("LAND_SPD_MS", config.land_m_s, _REAL, Setting.LAND_M_S, least=0.1),
            Parameter("RTL_ALT_M", 15.0, _REAL, Setting.RETURN_HEIGHT_M, least=0.0),
            Parameter("MAV1_POSITION", 0.0, _INT16, least=0.0),
        )

    def _old(self, config: VehicleConfig) -> tuple[Parameter, ...]:
        cm = 0.01
        return (
            Parameter("SYSID_THISMAV", float(config.system_id), _INT16, read_only=True),
            Parameter("ARMING_CHECK", 1.0, _INT32),
            Parameter(
                "WPNAV_SPEED", config.cruise_m_s / cm, _REAL, Setting.CRUISE_M_S, cm, least=10.0
            ),
            Parameter(
                "WPNAV_SPEED_UP", config.climb_m_s / cm, _REAL, Setting.CLIMB_M_S, cm, least=10.0
            ),
            Parameter("WPNAV_RADIUS", 200.0, _REAL, least=5.0),
            Parameter("LAND_SPEED", config.land_m_s / cm, _INT16, Setting.LAND_M_S, cm, least=10.0),
            Parameter("RTL_ALT", 1500.0, _INT32, Setting.RETURN_HEIGHT_M, cm, least=0.0),
            Parameter("SR0_POSITION", 0.0, _INT16, least=0.0),
        )

    def custom_mode(self, mode: Mode) -> int:
        """Number of the mode in a heartbeat."""
        return _NUMBERS[mode]

    def mode_of(self, custom_mode: int) -> Mode | None:
        """The mode of that number, if the simulated vehicle has it."""
        return _MODES.get(custom_mode)

    def mode_commanded(self, main: float, sub: float) -> int | None:
        """``custom_mode`` from parameters 2 and 3 of DO_SET_MODE; the third says nothing here."""
        del sub
        return int(main) if math.isfinite(main) else None

    def base_mode(self, mode: Mode, *, armed: bool, on_ground: bool, booted: bool) -> int:
        """MAV_MODE_FLAG bits of a heartbeat.

        ArduCopter sets GUIDED_ENABLED while its position controller runs: so also
        while booting, and no longer once it has returned and landed.
        """
        bits = int(_ALWAYS_SET)
        returned = mode is Mode.RTL and on_ground and not armed
        if not booted or (mode.controls_position and not returned):
            bits |= mavlink.MAV_MODE_FLAG_GUIDED_ENABLED
        if armed:
            bits |= mavlink.MAV_MODE_FLAG_SAFETY_ARMED
        return bits
