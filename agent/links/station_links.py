"""Sockets to ground stations that are shown one vehicle, and the clock of what they are told.

One datagram each for a frame. From each only its own address is heard: where the agent was told
that it listens. Leaves out: what is said and heard there (agent.vehicle.station_desk).
"""

from __future__ import annotations

import asyncio
from collections.abc import Callable, Hashable, Iterable, Sequence

from agent.core.station_words import ShowStations, StationAction, StationAsked
from agent.links.link import ByteLink, open_link
from agent.vehicle.config import UdpOutAddress
from agent.vehicle.signing import Signing, SigningKey
from agent.vehicle.station_desk import DeskAction, StationDesk, TellStation
from swarm.runtime.clock import Clock, unix_s

_FIRST_LINK_ID = 201
"""Of signed frames to the first ground station; the vehicle's own link has 200."""


class StationLinks:
    """The ground stations of one vehicle. Close them in ``finally``.

    Args:
        addresses: where each listens.
        system_id: of the vehicle.
        clock: vehicle time.
        on_asked: hears what a station asks of the UAV, in the loop's thread; None: none may.
        key: all that is told is signed with it, and nothing unsigned heeded; None: nothing is.
    """

    def __init__(
        self,
        addresses: Iterable[UdpOutAddress],
        system_id: int,
        clock: Clock,
        on_asked: Callable[[StationAsked], None] | None = None,
        *,
        key: SigningKey | None = None,
    ) -> None:
        self._links: list[ByteLink] = [
            open_link(address, _Ear(number, self._opened, self._heard))
            for number, address in enumerate(addresses)
        ]
        signings = [
            None if key is None else Signing(key, unix_s, link_id=_FIRST_LINK_ID + number % 55)
            for number in range(len(self._links))
        ]
        interval_s = 1.0 / clock.wall_delay_s(1.0)
        self._desk = StationDesk(
            system_id, signings, heeds=on_asked is not None, heartbeat_interval_s=interval_s
        )
        self._clock = clock
        self._on_asked = on_asked
        self._timer: asyncio.TimerHandle | None = None
        self._up: set[int] = set()
        """Places of the stations whose sockets are open: to others nothing is said."""
        self._unsaid: ShowStations | None = None
        """What was to be shown before any socket was open."""

    def __bool__(self) -> bool:
        return bool(self._links)

    @property
    def dropped(self) -> int:
        """Frames that did not reach the network, or that it refused."""
        return sum(link.counts.unsent for link in self._links)

    @property
    def distrusted(self) -> int:
        """See `StationDesk.distrusted`."""
        return self._desk.distrusted

    def start(self) -> None:
        """Open the sockets, in the running loop."""
        for link in self._links:
            link.start()

    def show(self, frames: Iterable[bytes]) -> None:
        """Send every frame of the vehicle to everybody."""
        for frame in frames:
            for link in self._links:
                link.send(frame)

    def tell(self, action: StationAction) -> None:
        """Pass on what the agent wants them to know."""
        if not self._up and isinstance(action, ShowStations):
            self._unsaid = action
        elif self._links:
            self._carry_out(self._desk.tell(action, self._clock.now_s()))

    async def close(self) -> None:
        """Close the sockets; closing twice is fine."""
        if self._timer is not None:
            self._timer.cancel()
            self._timer = None
        for link in self._links:
            await link.close()

    def _opened(self, station: int) -> None:
        self._up.add(station)
        if self._timer is None:
            self._ring()

    def _heard(self, station: int, data: bytes) -> None:
        self._carry_out(self._desk.hear(station, data, self._clock.now_s()))

    def _carry_out(self, actions: Sequence[DeskAction]) -> None:
        for action in actions:
            if isinstance(action, TellStation):
                for station in self._up:
                    if action.station in (None, station):
                        self._links[station].send(action.data)
            elif self._on_asked is not None:
                self._on_asked(action)

    def _ring(self) -> None:
        now_s = self._clock.now_s()
        if self._unsaid is not None:
            self._carry_out(self._desk.tell(self._unsaid, now_s))
            self._unsaid = None
        self._carry_out(self._desk.advance(now_s))
        wait_s = self._clock.wall_delay_s(self._desk.next_deadline_s() - now_s)
        self._timer = asyncio.get_running_loop().call_later(max(0.0, wait_s), self._ring)


class _Ear:
    """Listens to one ground station."""

    def __init__(
        self, number: int, opened: Callable[[int], None], heard: Callable[[int, bytes], None]
    ) -> None:
        self._number = number
        self._opened = opened
        self._heard = heard

    def link_up(self) -> None:
        self._opened(self._number)

    def link_down(self) -> None:
        pass

    def received(self, data: bytes, source: Hashable | None = None) -> None:
        del source  # the socket hears that station alone
        self._heard(self._number, data)
