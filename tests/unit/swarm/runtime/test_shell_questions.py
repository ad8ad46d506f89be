"""The shell asks and answers for its core, and keeps its memory."""

from __future__ import annotations

import asyncio
from collections.abc import Collection
from dataclasses import replace

import pytest

from swarm.bus.port import Query
from swarm.model.ids import COORDINATOR
from swarm.protocol.codec import Codec
from swarm.protocol.encoding import encode
from swarm.protocol.events import Ask, Save, SnapshotsReceived
from swarm.protocol.messages import MissionPhase, PlanEpoch, Snapshot
from swarm.protocol.sync import decode_digest, encode_digest, fingerprint
from tests.support.builders import MISSION, epoch, message
from tests.support.memory_bus import MemoryBus
from tests.support.scripted_shell import CLAIM, KEYS, SNAPSHOT, ScriptedCore, at_work
from tests.support.shell_play import play, until


def test_queries_are_answered_with_the_cores_snapshot() -> None:
    async def scenario() -> None:
        async with at_work(ScriptedCore()) as played:
            (answer,) = await played.other.query(KEYS.state("*"), timeout_s=5.0)

            assert Codec(MISSION).decode_snapshot(answer.key, answer.payload) == SNAPSHOT

    play(scenario)


def test_an_answer_leaves_out_what_the_asker_knows() -> None:
    async def scenario() -> None:
        async with at_work(ScriptedCore(), known={"u0": 7}) as played:
            known = encode_digest({"u0": 7})
            (answer,) = await played.other.query(KEYS.state("*"), known, timeout_s=5.0)

            shortened = Codec(MISSION).decode_snapshot(answer.key, answer.payload)
            assert shortened == replace(SNAPSHOT, messages=())

    play(scenario)


def test_a_question_with_a_malformed_digest_is_counted_and_not_answered() -> None:
    async def scenario() -> None:
        async with at_work(ScriptedCore()) as played:
            asked = played.other.query(KEYS.state("*"), b"nonsense", timeout_s=0.05)
            assert await asked == ()
            assert played.shell.dropped == {"malformed": 1}

    play(scenario)


def test_a_snapshot_too_large_is_answered_in_part_and_reported(
    capsys: pytest.CaptureFixture[str],
) -> None:
    names = [f"{n:064d}" for n in range(14_000)]
    epochs = [
        message(
            COORDINATOR, PlanEpoch(1, MissionPhase.RUNNING, "greedy", tuple(names), 0.0, "", {})
        )
    ]
    snapshot = Snapshot(MISSION, "u0", 1, 7.0, (*epochs * 6, CLAIM, *SNAPSHOT.messages))

    async def scenario() -> None:
        async with at_work(ScriptedCore(), snapshot=snapshot) as played:
            (answer,) = await played.other.query(KEYS.state("*"), timeout_s=5.0)

            shortened = Codec(MISSION).decode_snapshot(answer.key, answer.payload)
            assert shortened is not None
            assert shortened.messages[0] == SNAPSHOT.messages[0]
            assert 2 <= len(shortened.messages) < len(snapshot.messages)

    play(scenario)
    assert "no room for all registers" in "".join(capsys.readouterr())


def test_a_process_without_a_snapshot_answers_nothing() -> None:
    async def scenario() -> None:
        core = ScriptedCore()
        async with at_work(core, answers=False) as played:
            assert await played.other.query(KEYS.state("*"), timeout_s=0.01) == ()
            assert await played.end() == 0

    play(scenario)


def test_a_question_ends_in_all_good_answers() -> None:
    async def scenario() -> None:
        core = ScriptedCore(first=[Ask()])
        async with at_work(core) as played:
            third = played.network.join("u2")
            third.serve(KEYS.state("u2"))
            good = Snapshot(MISSION, "u1", 1, None, (CLAIM,))

            def answer(bus: MemoryBus, payload: bytes) -> None:
                for event in bus.inbox.take():
                    reply = getattr(event, "reply", None)
                    if reply is not None:
                        reply(payload)

            def answered() -> bool:
                answer(played.other, encode(good))
                answer(third, b"nonsense")
                return any(isinstance(fact, SnapshotsReceived) for fact in core.heard)

            await until(answered, "learning")
            third.close()

            assert SnapshotsReceived((good,)) in core.heard
            assert played.shell.dropped == {"malformed": 1}

    play(scenario)


def test_mission_time_in_an_answer_does_not_age_while_others_are_waited_for() -> None:
    async def scenario() -> None:
        core = ScriptedCore(first=[Ask()])
        async with at_work(core) as played:
            late = played.network.join("u2")
            late.serve(KEYS.state("u2"))
            answers: list[float | None] = []

            def reply(bus: MemoryBus, name: str) -> bool:
                for event in bus.inbox.take():
                    if isinstance(event, Query):
                        event.reply(encode(Snapshot(MISSION, name, 1, 100.0, ())))
                        return True
                return False

            def learned() -> bool:
                for fact in core.heard:
                    if isinstance(fact, SnapshotsReceived):
                        answers.extend(snapshot.mission_s for snapshot in fact.snapshots)
                return bool(answers)

            await until(lambda: reply(played.other, "u1"), "asking u1")
            for _ in range(100):
                await asyncio.sleep(0)
            played.clock.time_s += 4.0
            await until(lambda: reply(late, "u2"), "asking u2")
            await until(learned, "learning")
            late.close()

            early_s, late_s = answers
            assert early_s is not None
            assert late_s is not None
            assert 100.0 <= late_s < early_s <= 104.0

    play(scenario)


