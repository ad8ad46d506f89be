"""Puts one simulated vehicle on a TCP or UDP port of an asyncio loop.

The vehicle runs in the time of a clock that may be faster than the wall's; it is called when
something arrives and when it asked to be called, never in between.
"""

from __future__ import annotations

import asyncio
import contextlib
import itertools
import socket
from typing import Any, cast

from sim.autopilot.codec import ChannelCodec, ChannelSigning
from sim.autopilot.events import (
    Connected,
    Disconnected,
    MavlinkReceived,
    TimeAdvanced,
    VehicleEvent,
)
from sim.autopilot.faulty_vehicle import FaultyAutopilot
from sim.autopilot.options import Endpoint, Transport
from sim.autopilot.vehicle import COMPONENT_ID, SimulatedAutopilot
from swarm.runtime.clock import Clock, unix_s

_Address = tuple[Any, ...]

_MAX_PEERS = 32
"""UDP peers answered at a time; the one silent longest makes room."""
_PEER_SILENCE_WALL_S = 30.0
_MAX_UNSENT_BYTES = 1 << 20
"""A TCP client that leaves more unread is hung up on."""
_LEAST_SLEEP_WALL_S = 0.001


ServedVehicle = SimulatedAutopilot | FaultyAutopilot


class VehicleServer:
    """One vehicle and its ground stations.

    With a ``signing_secret`` what the vehicle says is signed, and what is not signed so not heard.
    """

    def __init__(
        self,
        vehicle: ServedVehicle,
        endpoint: Endpoint,
        clock: Clock,
        *,
        signing_secret: bytes | None = None,
    ) -> None:
        self.vehicle = vehicle
        self._signing_secret = signing_secret
        self._endpoint = endpoint
        self._clock = clock
        self._channels: dict[int, _TcpChannel | _UdpPeer] = {}
        self._numbers = itertools.count()
        self._timer: asyncio.TimerHandle | None = None
        self._timer_s = 0.0
        self._tcp: asyncio.Server | None = None
        self._udp: _UdpSocket | None = None
        self.url = ""
        """What a ground station is to connect to, once it is started."""

    @property
    def garbage(self) -> int:
        """Pieces of input on open channels that were no message."""
        return sum(channel.codec.garbage for channel in self._channels.values())

    async def start(self) -> None:
        """Open the port.

        Raises:
            OSError: the port is taken, or the host is none of this machine's.
        """
        loop = asyncio.get_running_loop()
        host, port = address = self._endpoint.host, self._endpoint.port
        match self._endpoint.transport:
            case Transport.TCP:
                self._tcp = await loop.create_server(lambda: _TcpChannel(self), host, port)
                host, port = self._tcp.sockets[0].getsockname()[:2]
                kind = "tcp"
            case Transport.UDP_IN:
                _, self._udp = await loop.create_datagram_endpoint(
                    lambda: _UdpSocket(self, fixed=False), local_addr=address
                )
                host, port = self._udp.own_address()[:2]
                kind = "udpout"
            case Transport.UDP_OUT:
                _, self._udp = await loop.create_datagram_endpoint(
                    lambda: _UdpSocket(self, fixed=True), remote_addr=address
                )
                kind = "udpin"
        self.url = f"{kind}:[{host}]:{port}" if ":" in host else f"{kind}:{host}:{port}"
        self.handle(TimeAdvanced())

    async def close(self) -> None:
        """Hang up on everybody and free the port; closing twice is fine."""
        if self._timer is not None:
            self._timer.cancel()
            self._timer = None
        if self._tcp is not None:
            self._tcp.close()
        for channel in list(self._channels.values()):
            channel.hang_up()
        self._channels.clear()
        if self._udp is not None:
            self._udp.close()
        if self._tcp is not None:
            await self._tcp.wait_closed()

    def open_channel(self, channel: _TcpChannel | _UdpPeer) -> int:
        """Take up a ground station; the number of its channel."""
        number = next(self._numbers)
        self._channels[number] = channel
        self.handle(Connected(number))
        return number

    def close_channel(self, number: int) -> None:
        """Forget a ground station."""
        if self._channels.pop(number, None) is not None:
            self.handle(Disconnected(number))

    def received(self, number: int, data: bytes) -> None:
        """Hand bytes of a ground station to the vehicle."""
        if (channel := self._channels.get(number)) is not None:
            for message in channel.codec.decode(data):
                self.handle(MavlinkReceived(number, message))

    def handle(self, event: VehicleEvent) -> None:
        """Let the vehicle take a step, and send what it says."""
        frames: dict[int, list[bytes]] = {}
        for send in self.vehicle.step(event, self._clock.now_s()):
            to = self._channels if send.channel is None else (send.channel,)
            for number in to:
                if (channel := self._channels.get(number)) is not None:
                    frames.setdefault(number, []).append(
                        channel.codec.encode(send.message, send.system_id)
                    )
        for number, batch in frames.items():
            if (channel := self._channels.get(number)) is not None:
                channel.send(batch)
        self._set_timer()

    def new_codec(self, *, datagrams: bool) -> ChannelCodec:
        """What a new channel speaks with."""
        secret = self._signing_secret
        return ChannelCodec(
            self.vehicle.pilot.config.system_id,
            COMPONENT_ID,
            datagrams=datagrams,
            signing=None if secret is None else ChannelSigning(secret, unix_s()),
        )

    def wall_age_s(self, since_s: float) -> float:
        """Wall seconds since an instant of the vehicle's clock."""
        return self._clock.wall_delay_s(self._clock.now_s() - since_s)

    def now_s(self) -> float:
        """The vehicle's time [s]."""
        return self._clock.now_s()

    def _set_timer(self) -> None:
        deadline_s = self.vehicle.next_deadline_s()
        if self._timer is not None:
            if self._timer_s == deadline_s:
                return
            self._timer.cancel()
        self._timer_s = deadline_s
        wall_s = self._clock.wall_delay_s(deadline_s - self._clock.now_s())
        self._timer = asyncio.get_running_loop().call_later(
            max(_LEAST_SLEEP_WALL_S, wall_s), self._on_timer
        )

    def _on_timer(self) -> None:
        self._timer = None
        self.handle(TimeAdvanced())


