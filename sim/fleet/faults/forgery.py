"""What a hostile peer says: one malformed message of every kind, on the keys everyone reads.

Everything here is to be dropped and counted by whoever hears it. Well-formed lies, against which
only access control helps, are not among it.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from enum import StrEnum
from itertools import count
from typing import Any

import msgpack
import numpy as np

from swarm.model.ids import COORDINATOR
from swarm.protocol.encoding import LARGE_LIMIT_BYTES, SMALL_LIMIT_BYTES, encode
from swarm.protocol.fields import MAX_COUNT
from swarm.protocol.key_space import KeySpace
from swarm.protocol.messages import (
    SCHEMA_VERSION,
    Message,
    MissionPhase,
    PlanEpoch,
    Snapshot,
    Stamp,
    TaskEntry,
)
from swarm.protocol.uav_messages import AttemptResult, Claim, ClaimPhase, Outcome, Status

NEWEST = MAX_COUNT // 2
"""An incarnation that would beat every honest one, were the message taken."""
SETTLED_S = 3.0
"""A register this old is known to everybody, so that an older statement is old to all."""


class Malformation(StrEnum):
    """Ways in which a message is malformed."""

    RANDOM = "random bytes"
    TRUNCATED = "truncated"
    WRONG_TYPES = "wrong types"
    LONG = "longer than a register may be"
    HUGE = "longer than anything may be"
    VERSION = "unknown version"
    MISSION = "another mission's"
    UNKNOWN = "of no known kind"
    KEY = "another's register"
    NAN = "not a number"
    OLD = "counters going back"


REASONS: dict[Malformation, str] = dict.fromkeys(Malformation, "malformed") | {
    Malformation.LONG: "too large",
    Malformation.HUGE: "too large",
    Malformation.VERSION: "unknown version",
    Malformation.MISSION: "another mission",
    Malformation.UNKNOWN: "unknown kind",
    Malformation.KEY: "said on another's key",
    Malformation.OLD: "stale",
}
"""Under which reason each is counted."""


@dataclass(frozen=True, slots=True)
class Forgery:
    """One malformed message."""

    kind: Malformation
    key: str
    payload: bytes


class MessageForger:
    """Forges messages of one mission: of its UAVs, about its tasks."""

    def __init__(
        self, mission: str, uavs: Sequence[str], tasks: Sequence[str], rng: np.random.Generator
    ) -> None:
        self._mission = mission
        self._keys = KeySpace(mission)
        self._uavs = uavs
        self._tasks = tasks
        self._rng = rng
        self._counter = count(1)
        self._answers = 0
        self._heard: dict[str, tuple[float, Message]] = {}

    def hear(self, message: Message, now_s: float) -> None:
        """Take note of an honest register, to replay what is older."""
        if not isinstance(message.body, Status) and message.stamp.incarnation > 0:
            self._heard[message.key] = now_s, message

    def batch(self, now_s: float) -> list[Forgery]:
        """One message of each kind; none with an old counter as long as nothing was heard."""
        made = [self._forge(kind) for kind in Malformation if kind is not Malformation.OLD]
        old = self._old(now_s)
        return made if old is None else [*made, old]

    def answer(self, writer: str) -> bytes:
        """A malformed answer to a question on ``state/<writer>``, each time another."""
        self._answers += 1
        registers = tuple(self._message() for _ in range(3))
        honest = msgpack.unpackb(encode(Snapshot(self._mission, writer, NEWEST, 1.0, registers)))
        version, mission, _, incarnation, mission_s, said = honest
        faulty: list[Any] = [
            [version, mission, writer, incarnation, math.nan, said],
            [version, mission, self._uavs[0], incarnation, mission_s, said],
            [version + 1, mission, writer, incarnation, mission_s, said],
            [version, mission, writer, -1, mission_s, said],
            [version, mission, writer, incarnation, mission_s, {"registers": said}],
            [version, mission, writer, incarnation, mission_s, [[1], None, said]],
            honest[:-1],
            bytes(LARGE_LIMIT_BYTES),
        ]
        payload: bytes = msgpack.packb(faulty[self._answers % len(faulty)])
        return payload

    # -- kinds ------------------------------------------------------------------------------

    def _forge(self, kind: Malformation) -> Forgery:
        said = self._message()
        key, honest = said.key, encode(said)
        parts = msgpack.unpackb(honest)
        match kind:
            case Malformation.RANDOM:
                payload = self._rng.bytes(int(self._rng.integers(0, 400)))
            case Malformation.TRUNCATED:
                payload = honest[: int(self._rng.integers(0, len(honest)))]
            case Malformation.WRONG_TYPES:
                field = str(self._rng.choice(sorted(parts[-1])))
                wrong = [{"a": [None]}, [[1, 2], "x"], b"\xff\xfe", -(2**60)]
                parts[-1][field] = wrong[int(self._rng.integers(len(wrong)))]
                payload = msgpack.packb(parts)
            case Malformation.LONG:
                said = replace(said, writer=self._uav(), body=self._claim())
                key, parts = said.key, msgpack.unpackb(encode(said))
                parts[-1]["padding"] = bytes(SMALL_LIMIT_BYTES)
                payload = msgpack.packb(parts)
            case Malformation.HUGE:
                payload = honest + bytes(LARGE_LIMIT_BYTES)
            case Malformation.VERSION:
                payload = msgpack.packb([SCHEMA_VERSION + 98, *parts[1:]])
            case Malformation.MISSION:
                payload = encode(replace(said, mission=f"{self._mission[:50]}-2"))
            case Malformation.UNKNOWN:
                payload = msgpack.packb([*parts[:5], "order", parts[6]])
            case Malformation.KEY:
                key, payload = self._keys.claim("nobody"), honest
            case Malformation.NAN:
                said = replace(said, writer=self._uav(), body=self._claim())
                parts = msgpack.unpackb(encode(said))
                parts[-1]["completion_s"] = float(self._rng.choice([math.nan, math.inf, -math.inf]))
                key, payload = said.key, msgpack.packb(parts)
            case _:
                raise ValueError(f"{kind} needs something to be old")
        return Forgery(kind, key, payload)

    def _old(self, now_s: float) -> Forgery | None:
        """An earlier statement of a register that everybody has a newer one of."""
        settled = [m for heard_s, m in self._heard.values() if now_s - heard_s >= SETTLED_S]
        if not settled:
            return None
        newest = settled[int(self._rng.integers(len(settled)))]
        stamp = Stamp(newest.stamp.incarnation - 1, newest.stamp.counter)
        if isinstance(newest.body, Claim):
            newest = replace(newest, body=self._claim())
        return Forgery(Malformation.OLD, newest.key, encode(replace(newest, stamp=stamp)))

    # -- pieces -----------------------------------------------------------------------------

    def _message(self) -> Message:
        """A statement that would be taken, and do harm, if nothing were wrong with it."""
        stamp = Stamp(NEWEST, next(self._counter))
        task = self._task()
        place = (0.0, 0.0, 0.0)
        choice = int(self._rng.integers(4))
        if choice == 0:
            return Message(self._mission, self._uav(), stamp, self._claim())
        if choice == 1:
            outcome = Outcome(task, AttemptResult.DONE, 1, 0.1)
            return Message(self._mission, self._uav(), stamp, outcome)
        if choice == 2:
            entry = TaskEntry(task, 0, place, 0.0, 0.0, None, True)
            return Message(self._mission, COORDINATOR, stamp, entry)
        epoch = PlanEpoch(9999, MissionPhase.ENDED, "greedy", tuple(self._uavs), 0.0, "go home", {})
        return Message(self._mission, COORDINATOR, stamp, epoch)

    def _claim(self) -> Claim:
        return Claim(ClaimPhase.HELD, self._task(), 0.0, 0, 0.1)

    def _uav(self) -> str:
        return self._uavs[int(self._rng.integers(len(self._uavs)))]

    def _task(self) -> str:
        return self._tasks[int(self._rng.integers(len(self._tasks)))]
