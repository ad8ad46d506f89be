"""Link URLs and what is wrong with them."""

from __future__ import annotations

import re
from dataclasses import dataclass

from swarm.errors import Fault, InputError

__all__ = [
    "LinkAddress",
    "SerialAddress",
    "TcpAddress",
    "UdpInAddress",
    "UdpOutAddress",
    "parse_forward",
    "parse_link",
]

_REMEDY = (
    "give tcp:HOST:PORT, udpout:HOST:PORT, udpin:HOST:PORT or serial:DEVICE:BAUD, "
    "such as tcp:127.0.0.1:5760"
)
_FORWARD_REMEDY = "give udp:HOST:PORT, such as udp:192.168.1.5:14550"
_HOST = re.compile(
    r"\[[0-9A-Fa-f:.]+(%[A-Za-z0-9._-]+)?\]|[A-Za-z0-9_-]{1,63}(\.[A-Za-z0-9_-]{1,63})*"
)


@dataclass(frozen=True, slots=True)
class TcpAddress:
    """A TCP server to connect to."""

    host: str
    port: int

    def __str__(self) -> str:
        return f"tcp:{_bracketed(self.host)}:{self.port}"


@dataclass(frozen=True, slots=True)
class UdpOutAddress:
    """A UDP peer to speak to."""

    host: str
    port: int

    def __str__(self) -> str:
        return f"udpout:{_bracketed(self.host)}:{self.port}"


@dataclass(frozen=True, slots=True)
class UdpInAddress:
    """A local UDP address to wait at."""

    host: str
    port: int

    def __str__(self) -> str:
        return f"udpin:{_bracketed(self.host)}:{self.port}"


@dataclass(frozen=True, slots=True)
class SerialAddress:
    """A serial device and its speed [baud]."""

    device: str
    baud: int

    def __str__(self) -> str:
        return f"serial:{self.device}:{self.baud}"


LinkAddress = TcpAddress | UdpOutAddress | UdpInAddress | SerialAddress


def parse_link(url: str, source: str = "--mavlink") -> LinkAddress:
    """The address that ``url`` names.

    Args:
        url: see the module `agent.mavlink.link`.
        source: where the URL came from, for the message.

    Raises:
        InputError: the URL is none of the four kinds.
    """
    scheme, place, value = _parts(url, ("tcp", "udpout", "udpin", "serial"), source, _REMEDY)
    if scheme == "serial":
        if value == 0:
            raise _fault(source, url, "0 is no baud rate", _REMEDY)
        return SerialAddress(place, value)
    host = _host(url, place, value, source, _REMEDY)
    if scheme == "tcp":
        return TcpAddress(host, value)
    return UdpOutAddress(host, value) if scheme == "udpout" else UdpInAddress(host, value)


def parse_forward(url: str, source: str = "--forward") -> UdpOutAddress:
    """Where a ground station listens that ``url`` names.

    Args:
        url: ``udp:HOST:PORT``.
        source: where the URL came from, for the message.

    Raises:
        InputError: the URL is no such address.
    """
    _, place, value = _parts(url, ("udp",), source, _FORWARD_REMEDY)
    return UdpOutAddress(_host(url, place, value, source, _FORWARD_REMEDY), value)


def _parts(url: str, schemes: tuple[str, ...], source: str, remedy: str) -> tuple[str, str, int]:
    """Scheme, place and number of ``url``."""
    scheme, _, rest = url.partition(":")
    place, _, number = rest.rpartition(":")
    if scheme not in schemes:
        raise _fault(source, url, f"{scheme!r} is no kind of link", remedy)
    if not place:
        raise _fault(source, url, "a part is missing", remedy)
    if not (number.isascii() and number.isdigit() and len(number) < 9):
        raise _fault(source, url, f"{number!r} is not a whole number", remedy)
    return scheme, place, int(number)


def _host(url: str, place: str, port: int, source: str, remedy: str) -> str:
    """The host of ``place``, with its brackets taken off."""
    if not 1 <= port <= 65_535:
        raise _fault(source, url, f"port {port} is not within 1..65535", remedy)
    if _HOST.fullmatch(place) is None:
        raise _fault(source, url, f"{place!r} is no host", remedy)
    return place.strip("[]")


def _fault(source: str, url: str, problem: str, remedy: str) -> InputError:
    return InputError(Fault(source, url, problem, remedy))


def _bracketed(host: str) -> str:
    return f"[{host}]" if ":" in host else host
