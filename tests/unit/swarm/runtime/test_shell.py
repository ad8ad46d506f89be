"""The shell carries facts to its core and wishes out of it, in order, and ends in order."""

from __future__ import annotations

import asyncio
from collections.abc import Sequence

import pytest

from swarm.bus.admission import MOST_STRANGERS, TOO_MANY_NAMES
from swarm.bus.port import Query, Sample, TokenGone, TokenSeen
from swarm.model.ids import COORDINATOR
from swarm.protocol.encoding import encode
from swarm.protocol.events import (
    Ask,
    CommonAction,
    CommonEvent,
    Finish,
    LinkChanged,
    LogLine,
    MessageReceived,
    PeerGone,
    PeerSeen,
    Publish,
    PublishLast,
    SnapshotsReceived,
    Tick,
)
from swarm.protocol.messages import Message, Snapshot
from swarm.protocol.registers import Replica
from swarm.runtime.errors import BusError
from swarm.runtime.joining import join_mission
from swarm.runtime.shell import Shell
from tests.support.builders import (
    MISSION,
    brief,
    choice,
    done,
    entry,
    epoch,
    held,
    message,
    status,
    uav,
)
from tests.support.memory_bus import MemoryBus, MemoryNetwork
from tests.support.scripted_shell import (
    CLAIM,
    END,
    KEYS,
    SNAPSHOT,
    Action,
    Own,
    ScriptedCore,
    as_event,
    at_work,
)
from tests.support.shell_play import HandClock, play, take_until, until

REGISTERS = [
    message(COORDINATOR, brief(uav("u0"), uav("u1"))),
    message(COORDINATOR, epoch("u0", "u1")),
    message(COORDINATOR, entry("t0")),
    message("u1", held("t0", 1.0)),
    message("u1", done("t0")),
]
IDS = [type(said.body).__name__ for said in REGISTERS]


@pytest.mark.parametrize("said", REGISTERS, ids=IDS)
def test_every_register_that_is_said_is_heard(said: Message) -> None:
    async def scenario() -> None:
        core = ScriptedCore()
        async with at_work(core) as played:
            played.other.publish(said.key, encode(said))
            await until(lambda: MessageReceived(said) in core.heard, "hearing it")
            assert played.shell.dropped == {}

    play(scenario)


def test_what_is_said_last_is_put_together_after_all_else_and_heard_by_onlookers() -> None:
    said = message("u0", choice("t0"))

    async def scenario() -> None:
        made: list[list[str]] = []

        def make() -> Message:
            made.append(list(played.own))
            return said

        core = ScriptedCore(
            lambda fact: [Own("first"), PublishLast(make)] if fact == Tick() else ()
        )
        async with at_work(core) as played:
            played.shell.step(Tick())
            heard = Sample(said.key, encode(said))
            await take_until(played.other, lambda events: heard in events)

            assert made == [["first"]]

    play(scenario)


def test_what_is_said_to_some_goes_to_each_of_them_alone() -> None:
    said = message("u0", held("t0", 1.0))

    async def scenario() -> None:
        core = ScriptedCore(lambda fact: [Publish(said, ("u1", "u2"))] if fact == Tick() else ())
        async with at_work(core) as played:
            for key in (KEYS.claim("*"), KEYS.claim_to("*", "u1"), KEYS.claim_to("*", "u2")):
                played.other.subscribe(key)
            played.shell.step(Tick())
            last = Sample(KEYS.claim_to("u0", "u2"), encode(said))
            heard: list[object] = []

            def come(events: Sequence[object]) -> bool:
                heard[:] = [event for event in events if isinstance(event, Sample)]
                return last in events

            await take_until(played.other, come)
            assert heard == [Sample(KEYS.claim_to("u0", "u1"), encode(said)), last]

    play(scenario)


def test_what_is_said_to_nobody_is_not_said() -> None:
    said = message("u0", held("t0", 1.0))

    async def scenario() -> None:
        core = ScriptedCore(
            lambda fact: (
                [Publish(said, ()), Publish(message("u0", done("t0")))] if fact == Tick() else ()
            )
        )
        async with at_work(core) as played:
            played.other.subscribe(f"{KEYS.root}/**")
            played.shell.step(Tick())
            first: list[str] = []

            def come(events: Sequence[object]) -> bool:
                first[:] = [event.key for event in events if isinstance(event, Sample)]
                return bool(first)

            await take_until(played.other, come)
            assert set(first) == {KEYS.outcome("u0", "t0")}

    play(scenario)


