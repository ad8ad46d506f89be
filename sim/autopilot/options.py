"""Reads what is said to `swarm autopilot` about addresses, physics and faults."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from enum import StrEnum

from sim.autopilot.config import FleetMember
from sim.autopilot.faults import FAULT_RULE, VehicleFault, parse_fault
from swarm.runtime.errors import Fault, InputError, remedy_for_name

ENDPOINT_RULE = "write tcp:HOST:PORT, udpin:HOST:PORT or udpout:HOST:PORT"


class Transport(StrEnum):
    """How a vehicle can be reached."""

    TCP = "tcp"
    """Accepts connections."""
    UDP_IN = "udpin"
    """Waits for datagrams and answers whoever sent one."""
    UDP_OUT = "udpout"
    """Sends to a fixed address first."""


@dataclass(frozen=True, slots=True)
class Endpoint:
    """Where a vehicle is offered."""

    transport: Transport
    host: str
    port: int
    """0 takes any free port."""

    def shifted(self, by: int) -> Endpoint:
        """The endpoint of the vehicle ``by`` places later.

        Free ports stay free ports, and a ground station that is sent to stays the same.
        """
        if self.port == 0 or self.transport is Transport.UDP_OUT:
            return self
        return replace(self, port=self.port + by)


def parse_endpoint(text: str) -> Endpoint:
    """The endpoint written as ``tcp:``, ``udpin:`` or ``udpout:`` and ``HOST:PORT``.

    Raises:
        ValueError: it is not written so.
    """
    name, _, address = text.partition(":")
    host, _, port_text = address.rpartition(":")
    host = host.removeprefix("[").removesuffix("]")
    if name not in set(Transport) or not host or not port_text.isascii():
        raise ValueError(f"{text!r} is no endpoint; {ENDPOINT_RULE}")
    transport = Transport(name)
    least = 1 if transport is Transport.UDP_OUT else 0
    if not port_text.isdigit() or not least <= int(port_text) <= 65535:
        raise ValueError(f"{text!r} has no port within {least}..65535; {ENDPOINT_RULE}")
    return Endpoint(transport, host, int(port_text))


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
    """Refuse a wind of that speed if it carries some vehicle away.

    Raises:
        InputError: it is at least as fast as one of them is through ``still`` air.
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
            remedy = remedy_for_name(uav, known, "the scenario has")
            faults.append(Fault("--fault", text, f"no UAV {uav!r}", remedy))
            continue
        found[uav] = (*found.get(uav, ()), fault)
    if faults:
        raise InputError(*faults)
    return found
