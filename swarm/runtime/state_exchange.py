"""How one process asks the others what they know, and answers when they ask.

A question goes out with a digest of what is known here, and the answer leaves that out. Where
the bus has keys both are signed, and an answer counts for its question alone.
"""

from __future__ import annotations

import asyncio
import secrets
from collections.abc import Callable, Collection, Iterable, Mapping, Sequence
from dataclasses import replace
from typing import Final

from swarm.bus.admission import QuestionFilter
from swarm.bus.port import Answer, Bus
from swarm.model.ids import COORDINATOR
from swarm.protocol.codec import Codec
from swarm.protocol.key_space import KeySpace
from swarm.protocol.messages import Message, Snapshot
from swarm.protocol.seal import UnacceptableError
from swarm.protocol.sync import (
    NONCE_BYTES,
    bond,
    decode_question,
    digest_of,
    encode_question,
    unknown,
)
from swarm.runtime.clock import Clock
from swarm.runtime.log import get_logger

TURN: Final = 20
"""Registers of an answer between two looks at everything else."""
MOST_REFUSED: Final = 500
"""Registers of one answer that may be worth nothing; what follows then is not looked at. An honest
process repeats only what it believes itself, by a roster that is seldom another."""
UNREAD: Final = "not read, after so many bad ones"
"""Reason under which is counted what an answer holds besides."""


def draw_nonce() -> bytes:
    """A nonce that nobody can guess."""
    return secrets.token_bytes(NONCE_BYTES)


