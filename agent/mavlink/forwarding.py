"""Shows a vehicle to ground stations: its frames as they came, one datagram each.

One way only: a ground station sees, the bridge alone commands. Two who command one
vehicle undo each other's orders, and the bridge would take the other's for its pilot's;
a pilot takes over by radio control or on a link of their own. What ground stations say is
not read. A frame that cannot be sent at once is dropped and counted.

Of a link that several vehicles share, only the configured one's frames are shown, since
each has a bridge of its own; with a signing key only those that are believed.

Leaves out: sockets (agent.mavlink.link) and choosing among the frames.
"""

from __future__ import annotations

from collections.abc import Hashable, Iterable

from agent.mavlink.link import open_link
from agent.mavlink.link_address import UdpOutAddress

__all__ = ["Forwarding"]


class Forwarding:
    """Ground stations that watch one vehicle. Close it in ``finally``.

    Args:
        addresses: where they listen.
    """

    def __init__(self, addresses: Iterable[UdpOutAddress]) -> None:
        self._links = [open_link(address, _Deaf()) for address in addresses]

    def __bool__(self) -> bool:
        return bool(self._links)

    @property
    def dropped(self) -> int:
        """Frames that did not reach the network, or that it refused."""
        return sum(link.counts.unsent for link in self._links)

    def start(self) -> None:
        """Open the sockets, in the running loop."""
        for link in self._links:
            link.start()

    def show(self, frames: Iterable[bytes]) -> None:
        """Send every frame to everybody."""
        for frame in frames:
            for link in self._links:
                link.send(frame)

    async def close(self) -> None:
        """Close the sockets; closing twice is fine."""
        for link in self._links:
            await link.close()


class _Deaf:
    """Takes no notice of a link."""

    def link_up(self) -> None:
        pass

    def link_down(self) -> None:
        pass

    def received(self, data: bytes, source: Hashable | None = None) -> None:
        pass
