"""What ArduPilot's software in the loop needs to know of each kind of vehicle that it simulates.

Source: ArduPilot's own tests, ``Tools/autotest/pysim/vehicleinfo.py`` and the parameter files that
it names, as far as the models need them.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from types import MappingProxyType
from typing import Final

from swarm.model.vehicles import VehicleKind


@dataclass(frozen=True, slots=True)
class ArduPilotVehicle:
    """One kind: its program, its simulator's model and its parameters."""

    variable: str
    """Environment variable that says where the program is."""
    program: str
    """Its usual name."""
    model: str
    parameters: Mapping[str, float]


_CALIBRATED: Final = {
    f"INS_{sensor}{kind}_{axis}": value
    for sensor in ("ACC", "ACC2")
    for kind, value in (("OFFS", 0.001), ("SCAL", 1.001))
    for axis in "XYZ"
}
"""What the calibration of sensors would have left; arming is refused without."""
_COMPASSES: Final = {
    f"COMPASS_OFS{compass}_{axis}": value
    for compass in ("", "2", "3")
    for axis, value in (("X", 5), ("Y", 13), ("Z", -18))
}
_RADIO: Final = {
    **{f"RC{channel}_MIN": 1000 for channel in range(1, 9)},
    **{f"RC{channel}_MAX": 2000 for channel in range(1, 9)},
    **{f"RC{channel}_TRIM": 1500 for channel in range(1, 9)},
}
"""What that of the radio would have left."""
_CAPACITY_MAH: Final = 33_000
"""Of batteries; 3300 mAh unless told otherwise, which reach the agents' reserve of 20 % in six
minutes. The models' voltage does not sag, as SIM_BATT_CAP_AH is 0."""

_COPTER: Final = {
    # A quadrotor in "+" order, as the model is.
    "FRAME_CLASS": 1,
    "FRAME_TYPE": 0,
    **_CALIBRATED,
    **_COMPASSES,
    **_RADIO,
    "FS_THR_ENABLE": 1,
    # The model's battery and motors.
    "BATT_MONITOR": 4,
    "BATT_CAPACITY": _CAPACITY_MAH,
    "MOT_THST_EXPO": 0.65,
    "MOT_THST_HOVER": 0.39,
    "MOT_BAT_VOLT_MIN": 9.6,
    "MOT_BAT_VOLT_MAX": 12.8,
    "ATC_RAT_YAW_P": 0.09,
    "ATC_RAT_YAW_I": 0.009,
}
"""What ArduPilot's own tests give the model; see ``copter.parm`` there."""

_ROVER: Final = {
    **_CALIBRATED,
    **_RADIO,
    "ATC_SPEED_P": 0.1,
    "ATC_STR_RAT_FF": 0.75,
    "BATT_MONITOR": 4,
    "BATT_CAPACITY": _CAPACITY_MAH,
    "CRUISE_SPEED": 5,
    "CRUISE_THROTTLE": 30,
    "WP_RADIUS": 3,
    "WP_SPEED": 5,
    "FS_THR_ENABLE": 0,
}
"""``rover.parm``, and no remote control, without which it is driven here."""

