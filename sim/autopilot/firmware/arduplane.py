"""ArduPlane without rotors, which needs a runway, as its code of 4.8 says.

It takes off by the first item of its mission, straight ahead in the way it stands, and waits on
circles. RTL leads to the landing of that mission where RTL_AUTOLAND says so, in AUTO: it circles
down before the runway, leaves the circle on a tangent and touches down. Without such a landing it
circles over home for good. Of parameters it has those that change the simulated vehicle or are
asked for. Leaves out: launches, landings that are broken off, the way over home of RTL_AUTOLAND 1,
and what it does in its modes that are flown by hand.

Sources: mode_auto.cpp, mode_rtl.cpp and commands_logic.cpp of ArduPilot's ArduPlane;
https://ardupilot.org/plane/docs/parameters.html.
"""

from __future__ import annotations

from dataclasses import replace
from types import MappingProxyType
from typing import TYPE_CHECKING

from pymavlink.dialects.v20 import ardupilotmega as mavlink

from sim.autopilot.config import VehicleConfig
from sim.autopilot.firmware.quadplane import QuadPlaneModel
from sim.autopilot.flight import FlightMode, RunwayPlaces
from sim.autopilot.mission_item import runway_places_enu_m
from sim.autopilot.parameters import ParameterEntry

if TYPE_CHECKING:
    from sim.autopilot.pilot import Pilot

_MODES = {
    0: FlightMode.MANUAL,
    2: FlightMode.STABILIZE,
    10: FlightMode.AUTO,
    11: FlightMode.RTL,
    12: FlightMode.LOITER,
    15: FlightMode.GUIDED,
}
_REAL = mavlink.MAV_PARAM_TYPE_REAL32
_INT8 = mavlink.MAV_PARAM_TYPE_INT8
_RENAMED = {
    "Q_WP_SPD_UP": "TECS_CLMB_MAX",
    "Q_LAND_FINAL_SPD": "TECS_SINK_MIN",
    "Q_RTL_ALT": "RTL_ALTITUDE",
    "DISARM_DELAY": "LAND_DISARMDELAY",
}
_OTHERWISE = {"LAND_DISARMDELAY": 20.0, "RTL_ALTITUDE": 100.0, "Q_ENABLE": 0.0}
_TO_LANDING = (1.0, 2.0)
"""Values of RTL_AUTOLAND."""


class ArduPlaneModel(QuadPlaneModel):
    """Numbers, names and habits of planes on runways, where they are not those of QuadPlanes."""

    vehicle_type = mavlink.MAV_TYPE_FIXED_WING
    vtol_state = mavlink.MAV_VTOL_STATE_UNDEFINED
    modes = replace(
        QuadPlaneModel.modes,
        unarmable=frozenset({FlightMode.RTL}),
        flies_when_armed=True,
    )
    mode_names = MappingProxyType({number: (mode, mode.value) for number, mode in _MODES.items()})
    told_modes = MappingProxyType(
        {
            FlightMode.MANUAL: "Manual",
            FlightMode.STABILIZE: "Stabilize",
            FlightMode.AUTO: "Auto",
            FlightMode.RTL: "RTL",
            FlightMode.LOITER: "Loiter",
            FlightMode.GUIDED: "Guided",
        }
    )
    missions = replace(QuadPlaneModel.missions, lands_on_runways=True, takes_off_by_itself=True)
    disarms_at_once = frozenset[FlightMode]()

    def parameters(self, config: VehicleConfig) -> tuple[ParameterEntry, ...]:
        """The parameter table at power-up."""
        renamed = (
            replace(each, name=_RENAMED.get(each.name, each.name))
            for each in super().parameters(config)
        )
        kept = (
            replace(each, value=_OTHERWISE.get(each.name, each.value))
            for each in renamed
            if each.name == "Q_ENABLE" or not each.name.startswith("Q_")
        )
        return (*kept, ParameterEntry("RTL_AUTOLAND", 2.0, _INT8, least=0.0))

    def landing_enu_m(self, pilot: Pilot) -> RunwayPlaces | None:
        """That of the mission which stands on it, in AUTO alone."""
        if pilot.mode is not FlightMode.AUTO:
            return None
        return runway_places_enu_m(pilot.store.items, pilot.config.origin, pilot.flight.home_enu_m)

    def lands_by_mission(self, pilot: Pilot) -> int | None:
        """Where RTL_AUTOLAND says so."""
        if pilot.parameters.value("RTL_AUTOLAND") not in _TO_LANDING:
            return None
        commands = [item.command for item in pilot.store.items]
        start = mavlink.MAV_CMD_DO_LAND_START
        return commands.index(start) if start in commands else None