def test_a_claim_said_to_this_process_alone_is_heard_as_any_other() -> None:
    said = message("u1", held("t0", 1.0))

    async def scenario() -> None:
        core = ScriptedCore()
        async with at_work(core) as played:
            played.seat.subscribe(KEYS.claim_to("*", "u0"))
            played.other.publish(KEYS.claim_to("u2", "u0"), encode(said))
            played.other.publish(KEYS.claim_to("u1", "u0"), encode(said))
            await until(lambda: MessageReceived(said) in core.heard, "hearing it")
            assert played.shell.dropped == {"said on another's key": 1}

    play(scenario)


def test_what_the_core_has_no_room_for_is_counted_and_told_once(
    capsys: pytest.CaptureFixture[str],
) -> None:
    async def scenario() -> None:
        left_out = [0]
        core = ScriptedCore()
        async with at_work(core, left_out=lambda: left_out[0]) as played:
            assert played.shell.dropped == {}
            for count in (3, 7):
                left_out[0] = count
                assert played.shell.dropped == {"no room": count}
            left_out[0] = 2  # another core has taken over
            assert played.shell.dropped == {"no room": 7}
        assert capsys.readouterr().err.count("room") == 1

    play(scenario)


@pytest.mark.parametrize("how", ["said", "answered"])
def test_whom_the_brief_names_is_heard_however_many_names_others_make_up(how: str) -> None:
    said = message(COORDINATOR, brief(uav("u0"), uav("u9")))

    def reply(bus: MemoryBus) -> bool:
        queries = [event for event in bus.inbox.take() if isinstance(event, Query)]
        for query in queries:
            query.reply(encode(Snapshot(MISSION, "u1", 1, None, (said,))))
        return bool(queries)

    async def scenario() -> None:
        core = ScriptedCore(first=[Ask()] if how == "answered" else ())
        async with at_work(core, capacity=2 * MOST_STRANGERS) as played:
            if how == "said":
                played.other.publish(said.key, encode(said))
                await until(lambda: MessageReceived(said) in core.heard, "hearing of the fleet")
            else:
                await until(lambda: reply(played.other), "being asked")
                await until(
                    lambda: isinstance(core.heard[-1], SnapshotsReceived), "learning of the fleet"
                )
            for number in range(MOST_STRANGERS + 50):
                played.other.publish(KEYS.claim(f"ghost{number}"), b"")
            late, member = message("u8", held("t0", 1.0)), message("u9", held("t0", 1.0))
            played.other.publish(late.key, encode(late))
            played.other.publish(member.key, encode(member))

            await until(lambda: MessageReceived(member) in core.heard, "hearing one of the fleet")
            assert MessageReceived(late) not in core.heard
            assert played.shell.dropped[TOO_MANY_NAMES] == 51

    play(scenario)


def test_what_is_malformed_is_counted_and_the_rest_heard() -> None:
    async def scenario() -> None:
        core = ScriptedCore()
        async with at_work(core) as played:
            bad = [b"", b"\xc1", encode(CLAIM)[:-1], encode(SNAPSHOT), b"\x91" * 100_000]
            for data in bad:
                played.other.publish(KEYS.claim("u1"), data)
            played.other.publish(KEYS.claim("u2"), encode(CLAIM))
            played.other.publish(CLAIM.key, encode(CLAIM))
            await until(lambda: MessageReceived(CLAIM) in core.heard, "hearing the good one")

            assert [fact for fact in core.heard if isinstance(fact, MessageReceived)] == [
                MessageReceived(CLAIM)
            ]
            assert played.shell.dropped == {
                "malformed": len(bad),
                "said on another's key": 1,
            }

    play(scenario)


def test_what_the_inbox_had_no_room_for_is_counted_too() -> None:
    async def scenario() -> None:
        core = ScriptedCore()
        async with at_work(core, capacity=4) as played:
            for counter in range(20):
                said = message("u1", held("t0", 1.0), counter=counter)
                played.other.publish(said.key, encode(said))
            newest = MessageReceived(said)
            await until(lambda: newest in core.heard, "hearing the newest")

            heard = [fact for fact in core.heard if isinstance(fact, MessageReceived)]
            assert len(heard) + played.shell.dropped["too many"] == 20

    play(scenario)


