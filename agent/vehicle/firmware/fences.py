"""What a vehicle does about polygons that are put on it as its fence, as its parameters say.

Sources: ArduPilot's AC_Fence.cpp and GCS_Fence.cpp (parameters FENCE_ENABLE, FENCE_TYPE,
FENCE_ACTION and FENCE_AUTOENABLE, which copters have since 4.6, as long as polygons can be switched
on by MAV_CMD_DO_FENCE_ENABLE without circle and heights); PX4's geofence.cpp and parameter
GF_ACTION.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

ARDUCOPTER_FENCE_NAMES = ("FENCE_ENABLE", "FENCE_TYPE", "FENCE_ACTION", "FENCE_AUTOENABLE")
PX4_FENCE_NAMES = ("GF_ACTION",)

POLYGONS = 4
"""Bit of FENCE_TYPE, and of the command that switches fences on."""
_WARNS, _TERMINATES = 1, 4
"""Values of GF_ACTION."""


@dataclass(frozen=True, slots=True)
class FenceSetup:
    """How a vehicle takes polygons."""

    puts: bool
    """Whether polygons are to be put on it."""
    switches: bool = False
    """Whether they are to be switched on by command, and off again."""
    caution: str | None = None
    """What people should know; None if there is nothing."""


def arducopter_fence(values: Mapping[str, float]) -> FenceSetup:
    """How an ArduCopter whose parameters have these values takes polygons, as far as known."""
    kinds = values.get("FENCE_TYPE", float(POLYGONS))
    if not int(kinds) & POLYGONS:
        return FenceSetup(
            False, caution=f"its fence minds no polygons (FENCE_TYPE is {kinds:g}: add {POLYGONS})"
        )
    acts = values.get("FENCE_ACTION", 1.0)
    only_tells = None if acts else "it does nothing there (FENCE_ACTION is 0)"
    if values.get("FENCE_ENABLE") or values.get("FENCE_AUTOENABLE"):
        return FenceSetup(True, caution=only_tells)
    if "FENCE_AUTOENABLE" in values:
        return FenceSetup(True, switches=True, caution=only_tells)
    return FenceSetup(True, caution="its fence may be switched off: set FENCE_ENABLE 1")


def px4_fence(values: Mapping[str, float]) -> FenceSetup:
    """How a PX4 whose parameters have these values takes polygons, as far as known."""
    action = values.get("GF_ACTION")
    if action is None:
        return FenceSetup(False, caution="what it does at a fence is not known (GF_ACTION)")
    if action == _TERMINATES:
        caution = f"it would cut its motors there (GF_ACTION is {action:g})"
        return FenceSetup(False, caution=caution)
    if action <= _WARNS:
        return FenceSetup(True, caution=f"it does nothing there (GF_ACTION is {action:g})")
    return FenceSetup(True)