class _TcpChannel(asyncio.Protocol):
    """One connected client."""

    def __init__(self, server: VehicleServer) -> None:
        self._server = server
        self._number = -1
        self._transport: asyncio.Transport | None = None
        self.codec = server.new_codec(datagrams=False)

    def connection_made(self, transport: asyncio.BaseTransport) -> None:
        self._transport = cast("asyncio.Transport", transport)
        connection = self._transport.get_extra_info("socket")
        if connection is not None:
            connection.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
        self._number = self._server.open_channel(self)

    def data_received(self, data: bytes) -> None:
        self._server.received(self._number, data)

    def connection_lost(self, exc: Exception | None) -> None:
        del exc
        self._transport = None
        self._server.close_channel(self._number)

    def send(self, frames: list[bytes]) -> None:
        if self._transport is None or self._transport.is_closing():
            return
        if self._transport.get_write_buffer_size() > _MAX_UNSENT_BYTES:
            self._transport.abort()
        else:
            self._transport.write(b"".join(frames))

    def hang_up(self) -> None:
        if self._transport is not None:
            self._transport.abort()


class _UdpPeer:
    """One address datagrams come from."""

    def __init__(self, server: VehicleServer, sock: _UdpSocket, address: _Address | None) -> None:
        self._socket = sock
        self._address = address
        self.number = -1
        self.heard_s = server.now_s()
        self.codec = server.new_codec(datagrams=True)

    def send(self, frames: list[bytes]) -> None:
        for frame in frames:
            self._socket.send(frame, self._address)

    def hang_up(self) -> None:
        pass  # the socket is not the peer's


class _UdpSocket(asyncio.DatagramProtocol):
    """A UDP port that tells its peers apart by their addresses."""

    def __init__(self, server: VehicleServer, *, fixed: bool) -> None:
        self._server = server
        self._fixed = fixed
        """Connected to one peer, which is there from the start."""
        self._transport: asyncio.DatagramTransport | None = None
        self._peers: dict[_Address, _UdpPeer] = {}

    def own_address(self) -> _Address:
        assert self._transport is not None  # noqa: S101 - set before the endpoint is returned
        return cast("_Address", self._transport.get_extra_info("sockname"))

    def connection_made(self, transport: asyncio.BaseTransport) -> None:
        self._transport = cast("asyncio.DatagramTransport", transport)
        if self._fixed:
            self._meet((), None)

    def datagram_received(self, data: bytes, addr: _Address) -> None:
        key = () if self._fixed else addr
        peer = self._peers.get(key)
        if peer is None:
            # Noise makes nobody a peer; what is no message is dropped here.
            if not self._server.new_codec(datagrams=True).decode(data):
                return
            self._make_room()
            peer = self._meet(key, addr)
        peer.heard_s = self._server.now_s()
        self._server.received(peer.number, data)

    def error_received(self, exc: Exception) -> None:
        del exc  # a peer that is gone: its silence will be noticed

    def send(self, frame: bytes, address: _Address | None) -> None:
        if self._transport is not None and not self._transport.is_closing():
            with contextlib.suppress(OSError):
                self._transport.sendto(frame, address)

    def close(self) -> None:
        if self._transport is not None:
            self._transport.abort()

    def _meet(self, key: _Address, address: _Address | None) -> _UdpPeer:
        peer = _UdpPeer(self._server, self, address)
        self._peers[key] = peer
        peer.number = self._server.open_channel(peer)
        return peer

    def _make_room(self) -> None:
        by_silence = sorted(self._peers, key=lambda key: self._peers[key].heard_s)
        crowded = len(by_silence) - _MAX_PEERS + 1
        for place, key in enumerate(by_silence):
            silent_s = self._server.wall_age_s(self._peers[key].heard_s)
            if place < crowded or silent_s > _PEER_SILENCE_WALL_S:
                self._server.close_channel(self._peers.pop(key).number)
