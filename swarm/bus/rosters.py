"""Whom a router knows: by the newest roster of its folder or the bus, less who floods it.

Leaves out: what the router makes of it (swarm.bus.router).
"""

from __future__ import annotations

import asyncio
from collections.abc import Callable
from dataclasses import replace

from swarm.identity import Identity, Role, Roster
from swarm.identity.folder import ROSTER_FILE
from swarm.identity.roster import Entry
from swarm.limits import Limiter
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
FLOOD_HZ, FLOOD_BURST = 500.0, 3000
"""What a UAV may say, samples and changes of its token together, before it is shut out; an honest
one says some 10 a second, and up to 1000 at once when a partition heals."""


class Rosters:
    """Keeps the newest roster of one mission, on disk too; a bad one changes nothing.

    Args:
        identity: whose folder it is, and whose authority counts.
        look_s: how often the folder is looked into [wall s].

    Raises:
        OSError: its roster cannot be read any more.
        ValueError: that has been changed since the identity was loaded.
    """

    def __init__(self, identity: Identity, look_s: float = LOOK_S) -> None:
        self.identity = identity
        self._look_s = look_s
        seal = seal_of(identity)
        if seal is None:
            raise ValueError("there are no keys")
        self._seal = seal
        self._codec = Codec(identity.mission, seal)
        self._path = identity.folder / ROSTER_FILE
        self._seen: tuple[int, int] | None = None
        self._changed = asyncio.Event()
        self._shut_out: set[str] = set()
        self._heard = Limiter(FLOOD_HZ, FLOOD_BURST)
        self._log = get_logger("router")
        self.key = Keys(identity.mission).roster
        """Where rosters are said."""

    @property
    def roster(self) -> Roster:
        """In force."""
        return self._seal.roster

    @property
    def let_in(self) -> Roster:
        """The same without those who are shut out."""
        kept = (each for each in self.roster.entries if each.common_name not in self._shut_out)
        return replace(self.roster, entries=tuple(kept))

    def flooding(self, entry: Entry | None, now_s: float) -> str | None:
        """Count one saying of theirs; the common name of who says too much of late.

        A UAV alone: the coordinator's token is that of several machines. May be called on any
        thread.

        Args:
            entry: of the roster by which they were let in; None if they are not in it.
            now_s: now.
        """
        if entry is None or entry.role is not Role.UAV:
            return None
        return None if self._heard.allows(entry.common_name, now_s) else entry.common_name

    def shut_out(self, common_name: str) -> None:
        """Let those keys in no more, for as long as this process lives."""
        in_force = any(each.common_name == common_name for each in self.roster.entries)
        if not in_force or common_name in self._shut_out:
            return
        self._shut_out.add(common_name)
        self._changed.set()
        self._log.error(
            f"{common_name} floods the bus and is shut out; give it new keys, or start this "
            "router anew",
            limit_hz=FLOOD_HZ,
        )

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

    async def wait_for_change(self, tell: Callable[[str, bytes], None]) -> None:
        """Return as soon as others are to be let in than the last time; repeats the roster.

        Args:
            tell: says something on a key.
        """
        loop = asyncio.get_running_loop()
        tell_at_s = loop.time() + self._look_s  # those who were linked before are back by then
        while not self._changed.is_set():
            self.look()
            if loop.time() >= tell_at_s:
                tell(self.key, self._said())
                tell_at_s = loop.time() + TELL_S
            try:
                async with asyncio.timeout(self._look_s):
                    await self._changed.wait()
            except TimeoutError:
                continue
        self._changed.clear()

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
            self._changed.set()
