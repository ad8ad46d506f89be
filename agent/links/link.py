"""Byte links to an autopilot by URL: TCP, UDP and serial, on an asyncio loop.

    tcp:HOST:PORT       connects, and again whenever the connection is lost or says nothing
    udpout:HOST:PORT    sends there, receives from there
    udpin:HOST:PORT     waits there, and answers whom its listener takes for the vehicle
    serial:DEVICE:BAUD  a serial port, opened again whenever it disappears

A link reports what happens to three callbacks, in the loop's thread, and never raises
because of its peer. Its own delays are wall seconds. A host is looked up whenever the
link is opened, so it may become known later. A UDP link stays open once it is, whoever
listens; its host is not looked up again. Nothing is delivered late: what this machine still
holds when a link is closed or given up is thrown away. Leaves out: what the bytes mean.
"""

from __future__ import annotations

import asyncio
import contextlib
import socket
import struct
from abc import ABC, abstractmethod
from collections.abc import Hashable
from dataclasses import dataclass
from typing import Protocol, cast

from agent.vehicle.config import LinkAddress, SerialAddress, TcpAddress, UdpInAddress, UdpOutAddress
from swarm.runtime.log import get_logger

try:
    import fcntl
    import termios
except ImportError:  # not POSIX
    _POSIX = False
else:
    _POSIX = True

_FIRST_PAUSE_S = 0.1
_LONGEST_PAUSE_S = 2.0
_CONNECT_TIMEOUT_S = 5.0
_UNSENT_LIMIT_BYTES = 65_536
"""A peer that does not read loses what exceeds this, so that commands never grow old."""
SILENCE_S = 10.0
"""A TCP connection that has said nothing for that long may have lost its other end without
a word, as when a machine is switched off: it is given up and dialled again. Every autopilot
says something each second."""
_UNHEARD_FRAC = 0.5
"""Of that time: after so long the system ends a connection whose other end acknowledges
nothing (tcp(7), TCP_USER_TIMEOUT), and discards what it holds."""
_DISCARD_AT_CLOSE = struct.pack("ii", 1, 0)
"""SO_LINGER, on, 0 s: closing resets the connection, and the system's queue is discarded
instead of being delivered once the peer reads again (socket(7))."""


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

    def received(self, data: bytes, source: Hashable | None = None) -> None:
        """Bytes came; from whom is told where anybody can send, and `ByteLink.answer` takes it."""
        ...


@dataclass(slots=True)
class LinkCounts:
    """What a link could not deliver."""

    unsent: int = 0
    """Pieces that were lost: the link was closed, full, or the network refused them."""
    unsent_bytes: int = 0


class ByteLink(ABC):
    """One link; `start` it once and `close` it once.

    Subclasses open, write and shut one kind of transport.
    """

    def __init__(self, url: str, listener: LinkListener) -> None:
        self.url = url
        self.counts = LinkCounts()
        self._listener = listener
        self._task: asyncio.Task[None] | None = None
        self._lost = asyncio.Event()
        self._told_why = ""
        self._log = get_logger(__name__, link=url)

    def start(self) -> None:
        """Begin to open the link, in the running loop."""
        if self._task is not None:
            raise ValueError("a link starts only once")
        self._task = asyncio.get_running_loop().create_task(self._keep_open())

    def send(self, data: bytes) -> None:
        """Send ``data`` if the link is open and keeps up; else it is lost and counted."""
        if not self._write(data):
            self.counts.unsent += 1
            self.counts.unsent_bytes += len(data)

    def answer(self, source: Hashable | None) -> None:
        """Send to that one of those heard from now on; nothing but where anybody can send."""
        del source

    def give_up(self) -> None:
        """Open the link anew; what was sent and is still in this machine is never delivered."""
        self._shut()
        self._lost.set()

    @abstractmethod
    def discard(self) -> None:
        """Throw away what was sent and is still in this machine, if there is anything."""

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
                self._tell_why(str(error) or "no answer")
                await asyncio.sleep(pause_s)
                pause_s = min(2.0 * pause_s, _LONGEST_PAUSE_S)
                continue
            try:
                self._log.debug("link is open")
                self._told_why = ""
                self._listener.link_up()
                await self._lost.wait()
            finally:
                self._shut()
                self._listener.link_down()
            self._log.debug("link is lost")
            # A peer that accepts and hangs up at once must not be hammered either.
            await asyncio.sleep(pause_s)
            pause_s = _FIRST_PAUSE_S

    def _tell_why(self, reason: str) -> None:
        """Tell people once why the link does not open: it is tried again for ever."""
        if reason != self._told_why:
            self._told_why = reason
            self._log.info("link does not open, trying again", reason=reason)

    def _on_lost(self, error: Exception | None) -> None:
        """Called by transports, whoever closed them."""
        if error is not None:
            self._log.debug("link broke", error=str(error))
        self._lost.set()

    @abstractmethod
    async def _open(self) -> None:
        """Open the transport once; OSError where that cannot be."""

    @abstractmethod
    def _write(self, data: bytes) -> bool:
        """Hand it to the transport; False if it cannot be sent now."""

    @abstractmethod
    def _shut(self) -> None:
        """Close without delivering anything more; shutting twice is fine."""


