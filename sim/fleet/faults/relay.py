"""TCP links with the faults of a bad network, one relay on every link of a run.

A relay listens on loopback, dials the real endpoint for each connection it accepts and
passes the bytes on, late. It runs in user space and needs no privileges.

How it imitates what TCP makes of a network's faults, in each direction by itself:

- The bytes of one read travel as segments of up to 1448 bytes. A segment takes ``delay_s``
  and up to ``jitter_s`` more, and the time its bytes need at ``rate_bytes_s``. Order is kept.
- A lost segment is sent again after a retransmission timeout of 0.2 s plus a round trip;
  when it is lost again, after twice that, and so on up to a minute. Everything behind it
  waits, as it does in TCP. Fast retransmissions are left out, as the small and rare
  messages of a fleet seldom have three segments on the way, so bursts fare worse here than
  on a real link. Lost acknowledgements are left out: the next one replaces them.
- A cut swallows everything in both directions, and nobody is told: connections stay open,
  also when one end closes its own, and new ones get no answer. When the cut is healed, a
  connection goes on at its next retransmission, which by then is up to as long away as the
  cut was, at most a minute. One that was begun during the cut is closed then, as by now
  nobody waits for it; whoever dialed it dials again.
"""

from __future__ import annotations

import asyncio
import contextlib
import math
import re
from collections import deque
from collections.abc import Collection
from dataclasses import dataclass
from typing import Self

import numpy as np

from sim.fleet.layout import DialedLink

SEGMENT_BYTES = 1448
SHORTEST_TIMEOUT_S = 0.2
"""Linux waits at least this long, and a round trip, before it sends a segment again."""
LONGEST_TIMEOUT_S = 60.0
CHUNK_BYTES = 64 * 1024
WINDOW_BYTES = 256 * 1024
"""Bytes on the way in one direction; then the sender has to wait."""
DIAL_TIMEOUT_S = 5.0


@dataclass(frozen=True, slots=True)
class RelayQuality:
    """How good a link is, in each direction.

    Raises:
        ValueError: a number makes no sense.
    """

    delay_s: float = 0.0
    """From end to end [s]."""
    jitter_s: float = 0.0
    """A segment takes up to this much longer, evenly distributed [s]."""
    loss_frac: float = 0.0
    """Probability that a segment is lost."""
    most_lost: int | None = None
    """A segment is lost at most so many times running; None: as chance has it."""
    rate_bytes_s: float = math.inf
    """Bandwidth [bytes/s]."""

    def __post_init__(self) -> None:
        if not (0.0 <= self.delay_s < math.inf and 0.0 <= self.jitter_s < math.inf):
            raise ValueError(f"delay_s and jitter_s must be >= 0 and finite, not {self}")
        if not 0.0 <= self.loss_frac < 1.0:
            raise ValueError(f"loss_frac must be within 0..1 and below 1, not {self.loss_frac}")
        if self.most_lost is not None and self.most_lost < 0:
            raise ValueError(f"most_lost must be >= 0, not {self.most_lost}")
        if not self.rate_bytes_s > 0.0:
            raise ValueError(f"rate_bytes_s must be > 0, not {self.rate_bytes_s}")


def stall_s(quality: RelayQuality, n_segment: int, rng: np.random.Generator) -> float:
    """How long retransmissions hold up ``n_segment`` segments sent together [s]."""
    if quality.loss_frac == 0.0:
        return 0.0
    # The first try of a segment succeeds with 1 - loss_frac; tries before that are lost.
    most_lost = int(rng.geometric(1.0 - quality.loss_frac, size=n_segment).max()) - 1
    if quality.most_lost is not None:
        most_lost = min(most_lost, quality.most_lost)
    timeout_s = SHORTEST_TIMEOUT_S + 2.0 * quality.delay_s
    return sum(min(timeout_s * 2.0**k, LONGEST_TIMEOUT_S) for k in range(most_lost))


