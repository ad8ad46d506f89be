"""ArduPlane with rotors (QuadPlane), as its code of 4.8 says, with Q_GUIDED_MODE 0.

It rises and lands upright, and flies to targets on its wings, round which it circles. Of parameters
it has those that change the simulated vehicle or are asked for by common ground stations. Leaves
out: runways, and what it does in its many other modes, in which it hovers.

Sources: GCS_MAVLink_Plane.cpp, mode_guided.cpp and mode_qrtl.cpp of ArduPilot's ArduPlane;
https://ardupilot.org/plane/docs/parameters.html.
"""

from __future__ import annotations

from dataclasses import replace
from types import MappingProxyType

from pymavlink.dialects.v20 import ardupilotmega as mavlink

from agent.vehicle.firmware.kinematics import no_jerk_s
from sim.autopilot.config import VehicleConfig
from sim.autopilot.firmware.ardupilot import ArduCopterModel
from sim.autopilot.firmware.model import GcsFailsafe, MissionBehaviour, ModeBehaviour
from sim.autopilot.flight import FlightMode
from sim.autopilot.parameters import ParameterEntry, ParameterTable

_MODES = {
    0: FlightMode.MANUAL,
    10: FlightMode.AUTO,
    15: FlightMode.GUIDED,
    17: FlightMode.STABILIZE,
    18: FlightMode.ALT_HOLD,
    19: FlightMode.LOITER,
    20: FlightMode.LAND,
    21: FlightMode.RTL,
}
_NAMES = {17: "QSTABILIZE", 18: "QHOVER", 19: "QLOITER", 20: "QLAND", 21: "QRTL"}
_REAL = mavlink.MAV_PARAM_TYPE_REAL32
_INT8 = mavlink.MAV_PARAM_TYPE_INT8
_RENAMED = {
    "WP_SPD": "AIRSPEED_CRUISE",
    "WP_SPD_UP": "Q_WP_SPD_UP",
    "LAND_SPD_MS": "Q_LAND_FINAL_SPD",
    "RTL_ALT_M": "Q_RTL_ALT",
    "WP_RADIUS_M": "WP_RADIUS",
}
_OF_COPTERS = frozenset(
    {"WP_JERK", "WP_ACC_CNR", "ATC_ANGLE_MAX", "AUTO_OPTIONS", "FS_GCS_ENABLE", "FS_GCS_TIMEOUT"}
)
_FAILS_BY_HEARTBEAT = (1.0, 2.0)
_RETURNS = 1.0
_FIXED_ROTORS = 22
"""MAV_TYPE_VTOL_FIXEDROTOR, by a name that dialects differ in."""


class QuadPlaneModel(ArduCopterModel):
    """Numbers, names and habits of QuadPlanes, where they are not ArduCopter's."""

    vehicle_type = _FIXED_ROTORS
    modes = ModeBehaviour(
        at_boot=FlightMode.MANUAL,
        for_reposition=FlightMode.GUIDED,
        by_hand=FlightMode.LOITER,
        unarmable=frozenset({FlightMode.AUTO, FlightMode.RTL, FlightMode.LAND}),
        change_speed=frozenset({FlightMode.GUIDED, FlightMode.AUTO}),
        told_at_once=True,
        set_mode_acknowledged_as=mavlink.MAVLINK_MSG_ID_SET_MODE,
    )
    mode_names = MappingProxyType(
        {number: (mode, _NAMES.get(number, mode.value)) for number, mode in _MODES.items()}
    )
    told_modes = MappingProxyType(
        {
            FlightMode.MANUAL: "Manual",
            FlightMode.AUTO: "Auto",
            FlightMode.GUIDED: "Guided",
            FlightMode.STABILIZE: "QStabilize",
            FlightMode.ALT_HOLD: "QHover",
            FlightMode.LOITER: "QLoiter",
            FlightMode.LAND: "QLand",
            FlightMode.RTL: "QRTL",
        }
    )
    missions = MissionBehaviour(first_item=1, restarts=True)
    jerk_cost_s = staticmethod(no_jerk_s)
    forgets_speed = False
    targets_end_look = False

    def parameters(self, config: VehicleConfig) -> tuple[ParameterEntry, ...]:
        """The parameter table at power-up."""
        kept = (each for each in super().parameters(config) if each.name not in _OF_COPTERS)
        return (
            *(replace(each, name=_RENAMED.get(each.name, each.name)) for each in kept),
            ParameterEntry("WP_LOITER_RAD", config.circle_m or 0.0, _REAL, read_only=True),
            ParameterEntry("Q_ENABLE", 1.0, _INT8, read_only=True),
            ParameterEntry("Q_GUIDED_MODE", 0.0, _INT8, read_only=True),
            ParameterEntry("Q_RTL_MODE", 1.0, _INT8, least=0.0),
            ParameterEntry("FS_GCS_ENABL", 0.0, _INT8, least=0.0),
            ParameterEntry("FS_LONG_ACTN", 0.0, _INT8, least=0.0),
            ParameterEntry("FS_LONG_TIMEOUT", 5.0, _REAL, least=1.0),
        )

    def ground_lost(self, parameters: ParameterTable) -> GcsFailsafe | None:
        """Returns where FS_LONG_ACTN says so; else it flies on."""
        acts = parameters.value("FS_GCS_ENABL") in _FAILS_BY_HEARTBEAT
        if not acts or parameters.value("FS_LONG_ACTN") != _RETURNS:
            return None
        lowest = int(parameters.value("MAV_GCS_SYSID"))
        highest = max(lowest, int(parameters.value("MAV_GCS_SYSID_HI")))
        after_s = parameters.value("FS_LONG_TIMEOUT")
        return GcsFailsafe(FlightMode.RTL, after_s, range(lowest, highest + 1))
