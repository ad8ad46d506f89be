"""What a vehicle does by itself when its agent or its battery dies, as its parameters say.

A parameter that is not known brings no vehicle home.

Sources: ArduCopter's events.cpp and parameters FS_GCS_ENABLE, FS_GCS_TIMEOUT, MAV_GCS_SYSID
(SYSID_MYGCS before 4.7), MAV_GCS_SYSID_HI and BATT_FS_LOW_ACT; Rover's failsafe.cpp; ArduPlane's
events.cpp and parameters FS_GCS_ENABL, FS_LONG_ACTN, FS_LONG_TIMEOUT and Q_RTL_MODE; PX4's
failsafe.cpp and parameters NAV_DLL_ACT, COM_DL_LOSS_T, COM_DLL_EXCEPT and COM_LOW_BAT_ACT.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

Names = tuple[tuple[str, ...], ...]
"""Parameters to be read, each by all the names that it has had."""

ARDUCOPTER_NAMES: Names = (
    ("FS_GCS_ENABLE",),
    ("MAV_GCS_SYSID", "SYSID_MYGCS"),
    ("MAV_GCS_SYSID_HI",),
    ("FS_GCS_TIMEOUT",),
    ("BATT_FS_LOW_ACT",),
)
ARDUROVER_NAMES: Names = (("BATT_FS_LOW_ACT",),)
QUADPLANE_NAMES: Names = (
    ("FS_GCS_ENABL",),
    ("FS_LONG_ACTN",),
    ("FS_LONG_TIMEOUT",),
    ("Q_RTL_MODE",),
    ("MAV_GCS_SYSID", "SYSID_MYGCS"),
    ("MAV_GCS_SYSID_HI",),
    ("BATT_FS_LOW_ACT",),
)
ARDUPLANE_NAMES: Names = (*(name for name in QUADPLANE_NAMES if name != ("Q_RTL_MODE",)),)
PX4_NAMES: Names = (
    ("NAV_DLL_ACT",),
    ("COM_DLL_EXCEPT",),
    ("COM_DL_LOSS_T",),
    ("COM_LOW_BAT_ACT",),
)

_Asked = tuple[str, tuple[int, ...], str]
"""A parameter, which of its values are good, and what to set else."""
_LANDS_ARDUCOPTER = (5, 7)
_HOLDS, _RETURNS, _LANDS = 1, 2, 3
"""Values of NAV_DLL_ACT."""
_HOLD_EXCEPTED = 2
"""Bit of COM_DLL_EXCEPT: Hold, the mode in which PX4 flies to our targets."""


@dataclass(frozen=True, slots=True)
class Failsafes:
    """What a vehicle does without us."""

    comes_home: bool
    """Whether it returns or lands when its agent falls silent."""
    agent_lost: str
    """What it does then, and why; to be read after "if its agent dies it"."""
    remedy: str
    """What would bring it home; empty where it comes."""
    battery: str | None
    """Why a low battery alone does not bring it home; None if it does."""


def arducopter_failsafes(values: Mapping[str, float], own_system_id: int) -> Failsafes:
    """The failsafes of an ArduCopter whose parameters have these values, as far as known."""
    battery = _battery("BATT_FS_LOW_ACT", values)
    action = values.get("FS_GCS_ENABLE")
    if not action:
        return _stays("hovers", "FS_GCS_ENABLE", action, "set FS_GCS_ENABLE 1", battery)
    if (deaf := _deaf("hovers", values, own_system_id, battery)) is not None:
        return deaf
    does = "lands" if action in _LANDS_ARDUCOPTER else "returns"
    return Failsafes(True, _after(does, values.get("FS_GCS_TIMEOUT")), "", battery)


def ardurover_failsafes(values: Mapping[str, float]) -> Failsafes:
    """Those of a Rover: it drives to its target and stands there, or as FS_ACTION has it."""
    return Failsafes(True, "stops at its target", "", _battery("BATT_FS_LOW_ACT", values))


def _deaf(
    does: str, values: Mapping[str, float], own_system_id: int, battery: str | None
) -> Failsafes | None:
    """Those of an ArduPilot that does not listen to our heartbeats; None: it does."""
    name = "SYSID_MYGCS" if "SYSID_MYGCS" in values else "MAV_GCS_SYSID"
    heard = values.get(name)
    remedy = f"set {name} {own_system_id}"
    if heard is None:
        return _stays(does, name, None, remedy, battery)
    if not heard <= own_system_id <= max(heard, values.get("MAV_GCS_SYSID_HI", 0.0)):
        lost = f"{does} (its failsafe listens to system id {heard:.0f}, not {own_system_id})"
        return Failsafes(False, lost, remedy, battery)
    return None


def quadplane_failsafes(values: Mapping[str, float], own_system_id: int) -> Failsafes:
    """Those of a QuadPlane: it comes home and lands there, or circles until it is empty."""
    return _winged(values, own_system_id, ("Q_RTL_MODE", (1, 2, 3), "set Q_RTL_MODE 1"))


def arduplane_failsafes(values: Mapping[str, float], own_system_id: int) -> Failsafes:
    """Those of a plane on a runway; that its return lands it is seen to before (RTL_AUTOLAND)."""
    return _winged(values, own_system_id)


def _winged(values: Mapping[str, float], own_system_id: int, *more: _Asked) -> Failsafes:
    battery = _battery("BATT_FS_LOW_ACT", values)
    asked: tuple[_Asked, ...] = (
        ("FS_GCS_ENABL", (1, 2), "set FS_GCS_ENABL 1"),
        ("FS_LONG_ACTN", (1,), "set FS_LONG_ACTN 1"),
        *more,
    )
    for name, good, remedy in asked:
        value = values.get(name)
        if value is None or int(value) not in good:
            return _stays("circles", name, value, remedy, battery)
    if (deaf := _deaf("circles", values, own_system_id, battery)) is not None:
        return deaf
    return Failsafes(True, _after("returns", values.get("FS_LONG_TIMEOUT")), "", battery)


def px4_failsafes(values: Mapping[str, float], waits: str = "hovers") -> Failsafes:
    """The failsafes of a PX4 whose parameters have these values, as far as they are known.

    Args:
        values: of its parameters.
        waits: what it does where it is told nothing.
    """
    battery = _battery("COM_LOW_BAT_ACT", values)
    action = values.get("NAV_DLL_ACT")
    remedy = "set NAV_DLL_ACT 2"
    if action not in (_RETURNS, _LANDS):
        does = waits if action in (None, 0, _HOLDS) else "falls"
        return _stays(does, "NAV_DLL_ACT", action, remedy, battery)
    # Versions that know no exceptions make none.
    excepted = values.get("COM_DLL_EXCEPT", 0.0)
    if int(excepted) & _HOLD_EXCEPTED:
        return _stays(waits, "COM_DLL_EXCEPT", excepted, "set COM_DLL_EXCEPT 0", battery)
    does = "lands" if action == _LANDS else "returns"
    return Failsafes(True, _after(does, values.get("COM_DL_LOSS_T")), "", battery)


def _stays(
    does: str, name: str, value: float | None, remedy: str, battery: str | None
) -> Failsafes:
    does = f"may {does.removesuffix('s')}" if value is None else does
    return Failsafes(False, f"{does} ({_told(name, value)})", remedy, battery)


def _battery(name: str, values: Mapping[str, float]) -> str | None:
    value = values.get(name)
    if value is None:
        return f"what it does on a low battery is not known ({name})"
    return None if value else f"it only warns of a low battery ({_told(name, value)})"


def _told(name: str, value: float | None) -> str:
    return f"{name} is not known" if value is None else f"{name} is {value:g}"


def _after(does: str, wait_s: float | None) -> str:
    return does if wait_s is None else f"{does} after {wait_s:g} s"
