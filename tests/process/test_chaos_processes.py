"""Real processes that die, hang and come back while the mission goes on."""

from __future__ import annotations

import math
from dataclasses import replace
from itertools import pairwise
from pathlib import Path
from typing import TypeVar

import pytest

from sim.fleet.faults.checks import AGREE_WITHIN_S
from sim.fleet.faults.flight import ChaosFlight, ChaosVerdict
from sim.fleet.layout import BusKind
from swarm.model import Task, TaskId
from swarm.protocol.messages import Body
from swarm.protocol.uav_messages import Claim, Status
from tests.process.chaos_play import all_done, by_day, logged_done, play, story, survey, told

pytestmark = [pytest.mark.process]

SPEEDUP = 4.0
VICTIM = "uav03"
LOST = f"{VICTIM} lost"

B = TypeVar("B", bound=Body)


def newest_claim(flight: ChaosFlight, uav: str) -> Claim | None:
    return next(
        (
            message.body
            for message in reversed(flight.recorder.messages())
            if message.writer == uav and isinstance(message.body, Claim)
        ),
        None,
    )


def said_by(verdict: ChaosVerdict, uav: str, kind: type[B]) -> list[tuple[int, B]]:
    """Incarnation and content of what a UAV said of that kind, in order."""
    return [
        (message.stamp.incarnation, message.body)
        for message in verdict.messages
        if message.writer == uav and isinstance(message.body, kind)
    ]


@pytest.mark.parametrize("bus", by_day(BusKind.ROUTER))
def test_a_restarted_agent_resumes_its_task_while_its_vehicle_flies_on(
    tmp_path: Path, bus: BusKind
) -> None:
    async def script(flight: ChaosFlight) -> None:
        def sets_off() -> bool:  # that its claim is proposed is over before a busy machine looks
            claim = newest_claim(flight, VICTIM)
            return claim is not None and claim.task is not None

        await flight.until(sets_off, f"{VICTIM} sets off")
        await flight.kill(VICTIM)
        await flight.restart(VICTIM)

    # Far away, one for each: nobody is free to take the task over while the agent starts.
    mission = survey(3, 0, side_m=0.0)
    tasks = (Task(TaskId(f"t{n}"), (36.0 * n, 600.0, 0.0), 1.0, service_s=1.0) for n in (0, 1, 2))
    mission = replace(mission, tasks=tuple(tasks))
    verdict = play(mission, tmp_path, script, bus=bus, speedup=5.0)

    all_done(verdict, 3)
    assert verdict.duplicates == 0
    claims = said_by(verdict, VICTIM, Claim)
    first_life = claims[0][0]
    (*_, before) = [said.task for life, said in claims if life == first_life]
    (after, *_) = [said.task for life, said in claims if life > first_life and said.task]
    assert before == after
    assert [visit.uav for visit in verdict.visits if visit.task == before] == [VICTIM]

    (task,) = [task for task in mission.tasks if task.id == before]
    left_m = [
        math.dist(said.position_enu_m[:2], task.position_enu_m[:2])
        for life, said in said_by(verdict, VICTIM, Status)
        if said.task == task.id and said.position_enu_m is not None
    ]
    assert left_m[0] > 100.0
    assert left_m[-1] < 50.0  # the last status before the arrival
    assert all(later <= earlier + 1.0 for earlier, later in pairwise(left_m))


@pytest.mark.parametrize("bus", by_day(BusKind.MESH))
def test_a_hung_agents_tasks_go_to_others_and_it_comes_back_in_peace(
    tmp_path: Path, bus: BusKind
) -> None:
    async def script(flight: ChaosFlight) -> None:
        await flight.until_done(5)
        flight.pause(VICTIM)
        await flight.until(lambda: any(LOST in line for line in told(flight)), LOST)
        flight.resume(VICTIM)

    # One task is for the one that hangs alone: however late it comes back, it has something to do.
    mission = survey(4, 27)
    own = Task(TaskId("own"), mission.uavs[0].position_enu_m, 1e-3)
    others: dict[str, float] = {own.id: 0.0}
    uavs = (u if u.id == VICTIM else replace(u, success=others) for u in mission.uavs)
    mission = replace(mission, uavs=tuple(uavs), tasks=(*mission.tasks, own))
    verdict = play(mission, tmp_path, script, bus=bus, speedup=SPEEDUP)

    all_done(verdict, 28)
    assert f"{VICTIM} is back" in story(verdict)
    assert verdict.agreement_s <= AGREE_WITHIN_S
    assert [visit.uav for visit in verdict.visits if visit.task == own.id] == [VICTIM]


def test_the_fleet_rides_out_a_restart_of_its_only_router(tmp_path: Path) -> None:
    async def script(flight: ChaosFlight) -> None:
        await flight.until_done(5)
        await flight.kill("router 1")
        before = len(logged_done(flight))
        await flight.until(lambda: len(logged_done(flight)) >= before + 5, "work without a bus")
        await flight.restart("router 1")

    verdict = play(survey(4, 28), tmp_path, script, bus=BusKind.ROUTER, speedup=SPEEDUP)

    all_done(verdict, 28)
    assert verdict.flight.result.lost_uavs == ()
    assert verdict.agreement_s <= AGREE_WITHIN_S


@pytest.mark.parametrize("router", ["router 1", pytest.param("router 2", marks=pytest.mark.slow)])
def test_of_two_routers_one_may_die(tmp_path: Path, router: str) -> None:
    async def script(flight: ChaosFlight) -> None:
        await flight.until_done(5)
        await flight.kill(router)

    verdict = play(survey(4, 28), tmp_path, script, bus=BusKind.ROUTER, routers=2, speedup=SPEEDUP)

    all_done(verdict, 28)
    assert verdict.flight.result.lost_uavs == ()
    assert verdict.duplicates == 0