def test_peers_and_the_own_link_are_told() -> None:
    async def scenario() -> None:
        core = ScriptedCore()
        async with at_work(core) as played:
            played.network.cut("u0")
            played.network.heal("u0")
            wanted = [
                LinkChanged(True),
                PeerSeen("u1"),
                LinkChanged(False),
                PeerGone("u1"),
                LinkChanged(True),
                PeerSeen("u1"),
            ]
            await until(lambda: len(core.heard) >= len(wanted), "all of it")
            assert core.heard == wanted

    play(scenario)


@pytest.mark.parametrize("key", ["swarm/other/alive/u9", f"swarm/{MISSION}/alive/", "x"])
def test_tokens_that_are_no_writers_of_the_mission_are_nobody(key: str) -> None:
    async def scenario() -> None:
        core = ScriptedCore()
        network = MemoryNetwork()
        seat = network.join("u0")
        shell: Shell[CommonEvent, Action] = Shell(
            core,
            seat,
            HandClock(),
            mission=MISSION,
            name="u0",
            from_bus=as_event,
            execute=lambda _: None,
            snapshot=None,
        )
        running = asyncio.create_task(shell.run())
        seat.inbox.offer(TokenSeen(key))
        seat.inbox.offer(TokenGone(key))
        seat.inbox.offer(TokenSeen(KEYS.alive("u2")))
        await until(lambda: PeerSeen("u2") in core.heard, "seeing u2")
        shell.step(END)
        await running

        assert core.heard == [LinkChanged(True), PeerSeen("u2"), END]

    play(scenario)


def test_messages_go_out_on_their_keys() -> None:
    own = [message("u0", held("t0", 1.0)), message("u0", done("t0")), message("u0", status())]

    async def scenario() -> None:
        async with at_work(ScriptedCore(first=[Publish(said) for said in own])) as played:
            samples = {Sample(said.key, encode(said)) for said in own}
            await take_until(
                played.other, lambda seen: samples <= {e for e in seen if isinstance(e, Sample)}
            )

    play(scenario)


def test_a_core_ticks_when_its_deadline_has_come_and_not_before() -> None:
    async def scenario() -> None:
        core = ScriptedCore()
        async with at_work(core) as played:
            core.deadline_s = 5.0
            played.shell.step(PeerSeen("u9"))
            await asyncio.sleep(0)
            assert Tick() not in core.heard

            played.clock.time_s = 5.0
            played.shell.step(PeerGone("u9"))
            await until(lambda: Tick() in core.heard, "the tick")
            assert core.instants_s[core.heard.index(Tick())] == 5.0
            assert core.heard.count(Tick()) == 1

    play(scenario)


def test_what_is_only_repeated_reaches_the_core_as_what_it_knows() -> None:
    async def scenario() -> None:
        replica = Replica()

        def join(event: CommonEvent) -> list[Action]:
            if isinstance(event, MessageReceived):
                replica.join(event.message)
            return []

        core = ScriptedCore(join)
        async with at_work(core, register=replica.register) as played:
            later = message("u1", held("t1", 2.0), 2)
            for said in (CLAIM, CLAIM, later, later):
                played.other.publish(said.key, encode(said))
            await until(lambda: len(heard(core)) == 4, "the words")
            first, again, new, new_again = heard(core)
            assert again is first
            assert new is not first
            assert new_again is new
            assert (first, new) == (CLAIM, later)

    play(scenario)


def heard(core: ScriptedCore) -> list[Message]:
    return [event.message for event in core.heard if isinstance(event, MessageReceived)]


@pytest.mark.parametrize("exit_status", [0, 1])
def test_the_run_ends_with_the_status_the_core_finished_with(exit_status: int) -> None:
    async def scenario() -> int:
        async with at_work(ScriptedCore(first=[Finish(exit_status)])) as played:
            return await played.running

    assert play(scenario) == exit_status


def test_what_was_wanted_beside_the_finish_is_still_done_and_nothing_after_it() -> None:
    async def scenario() -> None:
        core = ScriptedCore(first=[Own("before"), Finish(3), Own("beside"), Finish(4)])
        async with at_work(core) as played:
            assert await played.running == 3
            played.shell.step(PeerSeen("u9"))
            played.shell.fail(RuntimeError("too late"))

            assert played.own == ["before", "beside"]
            assert PeerSeen("u9") not in core.heard

    play(scenario)


