"""How much of whom a process takes in: token buckets, before anything is decoded.

Honest processes stay far below the limits, in mission seconds, so that a mission flown
faster than the wall may say as much; who floods loses its own words, not those of others.
What an honest one loses in a storm comes back: registers are repeated, and told to whoever
asks.
"""

from __future__ import annotations

from collections import Counter, OrderedDict
from collections.abc import Callable, Collection
from typing import Final

from swarm.bus.port import BusEvent, LinkDown, LinkUp, Query, Sample, TokenGone, TokenSeen
from swarm.model.ids import AUTHORITY, COORDINATOR, OPERATOR
from swarm.protocol.key_space import KeySpace
from swarm.protocol.seal import (
    NOT_SIGNED,
    NOT_THE_SIGNERS,
    SIGNER_UNKNOWN,
    Envelope,
    Seal,
    open_envelope,
)
from swarm.protocol.sync import Question

TOO_MANY: Final = "too many"
"""Reason under which is counted what came too fast."""
TOO_MANY_NAMES: Final = "too many names"
"""Reason under which is counted what names of UAVs say that are more than anybody has."""
MOST_STRANGERS: Final = 4096
"""Names of which a process takes anything in without a brief that tells of them."""
ASKED_BEFORE: Final = "asked before"
"""Reason under which is counted a question that somebody else says again."""

UAV_HZ, UAV_BURST = 100.0, 1000
"""Of one UAV. It says some 10 a second; when a partition heals, it greets every other one with
up to 5."""
SEAT_HZ, SEAT_BURST = 2000.0, 20_000
"""Of coordinator, operator and authority: a board is posted all at once."""
TOKEN_HZ, TOKEN_BURST = 20.0, 100
"""Of one token: two for each blink of a router."""
ASKER_HZ, ASKER_BURST = 10.0, 30
"""Questions of one asker, where it has signed them; it asks at most 5 a second."""
CLAIMED_HZ, CLAIMED_BURST = 200.0, 400
"""Questions under one name before its signature is checked: anybody can write another's name, and
a router passes on 50 a second of each neighbour."""
QUESTION_HZ, QUESTION_BURST = 100.0, 1000
"""Questions of everybody together, where nobody knows who asks."""
_NOBODY: Final = ""
_SEATS: Final = (AUTHORITY, COORDINATOR, OPERATOR)
_KEPT_QUESTIONS: Final = 4096


class RateLimiter:
    """One token bucket for each of many sources; how many there may be is for who calls to say.

    Each may send ``burst`` at once, and ``rate_hz`` for good.
    """

    def __init__(self, rate_hz: float, burst: int) -> None:
        self._rate_hz = rate_hz
        self._burst = burst
        self._buckets: OrderedDict[str, tuple[float, float]] = OrderedDict()
        """What is left to each source, and when that was so [s]; who was quiet longest first."""

    def __len__(self) -> int:
        """Of how many sources it keeps a record."""
        return len(self._buckets)

    def allows(self, source: str, now_s: float) -> bool:
        """Whether one more from ``source`` may come in now."""
        known = self._buckets.pop(source, None)
        if known is None:
            self._forget_quiet(now_s)
            left = float(self._burst)
        else:
            left, at_s = known
            left = min(self._burst, left + self._rate_hz * max(0.0, now_s - at_s))
        allowed = left >= 1.0
        self._buckets[source] = (left - allowed, now_s)
        return allowed

    def _forget_quiet(self, now_s: float) -> None:
        """Forget whose bucket is full again: never more in all than have ever come in."""
        full_s = self._burst / self._rate_hz
        while self._buckets:
            source = next(iter(self._buckets))
            if self._buckets[source][1] + full_s > now_s:
                return
            del self._buckets[source]