class StateExchange:
    """Asks and answers for one process; arguments are those of `swarm.runtime.shell.Shell`.

    ``codec`` counts what is worth nothing. ``crowd`` tells, of those who are there, whom a question
    to everyone is for; nobody: for everyone. With it the first such question goes to the
    coordinator and the own name before, since it is known with their answer who is there.
    """

    def __init__(
        self,
        bus: Bus,
        clock: Clock,
        codec: Codec,
        *,
        mission: str,
        name: str,
        snapshot: Callable[[float], Snapshot] | None,
        whole: Callable[[float], Snapshot] | None,
        known: Callable[[], Mapping[str, int]],
        answer_s: float,
        draw_nonce: Callable[[], bytes] = draw_nonce,
        crowd: Callable[[Collection[str]], Sequence[str]] | None = None,
    ) -> None:
        self._bus = bus
        self._seal = bus.seal
        self._clock = clock
        self._codec = codec
        self._keys = KeySpace(mission)
        self._name = name
        self._snapshot = snapshot
        self._whole = whole or snapshot
        self._known = known
        self._answer_s = answer_s
        self._draw_nonce = draw_nonce
        self._crowd = crowd
        self._knows_crowd = False
        self.there: set[str] = set()
        """Who shows a token."""
        self._asked = QuestionFilter(clock.now_s)
        self._log = get_logger(name, mission=mission)
        self._loop = asyncio.get_running_loop()

    def answer(self, reply: Callable[[bytes], None], payload: bytes) -> None:
        """Answer the question ``payload``, if it is one that has an answer here."""
        if self._snapshot is None or self._whole is None:
            return
        try:
            question = decode_question(payload, self._seal)
        except UnacceptableError as fault:
            self._codec.dropped[fault.reason] += 1
            return
        reason = self._asked.fault(question)
        if reason is not None:
            self._codec.dropped[reason] += 1
            return
        told = (self._whole if question.whole else self._snapshot)(self._clock.now_s())
        news = replace(told, messages=unknown(told.messages, self._known(), question.known))
        answer, left_out = self._codec.pack_answer(news, question.bond)
        if left_out:
            self._log.warning("an answer has no room for all registers", left_out=left_out)
        reply(answer)

    async def ask(
        self, heed: Callable[[Iterable[Message]], None], of: Sequence[str] = ()
    ) -> tuple[Snapshot, ...]:
        """What the others know besides, or those ``of`` whom it is asked; their mission times
        brought to now.

        ``heed`` is told each answer's rosters first: by the newest of them all else is believed.
        """
        learned: tuple[Snapshot, ...] = ()
        if not of and self._crowd is not None:
            if not self._knows_crowd:
                self._knows_crowd = True
                learned = await self._ask(heed, (self._name, COORDINATOR), ())
            of = self._crowd(self.there)
        asked_s = self._clock.now_s()
        answers = await self._ask(heed, of, learned)
        age_s = self._clock.now_s() - asked_s
        return *(_aged(told, age_s) for told in learned), *answers

    async def _ask(
        self,
        heed: Callable[[Iterable[Message]], None],
        of: Sequence[str],
        learned: Sequence[Snapshot],
    ) -> tuple[Snapshot, ...]:
        """Whatever else than what has been ``learned`` those, or all, tell."""
        asked_s, asked_wall_s = self._clock.now_s(), self._loop.time()
        known = {**self._known(), **digest_of(each.messages for each in learned)}
        if self._name != COORDINATOR:
            # What is said in the own name is told: by a twin, by who remembers an earlier life,
            # and by all whom it has reached. Of the coordinator that is the whole board: told is
            # what differs from that, as others of its name do.
            known.pop(self._name, None)
        nonce = self._draw_nonce()
        question = encode_question(known, nonce, self._seal, whole=bool(of))
        expected = bond(None if self._seal is None else self._seal.name, nonce)
        answers = await self._answers_of(of or ("*",), question)
        opened = []
        for answer in answers:
            parts = self._codec.open_answer(answer.key, answer.payload, expected)
            if parts is not None:
                snapshot, whole = parts
                rosters, registers = self._rosters_in(whole)
                heed(rosters)
                opened.append((rosters, registers, snapshot, answer.arrived_s))
        roster = None if self._seal is None else self._seal.roster
        read = []
        for rosters, registers, snapshot, arrived_s in opened:
            messages = (*rosters, *await self._read(registers))
            read.append((replace(snapshot, messages=messages), arrived_s))
        if self._seal is not None and self._seal.roster is not roster:  # it came meanwhile
            read = [(self._codec.by_present_keys(told), at_s) for told, at_s in read]
        now_s, wall_s = self._clock.now_s(), self._loop.time()
        pace = (now_s - asked_s) / max(wall_s - asked_wall_s, 1e-9)
        return tuple(_aged(told, pace * (wall_s - at_s)) for told, at_s in read)

    async def _answers_of(self, writers: Iterable[str], question: bytes) -> list[Answer]:
        """All answers to ``question``, in order of arrival."""
        asked = (
            self._bus.query(self._keys.state(writer), question, timeout_s=self._answer_s)
            for writer in writers
        )
        answers = [answer for each in await asyncio.gather(*asked) for answer in each]
        return sorted(answers, key=lambda answer: answer.arrived_s)

    def _rosters_in(self, registers: Sequence[object]) -> tuple[list[Message], Sequence[object]]:
        """Rosters, which alone need no envelope where there are keys, and all that is left."""
        if self._seal is None:
            return [], registers
        bare = [each for each in registers if not isinstance(each, bytes)]
        rosters = [message for message in map(self._codec.decode_register, bare) if message]
        return rosters, [each for each in registers if isinstance(each, bytes)]

    async def _read(self, registers: Sequence[object]) -> list[Message]:
        """Those that are to be believed."""
        messages = list[Message]()
        for number, register in enumerate(registers, 1):
            message = self._codec.decode_register(register)
            if message is not None:
                messages.append(message)
            elif number - len(messages) > MOST_REFUSED:
                self._codec.dropped[UNREAD] += len(registers) - number
                break
            if number % TURN == 0:
                await asyncio.sleep(0)
        return messages


def _aged(snapshot: Snapshot, age_s: float) -> Snapshot:
    """``snapshot`` with the mission time to which its own has grown meanwhile."""
    if snapshot.mission_s is None:
        return snapshot
    return replace(snapshot, mission_s=snapshot.mission_s + age_s)