def test_cancelling_the_run_ends_everything_it_began() -> None:
    async def scenario() -> None:
        core = ScriptedCore(first=[Ask()])
        core.deadline_s = 1.0
        async with at_work(core) as played:
            await until(lambda: len(asyncio.all_tasks()) == 4, "asking")
            played.running.cancel()
            with pytest.raises(asyncio.CancelledError):
                await played.running
            assert len(asyncio.all_tasks()) == 1

    play(scenario)


class OwnError(Exception):
    """Stands for a bug."""


def raise_own(thing: object) -> Sequence[Action]:
    raise OwnError


@pytest.mark.parametrize("where", ["start", "step", "execute", "deadline", "snapshot"])
def test_a_bug_anywhere_ends_the_run_with_it(where: str, monkeypatch: pytest.MonkeyPatch) -> None:
    async def scenario() -> None:
        core = ScriptedCore(first=[Own("first")] if where == "execute" else ())
        if where == "start":
            monkeypatch.setattr(core, "start", raise_own)
        if where == "step":
            monkeypatch.setattr(core, "step", lambda event, _: raise_own(event))
        if where == "deadline":
            monkeypatch.setattr(core, "next_deadline_s", lambda: raise_own(None))

        def execute(action: Action) -> None:
            raise OwnError

        async with at_work(core, execute=execute) as played:
            if where == "snapshot":
                monkeypatch.setattr(played.shell._questions, "_snapshot", raise_own)
                await played.other.query(KEYS.state("*"), timeout_s=0.01)
            with pytest.raises(OwnError):
                await played.running

    play(scenario)


@pytest.mark.parametrize("wish", [Publish(CLAIM), Ask()], ids=["publish", "ask"])
def test_a_bus_that_was_closed_ends_the_run(wish: CommonAction) -> None:
    async def scenario() -> None:
        async with at_work(ScriptedCore(lambda _: [wish])) as played:
            played.seat.close()
            played.shell.step(PeerSeen("u9"))
            with pytest.raises(BusError):
                await played.running

    play(scenario)


def test_events_that_come_up_during_a_step_follow_it_in_order() -> None:
    shells: list[Shell[CommonEvent, Action]] = []
    steps: list[str] = []

    def react(fact: CommonEvent) -> Sequence[Action]:
        match fact:
            case PeerSeen(writer):
                steps.append(f"step {writer}")
                return [Own(f"{writer} one"), Own(f"{writer} two")]
            case _:
                return ()

    def execute(action: Action) -> None:
        assert isinstance(action, Own)
        steps.append(action.name)
        if action.name == "a one":
            shells[0].step(PeerSeen("b"))
        if action.name == "a two":
            shells[0].step(PeerSeen("c"))

    async def scenario() -> None:
        async with at_work(ScriptedCore(react), execute=execute) as played:
            shells.append(played.shell)
            played.shell.step(PeerSeen("a"))
            assert await played.end() == 0

    play(scenario)

    wanted = ["step a", "a one", "a two", "step b", "b one", "b two", "step c", "c one", "c two"]
    assert steps == wanted


def test_events_that_come_up_while_the_core_starts_follow_the_start() -> None:
    shells: list[Shell[CommonEvent, Action]] = []

    def execute(action: Action) -> None:
        shells[0].step(END)

    async def scenario() -> None:
        core = ScriptedCore(first=[Own("one"), LogLine("two", {"n": 2})])
        async with at_work(core, execute=execute) as played:
            shells.append(played.shell)
            assert await played.running == 0
            assert core.heard == [END]

    play(scenario)


def test_an_onlooker_takes_a_seat_that_nobody_sees() -> None:
    async def scenario() -> None:
        network = MemoryNetwork()
        there, observer = network.join("u1"), network.join("onlooker")
        join_mission(there, MISSION, "u1", status=False)
        join_mission(observer, MISSION, None, status=True)
        there.inbox.take()
        there.publish(KEYS.status("u1"), b"s")
        observer.publish(KEYS.status("u2"), b"s")

        assert TokenSeen(KEYS.alive("u1")) in (seen := observer.inbox.take())
        assert Sample(KEYS.status("u1"), b"s") in seen
        assert there.inbox.take() == []
        assert await there.query(KEYS.state("*"), timeout_s=5.0) == ()

    play(scenario)