class AdmissionControl:
    """Decides what of all that arrives one process takes in; called from any thread, in turn.

    Where there are keys, a source is who claims to have signed, if that one may write the key:
    nobody uses up what another may say but by its forged name, for which it needs the key of
    that other one at the routers. Else it is whose key it is, and anybody can make names up: of
    those only so many count, but for the UAVs that the brief names, which no flood shuts out.
    """

    def __init__(self, keys: KeySpace, seal: Seal | None, now_s: Callable[[], float]) -> None:
        self.refused: Counter[str] = Counter()
        """What was not let in, by reason."""
        self.fleet: Collection[str] = ()
        """Ids of the UAVs that the brief names, as far as it is known; set as a whole."""
        self._strangers: set[str] = set()
        self._keys = keys
        self._seal = seal
        self._now_s = now_s
        self._uavs = RateLimiter(UAV_HZ, UAV_BURST)
        self._seats = RateLimiter(SEAT_HZ, SEAT_BURST)
        self._tokens = RateLimiter(TOKEN_HZ, TOKEN_BURST)
        self._questions = (
            RateLimiter(QUESTION_HZ, QUESTION_BURST)
            if seal is None
            else RateLimiter(CLAIMED_HZ, CLAIMED_BURST)
        )

    def admits(self, event: BusEvent) -> bool:
        """Whether the process shall see ``event``; counted when not."""
        reason = self._fault(event)
        if reason is not None:
            self.refused[reason] += 1
        return reason is None

    def _fault(self, event: BusEvent) -> str | None:
        match event:
            case Sample(key, payload):
                return self._fault_of_sample(key, payload)
            case Query(payload=payload):
                return self._fault_of_question(payload)
            case TokenSeen(key) | TokenGone(key):
                return self._fault_of_token(key)
            case LinkUp() | LinkDown():
                return None

    def _fault_of_sample(self, key: str, payload: bytes) -> str | None:
        writer = self._keys.writer_of(key) or _NOBODY
        if self._seal is None or writer == AUTHORITY:
            return self._too_many_names(writer) or self._too_many(writer, writer)
        envelope = self._envelope(payload)
        if isinstance(envelope, str):
            return envelope
        if not self._seal.may_speak_for(envelope.signer, writer):
            return NOT_THE_SIGNERS
        return self._too_many(writer, envelope.signer)

    def _too_many(self, writer: str, source: str) -> str | None:
        limiter = self._seats if writer in _SEATS else self._uavs
        return None if limiter.allows(source, self._now_s()) else TOO_MANY

    def _too_many_names(self, writer: str) -> str | None:
        """Why ``writer`` does not count as one more UAV; None if it does, or is none."""
        if writer in (*_SEATS, _NOBODY) or writer in self._strangers or writer in self.fleet:
            return None
        if len(self._strangers) >= MOST_STRANGERS:
            return TOO_MANY_NAMES
        self._strangers.add(writer)
        return None

    def _fault_of_question(self, payload: bytes) -> str | None:
        source = _NOBODY
        if self._seal is not None:
            envelope = self._envelope(payload)
            if isinstance(envelope, str):
                return envelope
            source = envelope.signer
        return None if self._questions.allows(source, self._now_s()) else TOO_MANY

    def _envelope(self, payload: bytes) -> Envelope | str:
        """What claims to be signed by somebody of the roster; else why it is not looked at."""
        envelope = open_envelope(payload)
        if envelope is None:
            return NOT_SIGNED
        known = self._seal is not None and self._seal.roster.entry(envelope.signer) is not None
        return envelope if known else SIGNER_UNKNOWN

    def _fault_of_token(self, key: str) -> str | None:
        writer = self._keys.writer_of_token(key) or _NOBODY
        if self._seal is not None and not self._seal.knows(writer):
            return SIGNER_UNKNOWN
        if self._seal is None and (reason := self._too_many_names(writer)) is not None:
            return reason
        return None if self._tokens.allows(writer, self._now_s()) else TOO_MANY


class QuestionFilter:
    """Decides which questions are answered of those that their asker has signed.

    They count only now, so that nobody uses up what another may ask by its forged name, nor by
    saying its questions again. Where nobody signs, `AdmissionControl` alone counts.
    """

    def __init__(self, now_s: Callable[[], float]) -> None:
        self._now_s = now_s
        self._askers = RateLimiter(ASKER_HZ, ASKER_BURST)
        self._answered: OrderedDict[tuple[str, bytes], None] = OrderedDict()
        """Asker and nonce of the last ones."""

    def fault(self, question: Question) -> str | None:
        """Why ``question`` is not to be answered; None if it is."""
        if question.asker is None:
            return None
        this = question.asker, question.nonce
        if this in self._answered:
            return ASKED_BEFORE
        if not self._askers.allows(question.asker, self._now_s()):
            return TOO_MANY
        self._answered[this] = None
        if len(self._answered) > _KEPT_QUESTIONS:
            self._answered.popitem(last=False)
        return None
