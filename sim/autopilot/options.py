"""Reads what is said to `swarm autopilot` about physics and faults.

Leaves out: the options themselves (sim.autopilot.cli).
"""

from __future__ import annotations

import math
from collections.abc import Sequence

from sim.autopilot.faults import FAULT_RULE, VehicleFault, parse_fault
from sim.autopilot.fleet import FleetMember
from swarm.errors import Fault, InputError
from swarm.suggest import instead

__all__ = ["check_wind", "faults_by_uav", "parse_wind", "require_finite"]

_WIND_RULE = "write EAST,NORTH in m/s of where it blows to, such as 3,-1.5"


def require_finite(**options: float | None) -> None:
    """Refuse options that are no finite numbers.

    Raises:
        InputError: some are not.
    """
    faults = [
        Fault(f"--{name.replace('_', '-')}", "", f"{value} is no number to go by", "be finite")
        for name, value in options.items()
        if value is not None and not math.isfinite(value)
    ]
    if faults:
        raise InputError(*faults)


def parse_wind(text: str | None) -> tuple[float, float]:
    """East and north [m/s] of ``EAST,NORTH``; still air without a text.

    Raises:
        InputError: the text says no wind.
    """
    if text is None:
        return 0.0, 0.0
    try:
        east_m_s, north_m_s = (float(word) for word in text.split(","))
    except ValueError:
        raise InputError(Fault("--wind-m-s", text, "no wind", _WIND_RULE)) from None
    if not math.isfinite(east_m_s) or not math.isfinite(north_m_s):
        raise InputError(Fault("--wind-m-s", text, "no wind", _WIND_RULE))
    return east_m_s, north_m_s


def check_wind(wind_m_s: float, still: Sequence[FleetMember]) -> None:
    """Refuse a wind that carries some vehicle away.

    Args:
        wind_m_s: its speed [m/s].
        still: the vehicles as they are in still air.

    Raises:
        InputError: it is at least as fast as they are through the air.
    """
    faults = [
        Fault(
            "--wind-m-s",
            member.uav,
            f"{wind_m_s:g} m/s is too much for a vehicle of {member.config.airspeed_m_s:g} m/s",
            "give less wind, or the UAV more speed_m_s",
        )
        for member in still
        if wind_m_s >= member.config.airspeed_m_s
    ]
    if faults:
        raise InputError(*faults)


def faults_by_uav(
    texts: Sequence[str], known: Sequence[str]
) -> dict[str, tuple[VehicleFault, ...]]:
    """The faults of each UAV that has some.

    Raises:
        InputError: a text says no fault, or of a UAV that is not ``known``.
    """
    faults: list[Fault] = []
    found: dict[str, tuple[VehicleFault, ...]] = {}
    for text in texts:
        try:
            uav, fault = parse_fault(text)
        except ValueError as error:
            faults.append(Fault("--fault", text, str(error), FAULT_RULE))
            continue
        if uav not in known:
            remedy = instead(uav, known, "the scenario has")
            faults.append(Fault("--fault", text, f"no UAV {uav!r}", remedy))
            continue
        found[uav] = (*found.get(uav, ()), fault)
    if faults:
        raise InputError(*faults)
    return found
