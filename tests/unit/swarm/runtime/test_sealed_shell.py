"""Shells on a bus with keys: signed, fresh, and by the newest roster."""

from __future__ import annotations

import asyncio
from collections.abc import AsyncIterator, Awaitable, Callable, Sequence
from contextlib import asynccontextmanager
from dataclasses import dataclass

import msgpack

from swarm.bus.port import Query, Sample
from swarm.model.ids import AUTHORITY, COORDINATOR
from swarm.protocol.codec import Codec
from swarm.protocol.encoding import encode
from swarm.protocol.events import (
    Ask,
    CommonAction,
    CommonEvent,
    Finish,
    KeysReplaced,
    MessageReceived,
    PeerGone,
    PeerSeen,
    Publish,
    SnapshotsReceived,
    Stop,
)
from swarm.protocol.key_space import KeySpace
from swarm.protocol.messages import SCHEMA_VERSION, Message, SignedRoster, Snapshot, Stamp
from swarm.protocol.seal import ANSWER
from swarm.protocol.sync import bond, decode_question, encode_question
from swarm.runtime.joining import join_mission
from swarm.runtime.shell import Shell
from swarm.runtime.state_exchange import MOST_REFUSED, UNREAD
from tests.support.builders import MISSION, epoch, held, message
from tests.support.keyring import Keyring
from tests.support.memory_bus import MemoryBus, MemoryNetwork
from tests.support.shell_play import HandClock, play, until

KEYS = KeySpace(MISSION)
RING = Keyring("u0", "u1", "u2")
CLAIM = message("u1", held("t0", 1.0))
OWN = message("u0", held("t1", 1.0))
NONCE = bytes(range(16))
ROSTER = Message(MISSION, AUTHORITY, Stamp(1, 0), SignedRoster(RING.signed()))


class Ear:
    """Remembers what it heard; does what it is told, and answers by its own claim."""

    def __init__(self) -> None:
        self.heard: list[CommonEvent] = []

    def start(self, now_s: float) -> Sequence[CommonAction]:
        return ()

    def step(self, event: CommonEvent, now_s: float) -> Sequence[CommonAction]:
        self.heard.append(event)
        match event:
            case Stop():
                return [Finish(0)]
            case MessageReceived(said) if said == OWN:
                return [Publish(OWN)]
        return ()

    def next_deadline_s(self) -> float | None:
        return None


@dataclass(slots=True)
class Sealed:
    core: Ear
    shell: Shell[CommonEvent, CommonAction]
    bus: MemoryBus
    other: MemoryBus
    """A seat without a shell."""


@asynccontextmanager
async def sealed(keep: Callable[[bytes], object] = bytes) -> AsyncIterator[Sealed]:
    network, core = MemoryNetwork(), Ear()
    bus = network.join("u0", seal=RING.seal("u0", keep=keep))
    other = network.join("other")
    shell: Shell[CommonEvent, CommonAction] = Shell(
        core,
        bus,
        HandClock(),
        mission=MISSION,
        name="u0",
        from_bus=lambda fact: fact,
        execute=lambda _: None,
        snapshot=lambda _: Snapshot(MISSION, "u0", 1, 7.0, (OWN,)),
        draw_nonce=lambda: NONCE,
    )
    join_mission(bus, MISSION, "u0", status=True)
    running = asyncio.create_task(shell.run())
    try:
        await until(lambda: MessageReceived(ROSTER) in core.heard, "knowing the own roster")
        yield Sealed(core, shell, bus, other)
    finally:
        shell.step(Stop("enough"))
        await running
        bus.close()
        other.close()


def shown(
    scenario: Callable[[Sealed], Awaitable[None]], keep: Callable[[bytes], object] = bytes
) -> None:
    async def whole() -> None:
        async with sealed(keep) as seat:
            await scenario(seat)

    play(whole)


def newer(*revoked: str) -> Message:
    roster = RING.without(*revoked)
    return Message(MISSION, AUTHORITY, Stamp(2, 0), SignedRoster(RING.signed(roster)))


