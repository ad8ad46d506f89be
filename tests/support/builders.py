"""Missions and messages for tests, each with only what the test cares about."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np

from swarm.model import Mission, Task, TaskId, Uav, UavId
from swarm.model.ids import COORDINATOR
from swarm.protocol.fields import Point
from swarm.protocol.messages import (
    Body,
    Message,
    MissionConfig,
    MissionPhase,
    PlanEpoch,
    Stamp,
    TaskEdit,
    TaskEntry,
    UavSpec,
)
from swarm.protocol.timing import Timing
from swarm.protocol.uav_messages import (
    AttemptResult,
    Candidate,
    Choice,
    ChoiceBasis,
    Claim,
    ClaimPhase,
    Outcome,
    Status,
    StatusPhase,
)

MISSION = "test"
TIMING = Timing()


def uav(name: str, east_m: float = 0.0, speed_m_s: float = 1.0, **success: float) -> Uav:
    return Uav(UavId(name), (east_m, 0.0, 0.0), speed_m_s, success=success)


def task(
    name: str,
    east_m: float,
    value: float = 1.0,
    *,
    service_s: float = 0.0,
    appears_s: float = 0.0,
) -> Task:
    place = (east_m, 0.0, 0.0)
    return Task(TaskId(name), place, value, service_s=service_s, appears_s=appears_s)


def mission(uavs: Sequence[Uav], tasks: Sequence[Task], horizon_s: float = 1000.0) -> Mission:
    return Mission(MISSION, horizon_s, tuple(uavs), tuple(tasks))


def message(writer: str, body: Body, counter: int = 1, incarnation: int = 1) -> Message:
    return Message(MISSION, writer, Stamp(incarnation, counter), body)


def brief(*uavs: Uav, reattempt_failed: bool = False, layer_m: float = 10.0) -> MissionConfig:
    return MissionConfig(
        horizon_s=1000.0,
        success_default=1.0,
        survival_default=1.0,
        reattempt_failed=reattempt_failed,
        run=1,
        origin=(47.0, 8.0, 400.0),
        uavs=tuple(
            UavSpec(
                u.id,
                u.position_enu_m,
                u.speed_m_s,
                dict(u.success),
                dict(u.survival),
                u.kind,
                layer_m,
                u.acceleration_m_s2,
            )
            for u in uavs
        ),
    )


def entry(name: str, east_m: float = 0.0, number: int = 0, **more: object) -> TaskEntry:
    posted = TaskEntry(name, number, (east_m, 0.0, 0.0), 1.0, 0.0, None, False)
    return replace(posted, **more)  # type: ignore[arg-type]  # each test names real fields


def order(name: str, east_m: float = 0.0, number: int = 9, **more: object) -> TaskEdit:
    """What the operator says of a task, for the run of `brief`."""
    said = TaskEdit(name, number, (east_m, 0.0, 0.0), 1.0, 0.0, None, False, 1, "")
    return replace(said, **more)  # type: ignore[arg-type]  # each test names real fields


def brief_of(flown: Mission) -> MissionConfig:
    """What the coordinator of that mission says of it, without height layers."""
    return replace(
        brief(*flown.uavs, reattempt_failed=flown.reattempt_failed, layer_m=0.0),
        horizon_s=flown.horizon_s,
        success_default=flown.success_default,
        survival_default=flown.survival_default,
    )


def entries_of(flown: Mission) -> list[TaskEntry]:
    """The mission's tasks as its board has them, pop-ups included."""
    return [
        TaskEntry(t.id, number, t.position_enu_m, t.value, t.service_s, t.kind, False)
        for number, t in enumerate(flown.tasks)
    ]


def epoch(
    *sequence: str,
    phase: MissionPhase = MissionPhase.RUNNING,
    number: int = 1,
    mission_s: float = 0.0,
    rule: str = "greedy",
    reason: str = "",
    left_out: Mapping[str, tuple[str, ...]] | None = None,
) -> PlanEpoch:
    return PlanEpoch(number, phase, rule, sequence, mission_s, reason, {}, left_out or {})


def proposed(name: str, decided_s: float, rank: int = 0, completion_s: float = 1000.0) -> Claim:
    return Claim(ClaimPhase.PROPOSED, name, decided_s, rank, completion_s)


def held(name: str, decided_s: float, rank: int = 0, completion_s: float = 1000.0) -> Claim:
    return Claim(ClaimPhase.HELD, name, decided_s, rank, completion_s)


