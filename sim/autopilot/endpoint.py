"""Addresses on which a vehicle is offered, as people write them.

Leaves out: opening them (sim.autopilot.server).
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from enum import StrEnum

__all__ = ["ENDPOINT_RULE", "Endpoint", "Transport", "parse_endpoint"]

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
