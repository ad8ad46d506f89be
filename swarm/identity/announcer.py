"""Tells a running fleet the newest roster, and finds out who has it.

A core: it says the roster, asks everyone what they know, and goes by the answers: who has the
same roster leaves it out of its answer, who has another one tells it. It ends when everyone
whose token was seen has it, or when its patience does. Routers, viewers and whoever is out of
reach confirm nothing.
"""

from __future__ import annotations

import math
from collections.abc import Collection, Mapping

from swarm.protocol.events import (
    Ask,
    CommonAction,
    CommonEvent,
    Finish,
    LinkChanged,
    PeerSeen,
    Publish,
    SnapshotsReceived,
)
from swarm.protocol.messages import Message, SignedRoster, Snapshot
from swarm.protocol.registers import Replica

FIRST_S = 0.2
"""Time for the tokens of those who are there to come, before a router begins anew."""
SETTLE_S = 1.2
"""Routers begin anew with a new roster, and clients come back to them, within this time."""
AGAIN_S = 0.4
"""From one question to the next."""


class RosterAnnouncer:
    """A core that spreads one roster.

    It waits no longer than ``patience_s`` for everyone who is there, of ``writers``, who may show a
    token by that roster.
    """

    def __init__(self, message: Message, writers: Collection[str], patience_s: float) -> None:
        self.seen: set[str] = set()
        """Those of the roster whose tokens were seen."""
        self.has: set[str] = set()
        """Those that have the roster."""
        self.other_version: int | None = None
        """Of a roster that somebody has and that this one cannot replace; None as long as
        nobody has."""
        self._message = message
        self._writers = writers
        self._patience_s = patience_s
        self._replica = Replica()
        self._replica.join(message)
        self._leave_at_s = math.inf
        self._settled_at_s = math.inf
        self._again_at_s: float | None = None

    @property
    def lacking(self) -> list[str]:
        """Who was there and has not confirmed it."""
        return sorted(self.seen - self.has)

    def known(self) -> Mapping[str, int]:
        """Digest of all that was heard, so that answers are short."""
        return self._replica.digest()

    def start(self, now_s: float) -> list[CommonAction]:
        """Wait a moment for the tokens of those who are there."""
        self._leave_at_s = now_s + self._patience_s
        self._settled_at_s = now_s + SETTLE_S
        self._again_at_s = now_s + FIRST_S
        return []

    def step(self, fact: CommonEvent, now_s: float) -> list[CommonAction]:
        """Take note of one fact."""
        match fact:
            case PeerSeen(writer) if writer in self._writers:
                self.seen.add(writer)
            case LinkChanged(up=True):
                self._settled_at_s = max(self._settled_at_s, now_s + AGAIN_S)
            case SnapshotsReceived(snapshots):
                for snapshot in snapshots:
                    self._heed(snapshot)
                self._again_at_s = now_s + AGAIN_S
                done = now_s >= self._settled_at_s and not self.lacking
                if done or self.other_version is not None:
                    return [Finish(0)]
            case _:
                pass
        if now_s >= self._leave_at_s:
            return [Finish(0)]
        if self._again_at_s is not None and now_s >= self._again_at_s:
            self._again_at_s = None
            return [Publish(self._message), Ask()]
        return []

    def next_deadline_s(self) -> float:
        """When to speak again, or to leave."""
        return min(self._leave_at_s, math.inf if self._again_at_s is None else self._again_at_s)

    def _heed(self, snapshot: Snapshot) -> None:
        """Note what ``snapshot`` says of its writer's roster."""
        told = [each for each in snapshot.messages if isinstance(each.body, SignedRoster)]
        self._replica.join_all(each for each in snapshot.messages if each not in told)
        for roster in told:
            if roster.stamp >= self._message.stamp and roster.body != self._message.body:
                self.other_version = roster.stamp.incarnation
        if all(roster.body == self._message.body for roster in told):
            self.has.add(snapshot.writer)
        else:
            self.has.discard(snapshot.writer)