_QUADPLANE: Final = {
    **_CALIBRATED,
    **_RADIO,
    "AIRSPEED_MIN": 13,
    "AIRSPEED_MAX": 35,
    "AIRSPEED_CRUISE": 25,
    "ARSPD_USE": 1,
    "BATT_MONITOR": 4,
    "BATT_CAPACITY": _CAPACITY_MAH,
    **{
        f"COMPASS_OFS{compass}_{axis}": value
        for compass, values in (
            ("", (-0.45357, -0.585846, 6.815743)),
            ("2", (-0.420265, -0.726942, 6.665476)),
            ("3", (-0.420265, -0.726942, 6.665476)),
        )
        for axis, value in zip("XYZ", values, strict=True)
    },
    "KFF_RDDRMIX": 0.5,
    "NAVL1_PERIOD": 14,
    "PTCH_LIM_MAX_DEG": 30,
    "PTCH_LIM_MIN_DEG": -30,
    "ROLL_LIMIT_DEG": 65,
    "PTCH_RATE_P": 0.309954,
    "PTCH_RATE_I": 0.2125,
    "PTCH_RATE_D": 0.0,
    "PTCH_RATE_IMAX": 0.888889,
    "PTCH_RATE_FF": 1.407055,
    "RLL_RATE_P": 0.141009,
    "RLL_RATE_I": 0.2125,
    "RLL_RATE_D": 0.0,
    "RLL_RATE_IMAX": 0.888889,
    "RLL_RATE_FF": 0.552741,
    "SCHED_LOOP_RATE": 300,
    "THR_MAX": 100,
    "THR_FAILSAFE": 0,
    "Q_ENABLE": 1,
    "Q_MAV_TYPE": 22,
    "Q_ASSIST_SPEED": 18,
    "Q_RTL_MODE": 1,
    "Q_M_THST_EXPO": 0.65,
    "Q_M_PWM_MIN": 1000,
    "Q_M_PWM_MAX": 2000,
    "Q_M_BAT_VOLT_MAX": 12.8,
    "Q_M_BAT_VOLT_MIN": 9.6,
    "Q_A_RAT_RLL_P": 0.108,
    "Q_A_RAT_RLL_I": 0.108,
    "Q_A_RAT_RLL_D": 0.001,
    "Q_A_RAT_PIT_P": 0.103,
    "Q_A_RAT_PIT_I": 0.103,
    "Q_A_RAT_PIT_D": 0.001,
    "Q_A_RAT_YAW_P": 0.2,
    "Q_A_RAT_YAW_I": 0.02,
    "Q_A_ANG_RLL_P": 6,
    "Q_A_ANG_PIT_P": 6,
}
"""``quadplane.parm``, with the kind of vehicle told, and no remote control."""

_PLANE: Final = {
    **_CALIBRATED,
    **_RADIO,
    # At 1100, the least unless told otherwise, the model's propeller pulls it along the ground.
    "SERVO3_MIN": 1000,
    "SERVO3_MAX": 2000,
    "AIRSPEED_MIN": 10,
    "AIRSPEED_MAX": 30,
    "AIRSPEED_CRUISE": 22,
    "ARSPD_USE": 1,
    "BATT_MONITOR": 4,
    "BATT_CAPACITY": _CAPACITY_MAH,
    "KFF_RDDRMIX": 0.5,
    "LAND_FLARE_SEC": 3,
    "LAND_PITCH_DEG": 1,
    "NAVL1_PERIOD": 15,
    "PTCH_LIM_MAX_DEG": 25,
    "PTCH_LIM_MIN_DEG": -20,
    "PTCH_RATE_D": 0.007265,
    "PTCH_RATE_FF": 0.595723,
    "PTCH_RATE_I": 0.11,
    "PTCH_RATE_P": 0.15,
    "PTCH2SRV_RMAX_DN": 90,
    "PTCH2SRV_RMAX_UP": 90,
    "PTCH2SRV_TCONST": 0.25,
    "RLL_RATE_D": 0.017430,
    "RLL_RATE_FF": 0.237212,
    "RLL_RATE_I": 0.25,
    "RLL_RATE_P": 0.3,
    "RLL2SRV_RMAX": 90,
    "RLL2SRV_TCONST": 0.25,
    "ROLL_LIMIT_DEG": 65,
    "RTL_AUTOLAND": 2,
    "THR_FAILSAFE": 0,
    "THR_MAX": 100,
    "TRIM_THROTTLE": 50,
    "WP_RADIUS": 50,
}
"""``plane.parm``, with a return that leads to the landing, and no remote control."""

ARDUPILOT_VEHICLES: Final[Mapping[VehicleKind, ArduPilotVehicle]] = MappingProxyType(
    {
        VehicleKind.COPTER: ArduPilotVehicle("SWARM_SITL_ARDUCOPTER", "arducopter", "+", _COPTER),
        VehicleKind.ROVER: ArduPilotVehicle("SWARM_SITL_ROVER", "ardurover", "rover", _ROVER),
        VehicleKind.QUADPLANE: ArduPilotVehicle(
            "SWARM_SITL_PLANE", "arduplane", "quadplane", _QUADPLANE
        ),
        VehicleKind.PLANE: ArduPilotVehicle("SWARM_SITL_PLANE", "arduplane", "plane", _PLANE),
    }
)
