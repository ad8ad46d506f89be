"""What PX4's own simulator (SIH) needs to know of each kind of vehicle that it simulates.

Source: ``ROMFS/px4fmu_common/init.d-posix/airframes`` and
``src/modules/simulation/simulator_sih/sih.cpp`` of PX4-Autopilot.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from types import MappingProxyType
from typing import Final

from swarm.model.vehicles import VehicleKind


@dataclass(frozen=True, slots=True)
class Px4Vehicle:
    """One kind: its model and its parameters."""

    model: str
    parameters: Mapping[str, float]


_PX4_DRAG_N_PER_M_S: Final = 0.3
"""Of the simulator's quadrotor of 1 kg. Its own 1.0 lets nothing fall faster than 10 m/s and
takes a tilt of 39° at 8 m/s, where a real one takes 10° to 15°: it creeps up to its speed for 15 s
and overshoots its targets, and every leg takes 7 s longer."""

_PX4_BATTERY_S: Final = 86_400
"""For how long its simulator's battery lasts [s], the most that it takes. Its own 60 s would be
half empty soon after every take-off, and agents that fly a mission with batteries change them for
that again and again."""

PX4_VEHICLES: Final[Mapping[VehicleKind, Px4Vehicle]] = MappingProxyType(
    {
        VehicleKind.COPTER: Px4Vehicle(
            "sihsim_quadx",
            {"SIH_KDV": _PX4_DRAG_N_PER_M_S, "SIM_BAT_DRAIN": _PX4_BATTERY_S},
        ),
        VehicleKind.PLANE: Px4Vehicle("sihsim_airplane", {"SIM_BAT_DRAIN": _PX4_BATTERY_S}),
    }
)