IDLE = Claim(ClaimPhase.IDLE, None, 0.0, 0, 0.0)
OUT = Claim(ClaimPhase.OUT, None, 0.0, 0, 0.0)
PAUSED = Claim(ClaimPhase.PAUSED, None, 0.0, 0, 0.0)


def done(name: str, completed_s: float = 1.0, attempt: int = 1) -> Outcome:
    return Outcome(name, AttemptResult.DONE, attempt, completed_s)


def failed(name: str, completed_s: float = 1.0, attempt: int = 1) -> Outcome:
    return Outcome(name, AttemptResult.FAILED, attempt, completed_s)


def status(phase: StatusPhase = StatusPhase.IDLE, position_enu_m: Point | None = None) -> Status:
    return Status(phase, None, position_enu_m, None, None, None, {}, "")


def choice(name: str, left: str | None = None, number: int = 1) -> Choice:
    """Why a UAV took the task of that name, or turned to it."""
    return Choice(
        number=number,
        task=name,
        left=left,
        chosen_s=1.0,
        epoch=1,
        rule="greedy",
        rank=0,
        score=2.0,
        second_score=1.5,
        certificate=False,
        completion_s=9.0,
        candidates=(Candidate(name, 2.0), Candidate("other", 1.5)),
        basis=ChoiceBasis(
            decided_s=1.0,
            place_enu_m=(0.0, 0.0, 0.0),
            patience_s=0.5,
            credible=("u1",),
            awaited=(),
            excluded=("t9",),
            heads={"coordinator": (1, 12), "u0": (1, 3)},
            digest=5,
        ),
    )


def posts(*entries: TaskEntry) -> list[Message]:
    """The coordinator's statements that post these tasks."""
    return [message(COORDINATOR, e, counter=10 + n) for n, e in enumerate(entries)]


def random_mission(
    rng: np.random.Generator,
    *,
    max_uavs: int = 8,
    max_tasks: int = 25,
    popup_frac: float = 0.0,
    grid: bool = False,
) -> Mission:
    """Any mission in which every task has a UAV that can do it.

    Args:
        rng: all chance there is.
        max_uavs: largest fleet.
        max_tasks: most tasks.
        popup_frac: probability that a task appears later.
        grid: whole numbers everywhere, so that many decisions fall on the same instant.
    """
    n_uav, n_task = int(rng.integers(1, max_uavs + 1)), int(rng.integers(1, max_tasks + 1))

    def point() -> Point:
        east_m, north_m = rng.uniform(0.0, 100.0, 2)
        return (round(east_m / 10), round(north_m / 10), 0.0) if grid else (east_m, north_m, 0.0)

    def probabilities(least: float) -> Mapping[str, float]:
        named = [t for t in range(n_task) if rng.random() < 0.5]
        return {f"t{t}": float(rng.uniform(least, 1.0)) for t in named}

    success = [dict(probabilities(0.3)) for _ in range(n_uav)]
    for t in range(n_task):
        incapable = [u for u in range(n_uav) if rng.random() < 0.2]
        for u in incapable[: n_uav - 1]:
            success[u][f"t{t}"] = 0.0
    uavs = [
        Uav(
            id=UavId(f"u{u}"),
            position_enu_m=point(),
            speed_m_s=1.0 if grid else float(rng.uniform(1.0, 10.0)),
            success=success[u],
            survival=probabilities(0.5),
        )
        for u in range(n_uav)
    ]
    tasks = [
        Task(
            id=TaskId(f"t{t}"),
            position_enu_m=point(),
            value=float(rng.integers(0, 10)),
            service_s=float(rng.integers(0, 3) if grid else rng.choice([0.0, rng.uniform(0, 9)])),
            appears_s=float(rng.uniform(0.0, 60.0)) if rng.random() < popup_frac else 0.0,
        )
        for t in range(n_task)
    ]
    defaults = rng.choice([1.0, 0.9, 0.6], 2)
    horizon_s = float(rng.choice([20.0, 200.0, 2000.0]))
    return Mission(
        MISSION,
        horizon_s,
        tuple(uavs),
        tuple(tasks),
        success_default=float(defaults[0]),
        survival_default=float(defaults[1]),
    )


def with_accelerations(flown: Mission, rng: np.random.Generator) -> Mission:
    """``flown`` by UAVs of which all but the last take their time to change speed."""
    slow = [replace(u, acceleration_m_s2=float(rng.uniform(0.1, 3.0))) for u in flown.uavs]
    return replace(flown, uavs=(*slow[:-1], flown.uavs[-1]))
