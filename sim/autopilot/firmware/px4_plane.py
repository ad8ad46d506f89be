"""PX4 1.17 on a plane that needs a runway, as its own simulator's airplane was seen to fly.

It takes off straight ahead, waits on circles, and returns to the landing that stands on it as a
mission: it climbs to the return height where it is, circles down before the runway, leaves the
circle on a tangent and touches down. Without such a landing it circles over home for good. Leaves
out: launches, dives after take-off, landings that are broken off, and how it flies the landing as a
mission.

Sources: flights of PX4 1.17 (SIH airplane); rtl.cpp and rtl_direct_mission_land.cpp of its
navigator; https://docs.px4.io/main/en/flight_modes_fw/.
"""

from __future__ import annotations

from dataclasses import replace
from types import MappingProxyType
from typing import TYPE_CHECKING

from pymavlink.dialects.v20 import ardupilotmega as mavlink

from agent.vehicle.firmware.kinematics import no_jerk_s
from sim.autopilot.config import VehicleConfig
from sim.autopilot.events import FirmwareEvent, TextTemplate
from sim.autopilot.firmware.px4 import Px4Model
from sim.autopilot.flight import RunwayPlaces
from sim.autopilot.mission_item import runway_places_enu_m
from sim.autopilot.parameters import ParameterEntry

if TYPE_CHECKING:
    from sim.autopilot.pilot import Pilot

_REAL = mavlink.MAV_PARAM_TYPE_REAL32
_INT32 = mavlink.MAV_PARAM_TYPE_INT32
_RENAMED = {
    "MPC_XY_CRUISE": "FW_AIRSPD_TRIM",
    "MPC_XY_VEL_MAX": "FW_AIRSPD_MAX",
    "MPC_TKO_SPEED": "FW_T_CLMB_R_SP",
    "MPC_Z_V_AUTO_UP": "FW_T_CLMB_MAX",
    "MPC_LAND_SPEED": "FW_T_SINK_R_SP",
}
_OTHERWISE = {
    "COM_DISARM_PRFLT": -1.0,
    "MAV_TYPE": float(mavlink.MAV_TYPE_FIXED_WING),
    "MIS_TAKEOFF_ALT": 25.0,
    "NAV_ACC_RAD": 10.0,
    "RTL_DESCEND_ALT": 100.0,
    "RTL_RETURN_ALT": 100.0,
    "SYS_AUTOSTART": 10041.0,
}
"""Values that planes begin with."""
_TO_LANDING = 1.0
"""RTL_TYPE."""


class Px4PlaneModel(Px4Model):
    """Numbers, names and habits of PX4's planes, where they are not those of its copters."""

    vehicle_type = mavlink.MAV_TYPE_FIXED_WING
    missions = replace(Px4Model.missions, lands_on_runways=True)
    jerk_cost_s = staticmethod(no_jerk_s)
    texts = MappingProxyType(
        {
            **{
                event: text
                for event, text in Px4Model.texts.items()
                if event is not FirmwareEvent.RETURN_LANDING
            },
            FirmwareEvent.RETURN_BEGUN: TextTemplate(
                mavlink.MAV_SEVERITY_INFO, "RTL Mission land: climb to {altitude_m:.0f} m"
            ),
        }
    )

    def parameters(self, config: VehicleConfig) -> tuple[ParameterEntry, ...]:
        """The parameter table at power-up."""
        kept = [
            replace(
                each,
                name=_RENAMED.get(each.name, each.name),
                value=_OTHERWISE.get(each.name, each.value),
            )
            for each in super().parameters(config)
            if not each.name.startswith("MPC_") or each.name in _RENAMED
        ]
        own = (
            ParameterEntry("FW_LND_ANG", 5.0, _REAL, least=1.0),
            ParameterEntry("NAV_LOITER_RAD", config.circle_m or 0.0, _REAL, read_only=True),
            ParameterEntry("RTL_TYPE", _TO_LANDING, _INT32, least=0.0),
        )
        return tuple(sorted((*kept, *own), key=lambda each: each.name))

    def landing_enu_m(self, pilot: Pilot) -> RunwayPlaces | None:
        """That of the mission which stands on it, where its return leads there."""
        if pilot.parameters.value("RTL_TYPE") != _TO_LANDING:
            return None
        return runway_places_enu_m(pilot.store.items, pilot.config.origin, pilot.flight.home_enu_m)