def test_it_says_only_what_is_signed_and_believes_nothing_else() -> None:
    async def scenario(seat: Sealed) -> None:
        seat.other.subscribe(f"{KEYS.root}/**")
        seat.shell.step(MessageReceived(OWN))
        said = [event for event in seat.other.inbox.take() if isinstance(event, Sample)]
        assert [Codec(MISSION, RING.seal("u2")).decode(s.key, s.payload) for s in said] == [OWN]

        seat.other.publish(CLAIM.key, encode(CLAIM))
        seat.other.publish(CLAIM.key, RING.seal("u2").wrap(encode(CLAIM)))
        seat.other.publish(CLAIM.key, RING.seal("u1").wrap(encode(CLAIM)))
        await until(lambda: MessageReceived(CLAIM) in seat.core.heard, "hearing the honest one")

        assert seat.core.heard.count(MessageReceived(CLAIM)) == 1
        assert seat.shell.dropped == {"not signed": 1, "not the signer's to say": 1}

    shown(scenario)


def test_it_answers_whom_it_knows_and_only_to_that_question() -> None:
    async def scenario(seat: Sealed) -> None:
        asked = encode_question({}, NONCE, RING.seal("dashboard"))
        [answer] = await seat.other.query(KEYS.state("*"), asked, timeout_s=1.0)
        codec = Codec(MISSION, RING.seal("u1"))
        expected = bond("dashboard", NONCE)
        heard = codec.decode_snapshot(answer.key, answer.payload, expected)
        assert heard == Snapshot(MISSION, "u0", 1, 7.0, (OWN,))
        for another in (bond("dashboard", bytes(16)), bond("u1", NONCE), NONCE):
            assert codec.decode_snapshot(answer.key, answer.payload, another) is None

        nobody = await seat.other.query(KEYS.state("*"), timeout_s=0.01)
        assert nobody == ()

    shown(scenario)


def test_it_takes_an_answer_to_its_own_question_and_no_older_one() -> None:
    async def scenario(seat: Sealed) -> None:
        liar = RING.seal("u1")
        old, _ = Codec(MISSION, liar).pack_answer(
            Snapshot(MISSION, "u1", 1, 99.0, (CLAIM,)), bytes(16)
        )
        for name in ("u1", "u2"):
            seat.other.serve(KEYS.state(name))
        seat.shell._carry_out(Ask())
        questions: list[Query] = []
        while len(questions) < 2:
            await seat.other.inbox.wait()
            questions += [e for e in seat.other.inbox.take() if isinstance(e, Query)]
        question = decode_question(questions[0].payload, RING.seal("u2"))
        assert (question.asker, question.nonce) == ("u0", NONCE)
        fresh, _ = Codec(MISSION, RING.seal("u2")).pack_answer(
            Snapshot(MISSION, "u2", 1, 7.0, ()), question.bond
        )
        for event in questions:
            event.reply(old if event.key == KEYS.state("u1") else fresh)
        await until(
            lambda: any(isinstance(f, SnapshotsReceived) for f in seat.core.heard), "the answers"
        )

        [learned] = [fact for fact in seat.core.heard if isinstance(fact, SnapshotsReceived)]
        assert [snapshot.writer for snapshot in learned.snapshots] == ["u2"]
        assert seat.shell.dropped == {"wrongly signed": 1}

    shown(scenario)


def test_of_an_answer_full_of_forged_registers_most_are_not_even_looked_at() -> None:
    """Each would cost a check of its signature."""
    forged, more = RING.seal("u1").wrap(encode(OWN)), 700

    async def scenario(seat: Sealed) -> None:
        seat.other.serve(KEYS.state("u1"))
        seat.shell._carry_out(Ask())
        questions: list[Query] = []
        while not questions:
            await seat.other.inbox.wait()
            questions += [e for e in seat.other.inbox.take() if isinstance(e, Query)]
        [query] = questions
        question = decode_question(query.payload, RING.seal("u1"))
        registers = [RING.seal("u1").wrap(encode(CLAIM))] + [forged] * (MOST_REFUSED + more)
        registers.append(msgpack.unpackb(encode(newer("u2"))))
        said = msgpack.packb([SCHEMA_VERSION, MISSION, "u1", 1, 7.0, registers])
        query.reply(RING.seal("u1").wrap(said, ANSWER + question.bond))
        await until(
            lambda: any(isinstance(f, SnapshotsReceived) for f in seat.core.heard), "the answer"
        )

        [learned] = [fact for fact in seat.core.heard if isinstance(fact, SnapshotsReceived)]
        assert learned.snapshots == (Snapshot(MISSION, "u1", 1, 7.0, (newer("u2"), CLAIM)),)
        assert seat.shell.dropped == {
            "not the signer's to say": MOST_REFUSED + 1,
            UNREAD: more - 1,
        }

    shown(scenario)


