"""What the coordinator says: its registers, when anew and when again.

Leaves out: what there is to say (coordinator.core) and keys and bytes (swarm.wire).
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import replace

from swarm.config import Timing
from swarm.events import Publish
from swarm.state.registers import Replica
from swarm.state.voice import Voice
from swarm.wire.messages import Board, Body, Epoch, Message

__all__ = ["Speech"]

ENTRIES_PER_ANNOUNCEMENT = 8
"""Of brief and board, at most."""


class Speech:
    """The statements of one coordinator.

    Args:
        voice: stamps them.
        replica: holds the own registers among all others.
        timing: how often they are repeated.
    """

    def __init__(self, voice: Voice, replica: Replica, timing: Timing) -> None:
        self._voice = voice
        self._replica = replica
        self._announce_s = timing.announce_s
        self._announce_at_s: float | None = None
        self._announced = 0

    @property
    def incarnation(self) -> int:
        """Of this life of the coordinator."""
        return self._voice.incarnation

    def say(self, body: Body) -> Publish:
        """State the new content of an own register."""
        message = self._voice.say(body)
        self._replica.join(message)
        return Publish(message)

    def outdo(self, theirs: Iterable[Message]) -> bool:
        """Speak above ``theirs``, statements from this seat; whether the own were below them."""
        before = self._voice.incarnation
        for message in theirs:
            self._voice.outdo(message.stamp)
        return self._voice.incarnation != before

    def restate(self, others: Iterable[Body] = ()) -> list[Publish]:
        """State every own register anew, ``others`` taking the place of the own.

        The epoch comes first: by it others know who is in charge.
        """
        own = self._replica.messages({self._voice.writer})
        bodies = {_register(body): body for body in (*(m.body for m in own), *others)}
        ordered = sorted(bodies.values(), key=lambda body: not isinstance(body, Epoch))
        return [self.say(body) for body in ordered]

    def repeat(self, now_s: float, mission_s: float) -> list[Publish]:
        """What is due again by now: the epoch with its time, the brief and some of the board.

        Whoever joins asks by itself; this is for what got lost on the way, so a few
        entries at a time are enough and the bus stays quiet on large boards.
        """
        due = self._announce_at_s is not None and self._announce_at_s <= now_s
        if due or self._announce_at_s is None:
            self._announce_at_s = now_s + self._announce_s
        if not due:
            return []
        epoch = self._replica.epoch
        said = [] if epoch is None else [self.say(replace(epoch, mission_s=mission_s))]
        own = list(self._replica.messages({self._voice.writer}))
        rest = [message for message in own if not isinstance(message.body, Epoch)]
        count = min(ENTRIES_PER_ANNOUNCEMENT, len(rest))
        turn = [rest[(self._announced + k) % len(rest)] for k in range(count)]
        self._announced += count
        return said + [Publish(message) for message in turn]

    def hurry(self, now_s: float) -> None:
        """Somebody should hear at once who is in charge."""
        self._announce_at_s = now_s

    def next_deadline_s(self) -> float | None:
        """When `repeat` will next have something to say."""
        return self._announce_at_s


def _register(body: Body) -> tuple[type[Body], str | None]:
    """Which of the coordinator's registers ``body`` is the content of."""
    return type(body), body.task if isinstance(body, Board) else None
