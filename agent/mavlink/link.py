"""Byte links to an autopilot by URL: TCP, UDP and serial, on an asyncio loop.

    tcp:HOST:PORT       connects, and again whenever the connection is lost
    udpout:HOST:PORT    sends there, receives from there
    udpin:HOST:PORT     waits there and answers who speaks
    serial:DEVICE:BAUD  a serial port, opened again whenever it disappears

A link reports what happens to three callbacks, in the loop's thread, and never raises
because of its peer. Its own delays are wall seconds. Leaves out: what the bytes mean.
"""

from __future__ import annotations

import asyncio
import contextlib
from collections.abc import Callable
from dataclasses import dataclass
from typing import Protocol

from agent.mavlink.link_address import (
    LinkAddress,
    SerialAddress,
    TcpAddress,
    UdpInAddress,
    UdpOutAddress,
)
from swarm.log import get_logger

__all__ = ["Link", "LinkCounts", "LinkListener", "open_link"]

_FIRST_PAUSE_S = 0.1
_LONGEST_PAUSE_S = 2.0
_CONNECT_TIMEOUT_S = 5.0
_UNSENT_LIMIT_BYTES = 65_536
"""A peer that does not read loses what exceeds this, so that commands never grow old."""
_PEER_SILENCE_S = 3.0
"""After that much silence of its peer a listening link turns to whoever speaks next."""


_Peer = tuple[str, int] | tuple[str, int, int, int]
"""Address of a UDP peer, version 4 or 6."""


class LinkListener(Protocol):
    """Who hears of a link; called in the loop's thread."""

    def link_up(self) -> None:
        """The link is open."""
        ...

    def link_down(self) -> None:
        """The link is closed; it will open again unless it was closed on purpose."""
        ...

    def received(self, data: bytes) -> None:
        """Bytes came."""
        ...


@dataclass(slots=True)
class LinkCounts:
    """What a link could not deliver."""

    unsent_bytes: int = 0
    foreign_datagrams: int = 0
    """Datagrams of others than the peer."""


class Link:
    """One link; `start` it once and `close` it once.

    Subclasses open, write and shut one kind of transport.
    """

    def __init__(self, url: str, listener: LinkListener) -> None:
        self.url = url
        self.counts = LinkCounts()
        self._listener = listener
        self._task: asyncio.Task[None] | None = None
        self._lost = asyncio.Event()
        self._log = get_logger(__name__, link=url)

    def start(self) -> None:
        """Begin to open the link, in the running loop."""
        if self._task is not None:
            raise ValueError("a link starts only once")
        self._task = asyncio.get_running_loop().create_task(self._keep_open())

    def send(self, data: bytes) -> None:
        """Send ``data`` if the link is open and keeps up; else it is lost and counted."""
        if not self._write(data):
            self.counts.unsent_bytes += len(data)

    async def close(self) -> None:
        """Close for good; closing twice is fine."""
        if self._task is not None:
            self._task.cancel()
            with contextlib.suppress(asyncio.CancelledError):
                await self._task

    async def _keep_open(self) -> None:
        pause_s = _FIRST_PAUSE_S
        while True:
            self._lost.clear()
            try:
                async with asyncio.timeout(_CONNECT_TIMEOUT_S):
                    await self._open()
            except OSError as error:  # TimeoutError included
                self._shut()
                self._log.debug("link does not open", error=str(error), pause_s=pause_s)
                await asyncio.sleep(pause_s)
                pause_s = min(2.0 * pause_s, _LONGEST_PAUSE_S)
                continue
            try:
                self._log.debug("link is open")
                self._listener.link_up()
                await self._lost.wait()
            finally:
                self._shut()
                self._listener.link_down()
            self._log.debug("link is lost")
            # A peer that accepts and hangs up at once must not be hammered either.
            await asyncio.sleep(pause_s)
            pause_s = _FIRST_PAUSE_S

    def _on_lost(self, error: Exception | None) -> None:
        """Called by transports, whoever closed them."""
        if error is not None:
            self._log.debug("link broke", error=str(error))
        self._lost.set()

    async def _open(self) -> None:
        raise NotImplementedError

    def _write(self, data: bytes) -> bool:
        raise NotImplementedError

    def _shut(self) -> None:
        raise NotImplementedError