def test_an_answer_is_believed_by_the_roster_that_it_brings_itself() -> None:
    roster = newer("u1")

    async def scenario(seat: Sealed) -> None:
        seat.other.serve(KEYS.state("u2"))
        seat.shell._carry_out(Ask())
        questions: list[Query] = []
        while not questions:
            await seat.other.inbox.wait()
            questions += [e for e in seat.other.inbox.take() if isinstance(e, Query)]
        [query] = questions
        question = decode_question(query.payload, RING.seal("u2"))
        by_old_keys = RING.seal("u1").wrap(encode(CLAIM))
        registers = [by_old_keys, msgpack.unpackb(encode(roster))]
        said = msgpack.packb([SCHEMA_VERSION, MISSION, "u2", 1, 7.0, registers])
        query.reply(RING.seal("u2").wrap(said, ANSWER + question.bond))
        await until(
            lambda: any(isinstance(f, SnapshotsReceived) for f in seat.core.heard), "the answer"
        )

        [learned] = [fact for fact in seat.core.heard if isinstance(fact, SnapshotsReceived)]
        assert learned.snapshots[0].messages == (roster,)
        assert seat.shell.dropped == {"signer unknown": 1}
        assert seat.core.heard.index(KeysReplaced(frozenset({"u1"}))) < (
            seat.core.heard.index(learned)
        )

    shown(scenario)


def test_whoever_a_newer_roster_leaves_out_is_gone_and_silent_from_then_on() -> None:
    async def scenario(seat: Sealed) -> None:
        seat.other.declare_token(KEYS.alive("u1"))
        await until(lambda: PeerSeen("u1") in seat.core.heard, "seeing it")
        said = newer("u1")

        seat.other.publish(said.key, encode(said))
        await until(lambda: PeerGone("u1") in seat.core.heard, "giving it up")
        seat.other.publish(CLAIM.key, RING.seal("u1").wrap(encode(CLAIM)))
        seat.other.publish(said.key, encode(ROSTER))
        by_coordinator = message(COORDINATOR, epoch("u0"))
        honest = RING.seal(COORDINATOR).wrap(encode(by_coordinator))
        seat.other.publish(by_coordinator.key, honest)
        await until(
            lambda: MessageReceived(by_coordinator) in seat.core.heard, "hearing the others"
        )

        assert MessageReceived(said) in seat.core.heard, "the replica hands it on"
        assert KeysReplaced(frozenset({"u1"})) in seat.core.heard
        assert MessageReceived(CLAIM) not in seat.core.heard
        assert seat.shell.dropped == {"signer unknown": 1}
        assert seat.bus.seal is not None
        assert seat.bus.seal.roster.version == 2, "an older one changes nothing"

    shown(scenario)


def test_a_forged_token_of_nobody_is_not_even_told() -> None:
    async def scenario(seat: Sealed) -> None:
        for name in ("ghost", "dashboard", "u2"):
            seat.other.declare_token(KEYS.alive(name))
        await until(lambda: PeerSeen("u2") in seat.core.heard, "seeing who may be there")

        seen = [fact for fact in seat.core.heard if isinstance(fact, PeerSeen)]
        assert seen == [PeerSeen("u2")]
        assert seat.shell.dropped == {"signer unknown": 2}

    shown(scenario)


def test_a_newer_roster_is_kept_for_the_next_life_and_a_full_disk_does_no_harm() -> None:
    said, kept = newer("u2"), list[bytes]()

    async def scenario(seat: Sealed) -> None:
        seat.other.publish(said.key, encode(said))
        await until(lambda: PeerGone("u2") in seat.core.heard, "its effect")

    def full(_: bytes) -> None:
        raise OSError(28, "No space left on device")

    shown(scenario, kept.append)
    shown(scenario, full)
    assert isinstance(said.body, SignedRoster)
    assert kept == [said.body.signed.encode()]


def test_an_answer_full_of_old_rosters_is_worth_one_word_of_the_new_one() -> None:
    async def whole() -> None:
        network = MemoryNetwork()
        bus = network.join("operator", seal=RING.seal("operator", RING.without("u2")))
        other = network.join("other")
        other.subscribe(KEYS.roster)
        shell: Shell[CommonEvent, CommonAction] = Shell(
            Ear(),
            bus,
            HandClock(),
            mission=MISSION,
            name="operator",
            from_bus=lambda fact: fact,
            execute=lambda _: None,
            snapshot=None,
        )
        try:
            shell._heed([ROSTER] * 50, answers=True)
            said = [event for event in other.inbox.take() if isinstance(event, Sample)]
            assert len(said) == 1
        finally:
            bus.close()
            other.close()

    play(whole)