class Relay:
    """One link to a real endpoint, of any number of connections; may be changed at any time."""

    def __init__(self, host: str, port: int, rng: np.random.Generator) -> None:
        self.quality = RelayQuality()
        """What it is like from now on, for bytes that enter it from now on."""
        self.relayed_bytes = 0
        """Bytes delivered so far, both ways."""
        self.rng = rng
        self._host, self._port = host, port
        self._server: asyncio.Server | None = None
        self._open = asyncio.Event()
        self._open.set()
        self.connections: set[asyncio.Task[None]] = set()
        """Being relayed, those that a cut keeps waiting included."""

    async def start(self) -> None:
        """Begin to listen, on a free port of the loopback interface."""
        self._server = await asyncio.start_server(self._accept, "127.0.0.1", 0)

    @property
    def port(self) -> int:
        """Where it listens."""
        if self._server is None:
            raise ValueError("the relay does not listen")
        return int(self._server.sockets[0].getsockname()[1])

    @property
    def is_cut(self) -> bool:
        """Whether nothing gets through."""
        return not self._open.is_set()

    def cut(self) -> None:
        """Swallow everything from now on, and say nothing."""
        self._open.clear()

    def heal(self) -> None:
        """End a cut."""
        self._open.set()

    async def healed(self) -> None:
        """Wait for the end of a cut."""
        await self._open.wait()

    async def close(self) -> None:
        """Close the port and every connection."""
        if self._server is not None:
            self._server.close()
        for connection in self.connections:
            connection.cancel()
        await asyncio.gather(*self.connections, return_exceptions=True)

    async def _accept(self, reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        connection = asyncio.current_task()
        assert connection is not None  # noqa: S101 - asyncio calls this in a task
        self.connections.add(connection)
        try:
            with contextlib.suppress(OSError, TimeoutError):
                await self._relay(reader, writer)
        except asyncio.CancelledError:
            pass  # closing; asyncio's streams would report the cancellation as a fault
        finally:
            self.connections.discard(connection)
            writer.transport.abort()

    async def _relay(self, reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        if self.is_cut:
            await self.healed()
            return  # nobody waits for this connection any more
        async with asyncio.timeout(DIAL_TIMEOUT_S):
            far_reader, far_writer = await asyncio.open_connection(self._host, self._port)
        try:
            loop = asyncio.get_running_loop()
            ways = [
                loop.create_task(_Way(self, reader, far_writer).run()),
                loop.create_task(_Way(self, far_reader, writer).run()),
            ]
            try:
                await asyncio.wait(ways, return_when=asyncio.FIRST_EXCEPTION)
            finally:
                for way in ways:
                    way.cancel()
                await asyncio.gather(*ways, return_exceptions=True)
        finally:
            far_writer.transport.abort()


class _Way:
    """One direction of one connection."""

    def __init__(
        self, relay: Relay, reader: asyncio.StreamReader, writer: asyncio.StreamWriter
    ) -> None:
        self._relay = relay
        self._reader = reader
        self._writer = writer
        self._queue: deque[tuple[float, bytes]] = deque()
        """When bytes are due at the other end, and the bytes; empty ones end the way."""
        self._queued_bytes = 0
        self._changed = asyncio.Event()
        self._sent_s = 0.0
        self._due_s = 0.0

    async def run(self) -> None:
        """Pass on what comes until the sender closes, and that it has closed."""
        reading = asyncio.get_running_loop().create_task(self._read())
        try:
            await self._write()
        finally:
            reading.cancel()
            await asyncio.gather(reading, return_exceptions=True)

    async def _read(self) -> None:
        data = b"anything"
        while data:
            try:
                data = await self._reader.read(CHUNK_BYTES)
            except OSError:
                data = b""
            self._queue.append((self._due(len(data)), data))
            self._queued_bytes += len(data)
            self._changed.set()
            while self._queued_bytes > WINDOW_BYTES:
                self._changed.clear()
                await self._changed.wait()

    def _due(self, n_byte: int) -> float:
        """When bytes that are sent now arrive; never before those sent earlier."""
        quality, rng = self._relay.quality, self._relay.rng
        self._sent_s = max(self._sent_s, _now_s()) + n_byte / quality.rate_bytes_s
        travel_s = quality.delay_s + quality.jitter_s * rng.random()
        stalled_s = stall_s(quality, max(1, -(-n_byte // SEGMENT_BYTES)), rng)
        self._due_s = max(self._due_s, self._sent_s + travel_s + stalled_s)
        return self._due_s

    async def _write(self) -> None:
        while True:
            while not self._queue:
                self._changed.clear()
                await self._changed.wait()
            due_s, data = self._queue[0]
            await self._travel(due_s)
            self._queue.popleft()
            if not data:
                self._writer.write_eof()
                return
            self._writer.write(data)
            await self._writer.drain()
            self._queued_bytes -= len(data)
            self._relay.relayed_bytes += len(data)
            self._changed.set()

    async def _travel(self, due_s: float) -> None:
        """Wait until bytes due at ``due_s`` really arrive."""
        while True:
            if (wait_s := due_s - _now_s()) > 0.0:
                await asyncio.sleep(wait_s)
            if not self._relay.is_cut:
                return
            await self._relay.healed()
            waited_s = min(_now_s() - due_s, LONGEST_TIMEOUT_S)
            due_s = _now_s() + waited_s * self._relay.rng.random()


def _now_s() -> float:
    return asyncio.get_running_loop().time()


ENDPOINT = re.compile(r"tcp/(127\.0\.0\.1):(\d+)")


class RelayNetwork:
    """The relays of one run.

    Give `through` to `sim.fleet.run.open_run`::

        async with RelayNetwork(seed=1) as network, open_run(…, through=network.through) as run:
            network.degrade(RelayQuality(delay_s=0.03, loss_frac=0.05))
            network.isolate({"uav01", "uav02"})
            network.heal()

    Args:
        seed: of all jitter and losses.
    """

    def __init__(self, *, seed: int = 0) -> None:
        self._sequence = np.random.SeedSequence(seed)
        self._quality = RelayQuality()
        self.relays: dict[DialedLink, Relay] = {}

    async def __aenter__(self) -> Self:
        return self

    async def __aexit__(self, *_: object) -> None:
        await asyncio.gather(*(relay.close() for relay in self.relays.values()))

    async def through(self, link: DialedLink, endpoint: str) -> str:
        """Put a relay on ``link``, which is accepted at ``endpoint``; where to dial it now."""
        match = ENDPOINT.fullmatch(endpoint)
        if match is None:
            raise ValueError(f"only TCP over IPv4's loopback is relayed, not {endpoint}")
        (seed,) = self._sequence.spawn(1)
        relay = Relay(match[1], int(match[2]), np.random.default_rng(seed))
        relay.quality = self._quality
        await relay.start()
        self.relays[link] = relay
        return f"tcp/127.0.0.1:{relay.port}"

    def degrade(self, quality: RelayQuality) -> None:
        """Make all links as good as ``quality`` says."""
        self._quality = quality
        for relay in self.relays.values():
            relay.quality = quality

    def isolate(self, group: Collection[str]) -> None:
        """Cut ``group`` off from all others.

        Of clients, each is alone then, unless a router they can reach is in the group too.
        """
        for link, relay in self.relays.items():
            if (link.dialer in group) != (link.listener in group):
                relay.cut()

    def heal(self) -> None:
        """End all cuts."""
        for relay in self.relays.values():
            relay.heal()
