"""The newest roster a router knows of: from its folder, and by what is said on the bus.

Leaves out: what the router makes of it (swarm.bus.router).
"""

from __future__ import annotations

import asyncio
from collections.abc import Callable

from swarm.identity import Identity, Roster
from swarm.identity.folder import ROSTER_FILE
from swarm.log import get_logger
from swarm.model.ids import AUTHORITY
from swarm.sealing import seal_of
from swarm.wire.codec import Codec
from swarm.wire.keys import Keys
from swarm.wire.messages import Message, SignedRoster, Stamp
from swarm.wire.seal import UnacceptableError

__all__ = ["Rosters"]

LOOK_S = 1.0
"""How often the folder is looked into [wall s]."""
TELL_S = 30.0
"""How often the roster is repeated on the bus [wall s]."""


class Rosters:
    """Keeps the newest roster of one mission, on disk too; a bad one changes nothing.

    Args:
        identity: whose folder it is, and whose authority counts.

    Raises:
        OSError: its roster cannot be read any more.
        ValueError: that has been changed since the identity was loaded.
    """

    def __init__(self, identity: Identity) -> None:
        self.identity = identity
        seal = seal_of(identity)
        if seal is None:
            raise ValueError("there are no keys")
        self._seal = seal
        self._codec = Codec(identity.mission, seal)
        self._path = identity.folder / ROSTER_FILE
        self._seen: tuple[int, int] | None = None
        self._newer = asyncio.Event()
        self._log = get_logger("router")
        self.key = Keys(identity.mission).roster
        """Where rosters are said."""

    @property
    def roster(self) -> Roster:
        """In force."""
        return self._seal.roster

    def hear(self, key: str, data: bytes) -> None:
        """Somebody says on ``key`` that this is the roster."""
        message = self._codec.decode(key, data)
        if message is None:
            self._log.debug("a bad roster was said", dropped=dict(self._codec.dropped))
        elif isinstance(message.body, SignedRoster):
            self._take(message.body.signed)

    def look(self) -> None:
        """Take the roster in the folder, if that has changed."""
        try:
            found = self._path.stat()
            seen = (found.st_mtime_ns, found.st_size)
            if seen == self._seen:
                return
            self._seen = seen
            self._take(self._path.read_bytes().decode("ascii", "replace"))
        except OSError as fault:
            self._log.debug("the roster cannot be read", problem=fault.strerror or str(fault))

    async def wait_for_newer(self, tell: Callable[[str, bytes], None]) -> None:
        """Return as soon as there is a newer roster than the last time; repeats it meanwhile.

        Args:
            tell: says something on a key.
        """
        loop = asyncio.get_running_loop()
        tell_at_s = loop.time() + LOOK_S  # those who were linked before are back by then
        while not self._newer.is_set():
            self.look()
            if loop.time() >= tell_at_s:
                tell(self.key, self._said())
                tell_at_s = loop.time() + TELL_S
            try:
                async with asyncio.timeout(LOOK_S):
                    await self._newer.wait()
            except TimeoutError:
                continue
        self._newer.clear()

    def _said(self) -> bytes:
        seal = self._seal
        stamp, body = Stamp(seal.roster.version, 0), SignedRoster(seal.signed_roster)
        packed = self._codec.pack(Message(self.identity.mission, AUTHORITY, stamp, body))
        return packed or b""

    def _take(self, signed: str) -> None:
        before = self.roster.version
        try:
            self._seal.put_in_force(signed)
        except UnacceptableError as fault:
            self._log.warning("a roster is not this mission's authority's", problem=fault.reason)
        except OSError as fault:
            problem = fault.strerror or str(fault)
            self._log.warning("the newest roster cannot be kept", problem=problem)
        if self.roster.version != before:
            self._newer.set()
