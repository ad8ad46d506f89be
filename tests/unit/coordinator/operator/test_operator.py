"""What the coordinator makes of the operator's words and of UAVs that are held."""

from __future__ import annotations

import pytest

from swarm.model.ids import COORDINATOR, FLEET, OPERATOR
from swarm.protocol.events import Finish, Save
from swarm.protocol.messages import CommandKind, MissionPhase, OperatorCommand, Snapshot
from tests.support.builders import (
    IDLE,
    MISSION,
    OUT,
    PAUSED,
    brief,
    epoch,
    held,
    message,
    mission,
    task,
    uav,
)
from tests.support.lone_coordinator import START_TIMEOUT_S, LoneCoordinator
from tests.support.running_mission import RunningMission

TWO = mission([uav("u0"), uav("u1")], [task("t0", 5.0), task("t1", 9.0)])
ABORT = OperatorCommand(FLEET, CommandKind.ABORT, 1, "storm")
FLOWN = (
    message(COORDINATOR, brief(uav("u0"), uav("u1"))),
    message(COORDINATOR, epoch("u0", "u1"), 2),
    message("u0", held("t0", 0.0)),
)


def run_of(coordinator: LoneCoordinator) -> int:
    brief_ = coordinator.core.replica.brief
    assert brief_ is not None
    return brief_.run


def abort(coordinator: LoneCoordinator, run: int | None = None) -> None:
    of = run_of(coordinator) if run is None else run
    coordinator.hear(OPERATOR, OperatorCommand(FLEET, CommandKind.ABORT, of, ""))


def test_an_abort_ends_the_mission_and_then_the_coordinator() -> None:
    coordinator = LoneCoordinator(TWO).started()

    abort(coordinator)

    assert coordinator.phase is MissionPhase.ENDED
    assert coordinator.reason == "aborted by the operator"
    assert Save() in coordinator.log
    for name in coordinator.uavs:
        coordinator.leave(name)
    assert Finish(1) in coordinator.run_until(coordinator.now_s + 10.0)


def test_an_abort_before_the_start_lets_nothing_start() -> None:
    coordinator = LoneCoordinator(TWO)
    abort(coordinator)
    coordinator.answer_plan("u0", "u1")
    coordinator.ready("u0", "u1")

    assert coordinator.phase is MissionPhase.ENDED


def test_the_abort_of_an_earlier_flight_ends_nothing() -> None:
    coordinator = LoneCoordinator(TWO).started()

    abort(coordinator, run=run_of(coordinator) + 1)

    assert coordinator.phase is MissionPhase.RUNNING


def test_a_restarted_coordinator_ends_the_mission_that_was_aborted_meanwhile() -> None:
    known = (*FLOWN, message(OPERATOR, ABORT))
    coordinator = LoneCoordinator(
        TWO, incarnation=9, answers=[Snapshot(MISSION, "u0", 1, 3.0, known)]
    )

    assert coordinator.phase is MissionPhase.ENDED
    assert coordinator.reason == "aborted by the operator: storm"


def test_one_that_remembers_the_abort_does_not_begin_anew_though_all_have_left() -> None:
    memory = Snapshot(MISSION, COORDINATOR, 1, 3.0, (*FLOWN, message(OPERATOR, ABORT)))
    coordinator = LoneCoordinator(TWO, incarnation=9, memory=memory, memory_age_s=1.0)

    assert run_of(coordinator) == 1
    assert coordinator.phase is MissionPhase.ENDED
    assert Finish(1) in coordinator.run_until(coordinator.now_s + 10.0)


def test_a_held_uav_is_not_waited_for_at_the_start() -> None:
    coordinator = LoneCoordinator(TWO)
    coordinator.answer_plan("u0", "u1")
    coordinator.ready("u0")
    coordinator.see("u1")
    coordinator.hear("u1", PAUSED)
    coordinator.answer_plan("u0")
    coordinator.run_until(coordinator.now_s + 0.1)

    assert coordinator.phase is MissionPhase.RUNNING
    assert coordinator.epoch is not None
    assert coordinator.epoch.sequence == ("u0",)


def test_when_everyone_is_held_the_mission_waits_instead_of_ending() -> None:
    coordinator = LoneCoordinator(TWO)
    coordinator.answer_plan("u0", "u1")
    coordinator.see("u0", "u1")
    coordinator.hear("u0", PAUSED)
    coordinator.hear("u1", PAUSED)

    coordinator.run_until(coordinator.now_s + 2.0 * START_TIMEOUT_S)
    assert coordinator.phase is None

    coordinator.hear("u0", IDLE)
    coordinator.answer_plan("u0")
    coordinator.run_until(coordinator.now_s + 0.1)
    assert coordinator.phase is MissionPhase.RUNNING


def test_the_mission_does_not_end_while_a_held_uav_could_go_on() -> None:
    coordinator = LoneCoordinator(TWO).started()
    coordinator.hear("u0", PAUSED)
    coordinator.leave("u1")

    coordinator.run_until(coordinator.now_s + 1000.0)
    before = coordinator.phase
    coordinator.hear("u0", OUT)
    coordinator.run_until(coordinator.now_s + 1.0)

    assert [before, coordinator.phase] == [MissionPhase.RUNNING, MissionPhase.ENDED]


def test_idle_uavs_do_not_end_it_for_the_one_that_is_held() -> None:
    coordinator = LoneCoordinator(TWO).started()
    coordinator.hear("u0", PAUSED)

    coordinator.run_until(coordinator.now_s + 1000.0)

    assert coordinator.phase is MissionPhase.RUNNING


@pytest.mark.parametrize("claim", [PAUSED, OUT])
def test_nobody_plans_with_a_uav_that_is_held(claim: object) -> None:
    running = RunningMission(TWO)
    running.say("u1", claim)  # type: ignore[arg-type]  # one of two claims

    assert running.at(3.0).taking_part == {"u0"}
