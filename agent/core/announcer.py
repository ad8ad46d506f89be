"""What one agent says: its registers and status, when first and when again."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable

from swarm.protocol.events import Publish
from swarm.protocol.key_space import KeySpace
from swarm.protocol.messages import REVOKED_INCARNATION, Body, Message
from swarm.protocol.register_writer import RegisterWriter
from swarm.protocol.registers import Replica
from swarm.protocol.timing import MOST_STATUS_STRETCH, Timing, earliest
from swarm.protocol.uav_messages import Calibration, Claim, Outcome, Status

_LONGEST_NOTE = 200
"""Characters of a status's note; an autopilot's words may be longer."""
_OUTCOMES_AT_ONCE = 4
"""Outcomes in one announcement; others that missed more ask when they are back."""
_EARLY = 0.5
"""Share of the interval of statuses in small fleets by which one in a large fleet may be early."""


class Announcer:
    """States and repeats the registers and status of one UAV's agent.

    Args:
        replica: holds the own registers among all others.
        timing: how often registers and status are repeated.
    """

    def __init__(self, register_writer: RegisterWriter, replica: Replica, timing: Timing) -> None:
        self._register_writer = register_writer
        self._replica = replica
        self._timing = timing
        self._claim_key = KeySpace(register_writer.mission).claim(register_writer.writer)
        self._note = self._caution = ""
        self._turn = 0
        self._is_claims_turn = True
        self._stretch = 1.0
        self._news: set[str] = set()
        """Keys of own registers whose content has been said once only."""
        self._repeats_news = False
        """Whether what else is news goes out again with what was just restated."""
        self._linked = True
        self._free_at_s = -math.inf
        """When somebody may be greeted again."""
        self._announce_at_s: float | None = None
        self._status_at_s: float | None = None

    @property
    def note(self) -> str:
        """What the status tells a reader about the state of affairs."""
        return self._note or self._caution

    def explain(self, note: str) -> None:
        """From now on the status tells a reader this; "" where there is nothing to tell."""
        self._note = note[:_LONGEST_NOTE]

    def caution(self, caution: str) -> None:
        """From now on it tells this while there is nothing else to tell; "": no more."""
        self._caution = caution[:_LONGEST_NOTE]

    @property
    def incarnation(self) -> int:
        """Of this life of the agent."""
        return self._register_writer.incarnation

    @property
    def claimed(self) -> Message | None:
        """The own claim register."""
        return self._replica.register(self._claim_key)

    def say(self, body: Body, *, instead: bool = False) -> Publish:
        """State the new content of an own register, or what is none: status and choice.

        Args:
            body: the content.
            instead: of what was to be said of the same register, and nobody has heard.
        """
        message = self._register_writer.say(body)
        if self._replica.join(message) and not instead:
            if self._stretch > 1.0 and self._linked and message.key in self._news:
                self._news.discard(message.key)
                self._repeats_news = True
            else:
                self._news.add(message.key)
        return Publish(message)

    def say_to(self, claim: Claim, to: Iterable[str]) -> Publish:
        """State the own claim to those alone, if any; others hear it when it is said next."""
        message = self.claimed
        if message is None or message.body != claim:  # else it is said once more
            message = self._register_writer.say(claim)
            self._replica.join(message)
        return Publish(message, tuple(to))

    def stretch(self, stretch: float) -> None:
        """From now on repeat what is not new that much more seldom; see `stretch_of`."""
        self._stretch = stretch

    def link(self, up: bool) -> None:
        """The own link came up or went down; what is said without one is news when it is back."""
        self._linked = up

    def remember(self, message: Message) -> None:
        """An earlier life said so, and this one has claimed nothing yet."""
        self._register_writer.observe(message.stamp)
        self._replica.join(message)

    def is_foreign(self, message: Message) -> bool:
        """Whether words in this writer's name are newer than any it has said."""
        said = self._replica.known(message)
        return said is None or message.stamp > said.stamp

    def hear_echo(self, message: Message) -> list[Publish]:
        """Learn what others remember of this writer: it must never say less than that."""
        outdone = self._register_writer.observe(message.stamp)
        if isinstance(message.body, Outcome | Calibration):
            self._replica.join(message)
            return []
        said = self._replica.known(message)
        if said is None:
            return []
        self._replica.stale += message.stamp < said.stamp
        return [self.say(said.body)] if outdone and said.stamp < message.stamp else []

    def announce(self, now_s: float) -> list[Publish]:
        """Repeat the own registers, so that what got lost on the way arrives after all.

        Outcomes take turns, so that the bus stays quiet however many there are. In a fleet where
        repetitions are stretched all that is new is told, and one more register: every other time
        the claim, else one of the others.
        """
        own = list(self._replica.messages({self._register_writer.writer}))
        if self._stretch > 1.0:
            always = self._news | ({self._claim_key} if self._is_claims_turn else set())
            at_once = 0 if self._is_claims_turn else 1
            self._is_claims_turn = not self._is_claims_turn
        else:
            always = {m.key for m in own if isinstance(m.body, Claim | Calibration)}
            at_once = _OUTCOMES_AT_ONCE
        said = [message for message in own if message.key in always]
        rest = [message for message in own if message.key not in always]
        for _ in range(min(at_once, len(rest))):
            self._turn = (self._turn + 1) % len(rest)
            said.append(rest[self._turn])
        self._announce_at_s = now_s + self._stretch * self._timing.announce_s
        return self._say_again(said)

    def _say_again(self, said: Iterable[Message]) -> list[Publish]:
        """Repeat these statements, all news among them."""
        if self._linked:
            self._news.clear()
        return [
            self.say(message.body)
            if message.stamp.incarnation == REVOKED_INCARNATION
            else Publish(message)
            for message in said
        ]

    def greet(self, now_s: float) -> list[Publish]:
        """Somebody is there anew: repeat the own registers, once for all who come together."""
        if now_s >= self._free_at_s:
            self._free_at_s = now_s + self._stretch * self._timing.ask_gap_s
            self._is_claims_turn = True
            return self.announce(now_s)
        self._announce_at_s = earliest(self._announce_at_s, self._free_at_s)
        self._is_claims_turn = True
        return []

    def repeat(self, status: Callable[[], Status], now_s: float, *, learned: bool) -> list[Publish]:
        """What is due again by now; registers only once they are ``learned`` to be news at all."""
        said: list[Publish] = []
        if self._repeats_news:
            self._repeats_news = False
            news = filter(None, map(self._replica.register, sorted(self._news)))
            said += self._say_again(list(news))
        if self._news and self._announce_at_s is not None:  # soon, however seldom the rest
            self._announce_at_s = min(self._announce_at_s, now_s + self._timing.announce_s)
        if learned and (self._announce_at_s is None or self._announce_at_s <= now_s):
            said += self.announce(now_s)
        # Of many, a status that is due soon is said now: each step of its own costs as much again.
        soon_s = now_s + (_EARLY * self._timing.status_s if self._stretch > 1.0 else 0.0)
        if self._status_at_s is None or self._status_at_s <= soon_s:
            stretch = min(self._stretch, MOST_STATUS_STRETCH)
            self._status_at_s = now_s + stretch * self._timing.status_s
            said.append(self.say(status()))
        return said

    def has_news(self, now_s: float) -> bool:
        """Whether `repeat` would say news, or when it will, though nothing else is due."""
        if self._repeats_news or not self._news or self._announce_at_s is None:
            return self._repeats_news
        return self._announce_at_s > now_s + self._timing.announce_s

    def next_deadline_s(self) -> float | None:
        """When `repeat` will next have something to say."""
        return earliest(self._announce_at_s, self._status_at_s)
