"""Missions in their midst, for planning from there."""

from __future__ import annotations

import numpy as np

from coordinator.planner.online import (
    EpochPolicy,
    Prediction,
    Situation,
)
from tests.support.builders import (
    done,
    held,
    mission,
    random_mission,
    task,
    uav,
)
from tests.support.running_mission import RunningMission

GREEDY = EpochPolicy("greedy", (), {})


def fork() -> RunningMission:
    """Two UAVs at 1 m/s and three tasks on a line."""
    fleet = [uav("a"), uav("b", east_m=100.0)]
    return RunningMission(
        mission(fleet, [task("t0", 10.0), task("t1", 30.0), task("t2", 80.0)], horizon_s=500.0)
    )


def midway(seed: int, *, max_uavs: int = 3, max_tasks: int = 7) -> Situation:
    """A random mission in which some tasks are done and some UAVs fly, wait or are lost."""
    rng = np.random.default_rng(seed)
    flown = random_mission(rng, max_uavs=max_uavs, max_tasks=max_tasks)
    running = RunningMission(flown)
    tasks = [str(t.id) for t in flown.tasks]
    for who in [str(u.id) for u in flown.uavs]:
        if tasks and rng.random() < 0.5:
            running.say(who, done(tasks.pop(), float(rng.uniform(0.0, 9.0))))
        if tasks and rng.random() < 0.5:
            running.say(who, held(tasks.pop(), 5.0, completion_s=float(rng.uniform(5.0, 40.0))))
        if len(running.credible) > 1 and rng.random() < 0.2:
            running.lose(who)
    return running.at(10.0)


def indices(situation: Situation, prediction: Prediction) -> list[list[int]]:
    problem = situation.problem
    column: dict[str, int] = {name: index for index, name in enumerate(problem.task_ids)}
    return [[column[name] for name in prediction.lists[who]] for who in problem.uav_ids]
