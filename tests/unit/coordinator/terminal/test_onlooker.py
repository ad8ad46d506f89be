"""An observer learns a mission of which it knows the name, and knows when it is done."""

from __future__ import annotations

import asyncio

import pytest

from coordinator.joining import find_missions
from coordinator.mission_view.observation import MissionObserver
from swarm.model.ids import COORDINATOR
from swarm.protocol.events import (
    Ask,
    CommonEvent,
    Finish,
    MessageReceived,
    PeerSeen,
    SnapshotsReceived,
    Tick,
)
from swarm.protocol.messages import Snapshot
from swarm.protocol.timing import Timing
from tests.support.builders import MISSION, brief, entry, epoch, message, status, uav
from tests.support.memory_bus import MemoryNetwork

BRIEF = message(COORDINATOR, brief(uav("u0"), uav("u1")))
REGISTERS = (BRIEF, message(COORDINATOR, entry("t0")), message(COORDINATOR, epoch("u0", "u1")))
ANSWER = SnapshotsReceived((Snapshot(MISSION, COORDINATOR, 1, 2.0, REGISTERS),))


def observer(
    *facts: CommonEvent, patience_s: float | None = 4.0
) -> tuple[MissionObserver, list[object]]:
    """An observer that was told ``facts``, and all it wanted, at 0.5 s."""
    core = MissionObserver(MISSION, Timing(), patience_s)
    wishes: list[object] = [*core.start(0.0)]
    for fact in facts:
        wishes += core.step(fact, 0.5)
    return core, wishes


def said(writer: str) -> MessageReceived:
    return MessageReceived(message(writer, status()))


def test_it_asks_and_ends_once_everyone_there_has_been_heard() -> None:
    seen = (PeerSeen(COORDINATOR), PeerSeen("u0"), PeerSeen("u1"))
    _, waiting = observer(*seen, ANSWER, said("u0"))
    core, done = observer(*seen, ANSWER, said("u0"), said("u1"))

    assert waiting == [Ask()]
    assert done == [Ask(), Finish(0)]
    assert [each.id for each in core.mission_state.mission.uavs] == ["u0", "u1"]
    assert [each.id for each in core.mission_state.mission.tasks] == ["t0"]
    assert core.mission_state.mission_s(1.0) == 2.5


def test_who_is_not_there_is_not_waited_for() -> None:
    assert observer(PeerSeen("u0"), ANSWER, said("u0"))[1][-1] == Finish(0)


def test_its_patience_ends_with_what_is_known() -> None:
    silent, _ = observer(PeerSeen("u0"), ANSWER)
    deadline_s = silent.next_deadline_s()
    assert deadline_s == 4.0
    assert silent.step(Tick(), deadline_s)[-1] == Finish(0)

    ignorant, _ = observer(PeerSeen("u0"))
    assert ignorant.step(Tick(), 4.0)[-1] == Finish(1)


def test_without_a_limit_it_looks_on_and_follows_the_board() -> None:
    core, wishes = observer(PeerSeen("u0"), ANSWER, said("u0"), patience_s=None)
    assert Finish(0) not in wishes

    core.step(MessageReceived(message(COORDINATOR, entry("t1", 1), 5)), 2.0)

    assert [each.id for each in core.mission_state.mission.tasks] == ["t0", "t1"]


@pytest.mark.parametrize("missions", [[], ["alpha"], ["alpha", "beta"]])
def test_missions_are_found_by_their_tokens(missions: list[str]) -> None:
    async def scenario() -> list[str]:
        network = MemoryNetwork()
        for name in missions:
            network.join(name).declare_token(f"swarm/{name}/alive/u0")
        network.join("stranger").declare_token("elsewhere/alpha/alive/u0")
        return await find_missions(network.join("onlooker"), 0.05)

    assert asyncio.run(scenario()) == missions