class _TcpLink(ByteLink, asyncio.Protocol):
    """A TCP client."""

    def __init__(self, address: TcpAddress, listener: LinkListener, silence_s: float) -> None:
        super().__init__(str(address), listener)
        self._address = address
        self._silence_s = silence_s
        self._transport: asyncio.Transport | None = None
        self._heard_s = 0.0
        self._watch: asyncio.TimerHandle | None = None

    async def _open(self) -> None:
        loop = asyncio.get_running_loop()
        self._transport, _ = await loop.create_connection(
            lambda: self, self._address.host, self._address.port
        )
        connection: socket.socket = self._transport.get_extra_info("socket")
        connection.setsockopt(socket.SOL_SOCKET, socket.SO_LINGER, _DISCARD_AT_CLOSE)
        if hasattr(socket, "TCP_USER_TIMEOUT"):  # Linux
            unheard_ms = max(1, round(1e3 * _UNHEARD_FRAC * self._silence_s))
            connection.setsockopt(socket.IPPROTO_TCP, socket.TCP_USER_TIMEOUT, unheard_ms)
        self._heard_s = loop.time()
        self._look_again_at(self._heard_s + self._silence_s)

    def data_received(self, data: bytes) -> None:
        self._heard_s = asyncio.get_running_loop().time()
        self._listener.received(data)

    def connection_lost(self, exc: Exception | None) -> None:
        self._on_lost(exc)

    def _look_again_at(self, when_s: float) -> None:
        self._watch = asyncio.get_running_loop().call_at(when_s, self._look)

    def _look(self) -> None:
        """Give up a connection that has been silent for too long.

        After a pause of this process what has come meanwhile is read before timers ring.
        """
        silent_until_s = self._heard_s + self._silence_s
        if asyncio.get_running_loop().time() < silent_until_s:
            self._look_again_at(silent_until_s)
        else:
            self._log.info("link is silent, dialling again", silence_s=self._silence_s)
            self._lost.set()

    def _write(self, data: bytes) -> bool:
        transport = self._transport
        if transport is None or transport.is_closing():
            return False
        if transport.get_write_buffer_size() + len(data) > _UNSENT_LIMIT_BYTES:
            return False
        transport.write(data)
        return True

    def discard(self) -> None:
        """Open the link anew if the peer's system has not acknowledged everything yet."""
        if self._holds_unsent():
            self.give_up()

    def _holds_unsent(self) -> bool:
        """Whether the peer's system has not acknowledged everything yet."""
        transport = self._transport
        if transport is None or transport.is_closing():
            return False
        return transport.get_write_buffer_size() > 0 or _unacknowledged(
            transport.get_extra_info("socket")
        )

    def _shut(self) -> None:
        if self._watch is not None:
            self._watch.cancel()
            self._watch = None
        if self._transport is not None:
            self._transport.abort()
            self._transport = None


def _unacknowledged(connection: socket.socket) -> bool:
    """Whether the system holds bytes of ours (tcp(7), SIOCOUTQ); if that is unknown, it may."""
    if not _POSIX:
        return True
    try:
        answer = fcntl.ioctl(connection.fileno(), termios.TIOCOUTQ, bytes(4))
    except OSError:
        return True
    return any(answer)


class _UdpLink(ByteLink, asyncio.DatagramProtocol):
    """A UDP socket that speaks to one peer; "port unreachable" closes nothing."""

    def __init__(self, address: UdpInAddress | UdpOutAddress, listener: LinkListener) -> None:
        super().__init__(str(address), listener)
        self._address = address
        self._transport: asyncio.DatagramTransport | None = None
        self._full = False
        self._peer: Hashable | None = None

    async def _open(self) -> None:
        loop = asyncio.get_running_loop()
        place = (self._address.host, self._address.port)
        local = isinstance(self._address, UdpInAddress)
        self._peer = None
        self._full = False
        self._transport, _ = await loop.create_datagram_endpoint(
            lambda: self,
            local_addr=place if local else None,
            remote_addr=None if local else place,
        )
        # Full with the first datagram that has to wait, so that none grows old. Typeshed puts
        # what all transports of asyncio have in those of streams alone.
        self._transport.set_write_buffer_limits(high=0)  # type: ignore[attr-defined]

    def answer(self, source: Hashable | None) -> None:
        """Send there from now on; nowhere if None."""
        self._peer = source

    def datagram_received(self, data: bytes, addr: _Peer) -> None:
        if isinstance(self._address, UdpInAddress):
            self._listener.received(data, addr)
        else:
            self._listener.received(data)

    def error_received(self, exc: Exception) -> None:
        """The network did not take an earlier datagram; the peer may start later."""
        self.counts.unsent += 1
        self._log.debug("datagram refused", error=str(exc))

    def pause_writing(self) -> None:
        """The system takes no more datagrams for now."""
        self._full = True

    def resume_writing(self) -> None:
        """It takes them again."""
        self._full = False

    def connection_lost(self, exc: Exception | None) -> None:
        self._on_lost(exc)

    def _write(self, data: bytes) -> bool:
        transport = self._transport
        if transport is None or transport.is_closing() or self._full:
            return False
        if isinstance(self._address, UdpInAddress):
            if self._peer is None:
                return False
            transport.sendto(data, cast("_Peer", self._peer))
        else:
            transport.sendto(data)
        return True

    def discard(self) -> None:
        """Open the link anew if this machine could not send everything yet."""
        if self._full:
            self.give_up()

    def _shut(self) -> None:
        if self._transport is not None:
            self._transport.abort()
            self._transport = None


def open_link(
    address: LinkAddress, listener: LinkListener, *, silence_s: float = SILENCE_S
) -> ByteLink:
    """The link of that address, not started yet.

    Args:
        address: where the peer is.
        listener: hears of the link.
        silence_s: a TCP connection that says nothing for that long is dialled again.

    Raises:
        InputError: this machine cannot open such a link at all.
    """
    match address:
        case TcpAddress():
            return _TcpLink(address, listener, silence_s)
        case UdpInAddress() | UdpOutAddress():
            return _UdpLink(address, listener)
        case SerialAddress():
            from agent.links.serial_link import SerialLink

            return SerialLink(address, listener)