class _TcpLink(Link):
    """A TCP client."""

    def __init__(self, address: TcpAddress, listener: LinkListener) -> None:
        super().__init__(str(address), listener)
        self._address = address
        self._transport: asyncio.Transport | None = None

    async def _open(self) -> None:
        loop = asyncio.get_running_loop()
        self._transport, _ = await loop.create_connection(
            lambda: _StreamProtocol(self._listener.received, self._on_lost),
            self._address.host,
            self._address.port,
        )

    def _write(self, data: bytes) -> bool:
        transport = self._transport
        if transport is None or transport.is_closing():
            return False
        if transport.get_write_buffer_size() + len(data) > _UNSENT_LIMIT_BYTES:
            return False
        transport.write(data)
        return True

    def _shut(self) -> None:
        if self._transport is not None:
            self._transport.abort()
            self._transport = None


class _StreamProtocol(asyncio.Protocol):
    """Hands the bytes of a TCP connection on."""

    def __init__(
        self, received: Callable[[bytes], None], lost: Callable[[Exception | None], None]
    ) -> None:
        self._received = received
        self._lost = lost

    def data_received(self, data: bytes) -> None:
        self._received(data)

    def connection_lost(self, exc: Exception | None) -> None:
        self._lost(exc)


class _UdpLink(Link):
    """A UDP socket that speaks to one peer."""

    def __init__(self, address: UdpInAddress | UdpOutAddress, listener: LinkListener) -> None:
        super().__init__(str(address), listener)
        self._address = address
        self._transport: asyncio.DatagramTransport | None = None
        self._peer: _Peer | None = None
        self._heard_s = 0.0

    async def _open(self) -> None:
        loop = asyncio.get_running_loop()
        place = (self._address.host, self._address.port)
        self._peer = None

        def protocol() -> _DatagramProtocol:
            return _DatagramProtocol(self._on_datagram, self._on_lost)

        if isinstance(self._address, UdpInAddress):
            self._transport, _ = await loop.create_datagram_endpoint(protocol, local_addr=place)
        else:
            self._transport, _ = await loop.create_datagram_endpoint(protocol, remote_addr=place)

    def _on_datagram(self, data: bytes, sender: _Peer) -> None:
        if isinstance(self._address, UdpInAddress):
            now_s = asyncio.get_running_loop().time()
            if self._peer is None or now_s - self._heard_s > _PEER_SILENCE_S:
                self._peer = sender
            if sender != self._peer:
                self.counts.foreign_datagrams += 1
                return
            self._heard_s = now_s
        self._listener.received(data)

    def _write(self, data: bytes) -> bool:
        transport = self._transport
        if transport is None or transport.is_closing():
            return False
        if isinstance(self._address, UdpInAddress):
            if self._peer is None:
                return False
            transport.sendto(data, self._peer)
        else:
            transport.sendto(data)
        return True

    def _shut(self) -> None:
        if self._transport is not None:
            self._transport.abort()
            self._transport = None


class _DatagramProtocol(asyncio.DatagramProtocol):
    """Hands datagrams on; "port unreachable" is no error, as a peer may start later."""

    def __init__(
        self, received: Callable[[bytes, _Peer], None], lost: Callable[[Exception | None], None]
    ) -> None:
        self._received = received
        self._lost = lost

    def datagram_received(self, data: bytes, addr: _Peer) -> None:
        self._received(data, addr)

    def connection_lost(self, exc: Exception | None) -> None:
        self._lost(exc)


def open_link(address: LinkAddress, listener: LinkListener) -> Link:
    """The link of that address, not started yet.

    Raises:
        InputError: this machine cannot open such a link at all.
    """
    match address:
        case TcpAddress():
            return _TcpLink(address, listener)
        case UdpInAddress() | UdpOutAddress():
            return _UdpLink(address, listener)
        case SerialAddress():
            from agent.mavlink.serial_link import SerialLink

            return SerialLink(address, listener)
