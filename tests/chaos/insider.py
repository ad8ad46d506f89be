"""What a hostile insider says: well-formed lies of one who has valid keys of its own.

It speaks for others under its own signature, under their names, or with none, replays what it
has recorded, and puts all of that into its own answers. None of it may change what anybody
believes. Leaves out: malformed messages (sim.fleet.faults.forgery), and lies about itself: what an
insider says of its own UAV is believed.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from enum import StrEnum
from itertools import count

import msgpack
import numpy as np

from swarm.model.ids import AUTHORITY, COORDINATOR, OPERATOR
from swarm.protocol.encoding import encode
from swarm.protocol.fields import MAX_COUNT
from swarm.protocol.key_space import KeySpace
from swarm.protocol.messages import (
    Body,
    CommandKind,
    Message,
    MissionPhase,
    OperatorCommand,
    PlanEpoch,
    SignedRoster,
    Stamp,
    TaskEdit,
    TaskEntry,
)
from swarm.protocol.seal import ANSWER, Seal, open_envelope
from swarm.protocol.uav_messages import (
    AttemptResult,
    Claim,
    ClaimPhase,
    Outcome,
    Status,
    StatusPhase,
)

NEWEST = MAX_COUNT // 2
"""An incarnation that would beat every honest one, were the message believed."""
REMEMBERED = 200
"""Envelopes kept to be replayed."""
REGISTERS_IN_AN_ANSWER = 12


class Trick(StrEnum):
    """How a lie wants to be believed."""

    OWN_HAND = "in another's name, under the own signature"
    ANOTHERS_NAME = "in another's name, with a signature that is not that one's"
    UNSIGNED = "in another's name, not signed"
    REPLAYED = "what another has said before"
    MISPLACED = "what another has said, on another's key"
    ROSTER = "a roster that the authority has not signed"


@dataclass(frozen=True, slots=True)
class Lie:
    """One lie, as bytes on a key."""

    trick: Trick
    key: str
    payload: bytes


class Insider:
    """Lies about others, and knows all that is said.

    Args:
        mission: mission name.
        seal: its own.
        others: UAVs of the fleet but its own.
        tasks: of the mission.
        rng: of everything random.
    """

    def __init__(
        self,
        mission: str,
        seal: Seal,
        others: Sequence[str],
        tasks: Sequence[str],
        rng: np.random.Generator,
    ) -> None:
        self._mission = mission
        self._keys = KeySpace(mission)
        self._seal = seal
        self._others = others
        self._tasks = tasks
        self._rng = rng
        self._counter = count(1)
        self._overheard: list[tuple[str, bytes]] = []

    def overhear(self, key: str, envelope: bytes) -> None:
        """Record what somebody says, to replay it later."""
        self._overheard.append((key, envelope))
        if len(self._overheard) > REMEMBERED:
            del self._overheard[int(self._rng.integers(len(self._overheard)))]

    def lie(self) -> Lie:
        """Another lie."""
        tricks = [trick for trick in Trick if self._overheard or trick not in _RECORDED]
        trick = tricks[int(self._rng.integers(len(tricks)))]
        said = self._statement()
        match trick:
            case Trick.OWN_HAND:
                return Lie(trick, said.key, self._seal.wrap(encode(said)))
            case Trick.ANOTHERS_NAME:
                return Lie(trick, said.key, self._forged(said))
            case Trick.UNSIGNED:
                return Lie(trick, said.key, encode(said))
            case Trick.REPLAYED:
                return Lie(trick, *self._recorded())
            case Trick.MISPLACED:
                return Lie(trick, said.key, self._recorded()[1])
            case Trick.ROSTER:
                body = SignedRoster(self._seal.signed_roster.replace('"version":', '"version":9'))
                roster = Message(self._mission, AUTHORITY, Stamp(NEWEST, 0), body)
                return Lie(trick, roster.key, encode(roster))

    def amended(self, answer: bytes, nonce: bytes) -> bytes:
        """Its own honest ``answer``, with lies among the registers; they are others', so it goes
        on telling the truth about itself."""
        opened = open_envelope(answer)
        if opened is None:
            return answer
        parts = msgpack.unpackb(opened.said)
        for _ in range(REGISTERS_IN_AN_ANSWER):
            payload = self.lie().payload
            sealed = open_envelope(payload) is not None
            parts[5].append(payload if sealed else msgpack.unpackb(payload))
        return self._seal.wrap(msgpack.packb(parts), ANSWER + nonce)

    # -- pieces ---------------------------------------------------------------------------

    def _recorded(self) -> tuple[str, bytes]:
        return self._overheard[int(self._rng.integers(len(self._overheard)))]

    def _forged(self, said: Message) -> bytes:
        """``said`` under the name of who should have signed it, with the own signature."""
        signature = self._seal.wrap(encode(said))
        opened = open_envelope(signature)
        own = b"" if opened is None else opened.signature
        payload: bytes = msgpack.packb(["sealed 1", said.writer, own, encode(said)])
        return payload

    def _statement(self) -> Message:
        """One that would do harm if it were believed."""
        uav, task = self._pick(self._others), self._pick(self._tasks)
        place = (0.0, 0.0, 0.0)
        idle = Claim(ClaimPhase.OUT, None, 0.0, 0, 0.0, True)
        harm: list[tuple[str, Body]] = [
            (uav, Claim(ClaimPhase.HELD, task, 0.0, 0, 0.1)),
            (uav, idle),
            (uav, Outcome(task, AttemptResult.DONE, 1, 0.1)),
            (uav, Status(StatusPhase.OUT, None, None, None, 0.0, 0.0, {}, "down")),
            (COORDINATOR, TaskEntry(task, 0, place, 0.0, 0.0, None, True)),
            (
                COORDINATOR,
                PlanEpoch(9999, MissionPhase.ENDED, "greedy", (uav,), 0.0, "go home", {}),
            ),
            (OPERATOR, OperatorCommand(uav, CommandKind.RETURN, 1, "come home")),
            (OPERATOR, OperatorCommand("fleet", CommandKind.ABORT, 1, "enough")),
            (OPERATOR, TaskEdit(task, 0, place, 0.0, 0.0, None, True, 1, "not needed")),
        ]
        writer, body = harm[int(self._rng.integers(len(harm)))]
        return Message(self._mission, writer, Stamp(NEWEST, next(self._counter)), body)

    def _pick(self, names: Sequence[str]) -> str:
        return names[int(self._rng.integers(len(names)))]


_RECORDED = frozenset({Trick.REPLAYED, Trick.MISPLACED})