@pytest.mark.parametrize(
    ("name", "told"),
    [("u0", {"u1": 2, COORDINATOR: 3}), (COORDINATOR, {"u0": 1, "u1": 2, COORDINATOR: 3})],
)
def test_a_question_tells_what_the_core_knows_but_for_the_own_registers(
    name: str, told: dict[str, int]
) -> None:
    """Who answers in the own name is a twin, or remembers an earlier life: that must be heard.

    The coordinator's are the whole board, and only what differs from that is told.
    """

    async def scenario() -> None:
        core = ScriptedCore(first=[Ask()])
        async with at_work(core, name=name, known={"u0": 1, "u1": 2, COORDINATOR: 3}) as played:
            queries: list[Query] = []

            def asked() -> bool:
                taken = played.other.inbox.take()
                queries.extend(event for event in taken if isinstance(event, Query))
                return bool(queries)

            await until(asked, "being asked")
            assert decode_digest(queries[0].payload) == told

    play(scenario)


@pytest.mark.parametrize("asked", [(), ("u1",)], ids=["everyone", "some"])
def test_who_asks_first_asks_the_coordinator_and_then_whom_the_crowd_is_asked_by(
    asked: tuple[str, ...],
) -> None:
    """Who is there is known with its answer; what it told is not told again."""
    heard = message(COORDINATOR, epoch("u0"))
    seen: list[set[str]] = []

    def crowd(there: Collection[str]) -> tuple[str, ...]:
        seen.append(set(there))
        return asked

    async def scenario() -> None:
        core = ScriptedCore(first=[Ask()])
        async with at_work(core, crowd=crowd) as played:
            coordinator, second = played.network.join(COORDINATOR), played.network.join("u2")
            coordinator.serve(KEYS.state(COORDINATOR))
            second.serve(KEYS.state("u2"))
            questions: list[tuple[str, Query]] = []
            began_s = played.clock.time_s

            def take() -> None:
                for bus in (coordinator, played.other, second):
                    taken = [event for event in bus.inbox.take() if isinstance(event, Query)]
                    questions.extend((event.key, event) for event in taken)

            def learned() -> bool:
                take()
                for key, query in questions:
                    first = key == KEYS.state(COORDINATOR) and query is questions[0][1]
                    told, mission_s = ((heard,), 100.0) if first else ((), None)
                    writer = key.rpartition("/")[2]
                    query.reply(encode(Snapshot(MISSION, writer, 1, mission_s, told)))
                if len(questions) > 1:
                    played.clock.time_s = 4.0 + began_s
                return any(isinstance(fact, SnapshotsReceived) for fact in core.heard)

            await until(learned, "learning")
            coordinator.close()
            second.close()

            first, *then = questions
            assert first[0] == KEYS.state(COORDINATOR)
            others = {KEYS.state("u1")} if asked else {KEYS.state(w) for w in ("u1", "u2")}
            assert {key for key, _ in then} - {KEYS.state(COORDINATOR)} == others
            for _, query in then:
                digest = decode_digest(query.payload)
                assert digest is not None
                assert digest[COORDINATOR] == fingerprint(heard)
            assert seen == [{"u1"}]
            learned_from = [f for f in core.heard if isinstance(f, SnapshotsReceived)]
            told_first = next(each for each in learned_from[0].snapshots if each.messages)
            assert (told_first.messages, told_first.mission_s) == ((heard,), 104.0)

    play(scenario)


def test_memory_is_kept_when_the_core_wishes_it() -> None:
    async def scenario() -> None:
        kept: list[float] = []
        core = ScriptedCore(first=[Save()])
        async with at_work(core, save=kept.append) as played:
            await until(lambda: kept == [0.0], "saving")
            assert await played.end() == 0

    play(scenario)


def test_a_process_that_keeps_nothing_goes_on_when_told_to() -> None:
    async def scenario() -> None:
        async with at_work(ScriptedCore(first=[Save()])) as played:
            assert await played.end() == 0

    play(scenario)


def test_a_question_that_nobody_hears_ends_in_no_answers() -> None:
    async def scenario() -> None:
        core = ScriptedCore(first=[Ask()])
        async with at_work(core) as played:
            played.network.cut("u0")
            await until(lambda: SnapshotsReceived(()) in core.heard, "learning nothing")

    play(scenario)


def test_a_question_under_way_does_not_outlive_the_run() -> None:
    async def scenario() -> None:
        async with at_work(ScriptedCore(first=[Ask(), Ask()])) as played:
            await until(lambda: len(asyncio.all_tasks()) == 5, "asking")
            assert await played.end() == 0
            assert len(asyncio.all_tasks()) == 1

    play(scenario)
