"""Rover: ArduPilot's firmware for what drives, as its code of 4.8 says.

It has no take-off and no landing: armed it is under way, and at home it stands, its motors running.
Of parameters it has those that change the simulated vehicle or are asked for by common ground
stations. Leaves out: turns, and boats, which loiter.

Sources: mode_guided.cpp, mode_rtl.cpp, GCS_MAVLink_Rover.cpp and system.cpp of ArduPilot's Rover;
https://ardupilot.org/rover/docs/parameters.html.
"""

from __future__ import annotations

from dataclasses import replace
from types import MappingProxyType
from typing import TYPE_CHECKING

from pymavlink.dialects.v20 import ardupilotmega as mavlink

from agent.vehicle.firmware.kinematics import ardurover_jerk_s
from sim.autopilot.config import VehicleConfig
from sim.autopilot.firmware.ardupilot import ArduCopterModel
from sim.autopilot.firmware.model import GcsFailsafe, MissionBehaviour, ModeBehaviour
from sim.autopilot.flight import FlightMode
from sim.autopilot.parameters import ParameterEntry, ParameterTable

if TYPE_CHECKING:
    from sim.autopilot.pilot import Pilot

_MODES = {
    0: FlightMode.MANUAL,
    4: FlightMode.HOLD,
    5: FlightMode.LOITER,
    10: FlightMode.AUTO,
    11: FlightMode.RTL,
    15: FlightMode.GUIDED,
}
_REAL = mavlink.MAV_PARAM_TYPE_REAL32
_INT8 = mavlink.MAV_PARAM_TYPE_INT8
_RENAMED = {
    "WP_SPD": "WP_SPEED",
    "WP_ACC": "WP_ACCEL",
    "PSC_JERK_NE": "WP_JERK",
    "WP_RADIUS_M": "WP_RADIUS",
}
_OF_COPTERS = frozenset(
    {
        *("WP_JERK", "WP_ACC_CNR", "WP_SPD_UP", "LAND_SPD_MS", "ATC_ANGLE_MAX", "AUTO_OPTIONS"),
        *("DISARM_DELAY", "FENCE_AUTOENABLE", "RTL_ALT_M", "RTL_LOIT_TIME"),
    }
)
_GROUND_LOST = {1: FlightMode.RTL, 2: FlightMode.HOLD, 3: FlightMode.RTL, 4: FlightMode.HOLD}
"""By FS_ACTION; SmartRTL is not simulated."""
_FENCE_MODES = {1: FlightMode.RTL, 2: FlightMode.HOLD, 3: FlightMode.RTL, 4: FlightMode.HOLD}
"""By FENCE_ACTION."""


class ArduRoverModel(ArduCopterModel):
    """Numbers, names and habits of Rover, where they are not ArduCopter's."""

    vehicle_type = mavlink.MAV_TYPE_GROUND_ROVER
    vtol_state = mavlink.MAV_VTOL_STATE_UNDEFINED
    modes = ModeBehaviour(
        at_boot=FlightMode.MANUAL,
        for_reposition=FlightMode.GUIDED,
        by_hand=FlightMode.MANUAL,
        unarmable=frozenset({FlightMode.RTL}),
        change_speed=frozenset({FlightMode.GUIDED, FlightMode.AUTO, FlightMode.RTL}),
        told_at_once=True,
        set_mode_acknowledged_as=mavlink.MAVLINK_MSG_ID_SET_MODE,
    )
    mode_names = MappingProxyType({number: (mode, mode.value) for number, mode in _MODES.items()})
    told_modes = MappingProxyType(
        {
            FlightMode.MANUAL: "Manual",
            FlightMode.HOLD: "Hold",
            FlightMode.LOITER: "Loiter",
            FlightMode.AUTO: "Auto",
            FlightMode.RTL: "RTL",
            FlightMode.GUIDED: "Guided",
        }
    )
    missions = MissionBehaviour(first_item=1, restarts=True)
    jerk_cost_s = staticmethod(ardurover_jerk_s)
    forgets_speed = False
    targets_end_look = False

    def parameters(self, config: VehicleConfig) -> tuple[ParameterEntry, ...]:
        """The parameter table at power-up."""
        kept = (each for each in super().parameters(config) if each.name not in _OF_COPTERS)
        return (
            *(replace(each, name=_RENAMED.get(each.name, each.name)) for each in kept),
            ParameterEntry("CRUISE_SPEED", config.cruise_m_s, _REAL, least=0.0),
            ParameterEntry("ATC_ACCEL_MAX", 0.0, _REAL, least=0.0),
            ParameterEntry("FS_ACTION", 2.0, _INT8, least=0.0),
        )

    def ground_lost(self, parameters: ParameterTable) -> GcsFailsafe | None:
        """Returns or stops, by FS_ACTION, where FS_GCS_ENABLE is on."""
        lost = super().ground_lost(parameters)
        mode = _GROUND_LOST.get(int(parameters.value("FS_ACTION")))
        return None if lost is None or mode is None else replace(lost, mode=mode)

    def fence_mode(self, parameters: ParameterTable) -> FlightMode | None:
        """It returns, or stops."""
        return _FENCE_MODES.get(int(parameters.value("FENCE_ACTION")))

    def system_status(self, pilot: Pilot) -> int:
        """MAV_STATE of a heartbeat: it stands by in HOLD alone."""
        if not pilot.readiness.booted:
            return int(mavlink.MAV_STATE_CALIBRATING)
        holds = pilot.mode is FlightMode.HOLD
        return int(mavlink.MAV_STATE_STANDBY if holds else mavlink.MAV_STATE_ACTIVE)
