"""PX4's planes that need a runway, as PX4 1.17 behaves.

One is armed in Hold and takes off along the runway on which it stands, straight ahead, climbing.
Then it flies to targets in Hold and waits on a circle round them, as wide as NAV_LOITER_RAD. It
comes home by Return, which leads to a landing that stands on it as a mission (RTL_TYPE 1); without
one it would circle over home until its battery is empty. Its motors stop once it has landed.

PX4 1.17 may begin with the height of the sea for its own in its control of speed and height, where
that starts before its position is known, and comes from there to where it is at some metres a
second: then it dives after take-off. So it was in four of six starts of its simulator that were
looked at, far above the sea; nothing that a ground station hears tells of it.

Leaves out: launches by hand or catapult, VTOL, and commanding by missions.

Sources: https://docs.px4.io/main/en/flight_modes_fw/; rtl.cpp, rtl_direct_mission_land.cpp,
navigator_main.cpp and FixedWingModeManager.cpp of PX4 1.17 for what commands and modes do; flights
of its own simulator's airplane.
"""

from __future__ import annotations

import math
from collections.abc import Mapping

from agent.vehicle.firmware.failsafes import Failsafes, px4_failsafes
from agent.vehicle.firmware.kinematics import (
    PX4_PLANE_LIMITS,
    Kinematics,
    px4_plane_kinematics,
)
from agent.vehicle.firmware.profile import SpeedParameter
from agent.vehicle.firmware.px4 import Px4
from agent.vehicle.landing_pattern import RunwayLanding
from swarm.model.vehicles import VehicleKind

_RETURNS_TO_LANDING = (1.0,)
"""Values of RTL_TYPE with which Return leads to the landing that stands on it, by a direct way."""
_SLOPE_DEG = (1.0, 15.0)
"""What is believed of FW_LND_ANG."""


class Px4Plane(Px4):
    """The firmware of PX4's planes."""

    kind = VehicleKind.PLANE
    vehicle_types = frozenset({1})
    """Fixed wing."""
    takes_missions = False
    landing_names = ("RTL_TYPE", "FW_LND_ANG", "NAV_LOITER_RAD")
    speed_parameters = (SpeedParameter("FW_AIRSPD_TRIM", 1.0),)
    """[m/s] through the air."""
    limit_parameters = PX4_PLANE_LIMITS

    def failsafes(self, values: Mapping[str, float], own_system_id: int) -> Failsafes:
        """As a copter's, but it circles."""
        del own_system_id
        return px4_failsafes(values, "circles")

    def kinematics(self, values: Mapping[str, float]) -> Kinematics:
        """By its turns."""
        return px4_plane_kinematics(values)

    def runway_landing(self, values: Mapping[str, float]) -> RunwayLanding | str:
        """Where Return leads to it."""
        leads, slope_deg = values.get("RTL_TYPE"), values.get("FW_LND_ANG")
        radius_m = abs(values.get("NAV_LOITER_RAD", 0.0))
        if leads not in _RETURNS_TO_LANDING:
            told = "is not known" if leads is None else f"is {leads:g}"
            return f"RTL_TYPE {told}, so it may circle over home for good: set RTL_TYPE 1"
        least_deg, most_deg = _SLOPE_DEG
        if slope_deg is None or not least_deg <= slope_deg <= most_deg:
            return f"FW_LND_ANG is not known, or not within {least_deg:g}..{most_deg:g}"
        if not radius_m > 0.0:
            return "NAV_LOITER_RAD is not known, or 0"
        return RunwayLanding(radius_m, math.radians(slope_deg))
