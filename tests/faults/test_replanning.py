"""Epochs come while the fleet flies: nobody leaves a task for one, and they are worth it.

What a UAV in flight may turn to is what opens: a task that appears, or that of a lost UAV.
"""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass, replace
from functools import partial
from itertools import pairwise, permutations

import numpy as np
import pytest

from agent.core.interface import Action as AgentAction
from agent.core.interface import GoTo, OrderVehicle
from coordinator.core.active import CoordinatorCore
from coordinator.core.lifecycle import CoordinatorAction, Replan
from coordinator.planner.online import ReplanResult, predicted, replan
from sim.world.engine import Process
from sim.world.network import IdealNetwork
from sim.world.settings import QUIET, Replanner, ScheduledLosses, WorldSettings, planned_anew
from sim.world.virtual_world import World
from swarm.model import Mission, Task, TaskId, Uav, UavId
from swarm.model.ids import COORDINATOR
from swarm.protocol.events import LogLine, Publish
from swarm.protocol.messages import MissionPhase, PlanEpoch
from tests.support.fleet_builders import plan_for, random_mission

INTERVAL_S = 1.0
ANY_PLAN = -1e9
"""A margin with which whatever is planned becomes an epoch, better or not."""


class ReplannedWorld(World):
    """An ideal world whose coordinator plans anew, with a record of orders and epochs."""

    def __init__(
        self,
        mission: Mission,
        *,
        seed: int = 0,
        faults: ScheduledLosses | None = None,
        planner: Replanner = planned_anew,
        interval_s: float = INTERVAL_S,
        margin_frac: float | None = None,
        plan_s: float = 0.5,
        method: str = "guided",
    ) -> None:
        self.legs: list[tuple[str, tuple[float, float, float]]] = []
        """Every order to fly somewhere: UAV and place."""
        self.epochs: dict[int, PlanEpoch] = {}
        self.wanted: list[tuple[Replan, ReplanResult]] = []
        self.turns: list[tuple[str, float]] = []
        """UAVs that left a task in flight for one that had opened, and when [s mission time]."""

        def watched(request: Replan) -> ReplanResult:
            made = planner(request)
            self.wanted.append((request, made))
            return made

        super().__init__(
            mission,
            plan_for,
            method=method,
            seed=seed,
            faults=faults,
            timing=replace(QUIET, replan_interval_s=interval_s),
            setting=WorldSettings(
                lambda queue: IdealNetwork(queue, 0.0), replan=watched, plan_s=plan_s
            ),
        )
        if margin_frac is not None:
            self.coordinator._mission.replan_policy._margin_frac = margin_frac

    @property
    def coordinator(self) -> CoordinatorCore:
        core = self.processes[COORDINATOR].core
        assert isinstance(core, CoordinatorCore)
        return core

    def execute(self, process: Process, action: AgentAction | CoordinatorAction) -> None:
        match action:
            case OrderVehicle(GoTo(position_enu_m=place)):
                self.legs.append((process.name, place))
            case LogLine("turns aside" | "released"):
                self.turns.append((process.name, self.queue.now_s() - (self.zero_s or 0.0)))
            case Publish(message) if isinstance(message.body, PlanEpoch):
                self.epochs.setdefault(message.body.number, message.body)
        super().execute(process, action)

    @property
    def visits(self) -> list[TaskId]:
        return [
            task for route in self.mission_state.result().executed_routes.values() for task in route
        ]


def disturbed(seed: int, n_uav: int = 5, n_task: int = 20) -> tuple[Mission, ScheduledLosses]:
    """A third of the tasks appear late, a third of the UAVs but not the first are lost."""
    rng = np.random.default_rng([seed, 404])
    mission = random_mission(
        rng, n_uav=n_uav, n_task=n_task, popup_frac=0.3, popup_until_s=60.0, incapable_frac=0.1
    )
    lost = [uav.id for uav in mission.uavs[1:] if rng.random() < 0.3]
    return mission, ScheduledLosses({uav: float(rng.uniform(1.0, 80.0)) for uav in lost})


# -- never revoked ------------------------------------------------------------------------


def restless(seed: int) -> ReplannedWorld:
    """Every second there may be another epoch, of whatever worth."""
    mission, faults = disturbed(seed)
    world = ReplannedWorld(mission, seed=seed, faults=faults, margin_frac=ANY_PLAN)
    assert world.run(1e5)
    return world


def test_who_flies_to_a_task_ends_it_whatever_epochs_come() -> None:
    epochs = 0
    for seed in range(25):
        world = restless(seed)

        result = world.mission_state.result()
        # On an ideal bus nobody has another reason to turn away.
        begun, turned = (
            Counter(uav for uav, _ in world.legs),
            Counter(uav for uav, _ in world.turns),
        )
        for uav, route in result.executed_routes.items():
            extra = begun[uav] - len(route)
            assert extra == turned[uav] + (1 if cut_short(world, uav) else 0), seed
        assert len(world.visits) == len(set(world.visits)), seed
        assert {round(at_s, 6) for _, at_s in world.turns} <= openings_s(seed), seed
        epochs += len(world.epochs) - 1
    assert epochs > 60, "else they were not restless"


def openings_s(seed: int) -> set[float]:
    """When tasks appear and losses are noticed in that mission [s mission time]."""
    mission, faults = disturbed(seed)
    noticed_s = {at_s + QUIET.loss_delay_s for at_s in faults.lost_at_s.values()}
    return {round(at_s, 6) for at_s in {task.appears_s for task in mission.tasks} | noticed_s}


def cut_short(world: ReplannedWorld, uav: UavId) -> bool:
    """Whether the UAV was lost on its way to a task."""
    if uav not in world.mission_state.result().lost_uavs:
        return False
    claim = world.agents[uav].claim
    return claim is not None and claim.task is not None


# -- the classical case of churning ----------------------------------------------------------


@dataclass(frozen=True, slots=True)
class Estimates:
    """Speeds as measured in gusts: now one UAV seems the faster one, now the other."""

    fast_m_s: float = 10.0
    slow_m_s: float = 5.0

    def at(self, tick: int) -> tuple[float, float]:
        speeds_m_s = (self.fast_m_s, self.slow_m_s)
        return speeds_m_s if tick % 2 == 0 else speeds_m_s[::-1]


TRUE_SPEED_M_S = 7.0
HORIZON_S = 1000.0
EAST, WEST = 100.0, -100.0
VALUES = {EAST: 2.0, WEST: 1.0}


def best_targets(places_m: list[float], speeds_m_s: tuple[float, float]) -> tuple[float, float]:
    """Who should fly east and who west for the most value."""

    def worth(targets: tuple[float, ...]) -> float:
        return sum(
            VALUES[target] * (HORIZON_S - abs(target - place_m) / speed_m_s)
            for target, place_m, speed_m_s in zip(targets, places_m, speeds_m_s, strict=True)
        )

    first, second = max(permutations((EAST, WEST)), key=worth)
    return first, second


def test_a_planner_that_revokes_swaps_two_uavs_for_ever() -> None:
    """The reference: optimal at every second for the estimates of that second, and never done."""
    places_m, orders = [0.0, 0.0], []
    for second in range(1000):
        targets = best_targets(places_m, Estimates().at(second))
        orders.append(targets)
        for uav, target in enumerate(targets):
            left_m = target - places_m[uav]
            places_m[uav] += float(np.sign(left_m)) * min(abs(left_m), TRUE_SPEED_M_S)

    assert all(before != after for before, after in pairwise(orders))
    assert max(abs(place_m) for place_m in places_m) < 10.0


def two_and_two() -> Mission:
    uavs = tuple(Uav(UavId(name), (0.0, 0.0, 0.0), TRUE_SPEED_M_S) for name in ("a", "b"))
    tasks = tuple(
        Task(TaskId(f"t{n}"), (east_m, 0.0, 0.0), value)
        for n, (east_m, value) in enumerate(VALUES.items())
    )
    return Mission("churn", HORIZON_S, uavs, tasks)


def test_a_coordinator_that_swaps_every_second_swaps_nobody_under_way() -> None:
    world = ReplannedWorld(two_and_two())

    def swap(second: int) -> None:
        best = best_targets([0.0, 0.0], Estimates().at(second))
        lists = {name: (f"t{(EAST, WEST).index(to)}",) for name, to in zip("ab", best, strict=True)}
        core, last = world.coordinator, world.coordinator.replica.epoch
        if last is not None and last.phase is MissionPhase.RUNNING:
            sequence = ("a", "b") if second % 2 == 0 else ("b", "a")
            swapped = replace(last, number=last.number + 1, sequence=sequence, routes=lists)
            core._actions.append(core._announcer.say(swapped))

    for second in range(1, 100):
        world.queue.at(float(second), partial(swap, second))

    assert world.run(1e4)
    # Until the first is there, 14 s, and while the rest of the fleet goes home.
    assert len(world.epochs) > 14
    assert len({tuple(epoch.routes.items()) for epoch in world.epochs.values()}) >= 2
    assert sorted(world.visits) == ["t0", "t1"]
    assert sorted(name for name, _ in world.legs) == ["a", "b"]


def test_estimates_that_waver_for_a_whole_mission_cost_no_visit() -> None:
    """Re-planned every second by wavering estimates, and each plan an epoch, good or bad."""
    rng = np.random.default_rng(5)
    uavs = two_and_two().uavs
    tasks = tuple(
        Task(TaskId(f"t{n:02}"), (float(rng.uniform(-300, 300)), 0.0, 0.0), 1.0 + n % 3)
        for n in range(24)
    )
    late = tuple(replace(t, appears_s=3.0 * n) if n > 11 else t for n, t in enumerate(tasks))
    ticks = iter(range(10**6))

    def wavering(request: Replan) -> ReplanResult:
        situation = request.situation
        speed_m_s = np.array(Estimates().at(next(ticks)))
        problem = replace(situation.problem, speed_m_s=speed_m_s)
        seen = replace(situation, problem=problem)
        return replan(seen, request.course, request.method, seed=request.seed, threads=1)

    world = ReplannedWorld(
        Mission("waver", HORIZON_S, uavs, late), planner=wavering, margin_frac=ANY_PLAN
    )

    assert world.run(1e4)
    assert len(world.epochs) > 10
    assert sorted(world.visits) == sorted(task.id for task in tasks)
    assert len(world.legs) == len(tasks) + len(world.turns)
    assert {round(at_s, 6) for _, at_s in world.turns} <= {task.appears_s for task in late}


# -- worth it ---------------------------------------------------------------------------------


def going_on(request: Replan) -> ReplanResult:
    """No plan at all: what the fleet does anyway."""
    course = request.course
    prediction = predicted(request.situation, course)
    return ReplanResult(course.rule, course.sequence, prediction, prediction)


def two_lost(seed: int, method: str, planner: Replanner = planned_anew) -> ReplannedWorld:
    """Two UAVs are lost soon after the start; it is planned anew at 10 s, and once."""
    mission = disturbed(seed)[0].known_at_start()
    faults = ScheduledLosses({uav.id: 9.0 for uav in mission.uavs[-2:]})
    world = ReplannedWorld(
        mission, seed=seed, faults=faults, method=method, interval_s=10.0, planner=planner
    )
    assert world.run(1e5)
    assert [request.situation.now_s for request, _ in world.wanted] == [10.0]
    return world


@pytest.mark.parametrize("method", ["greedy", "guided"])
@pytest.mark.parametrize("seed", range(8))
def test_what_is_predicted_comes_about_if_nothing_else_happens(seed: int, method: str) -> None:
    world = two_lost(seed, method)

    made = world.wanted[0][1]
    adopted = len(world.epochs) == 3  # the first, the next, and the one that ends it all
    expected_s = (made.prediction if adopted else made.going_on).completion_s
    executed_s = world.mission_state.result().executed_completion_s
    assert expected_s
    for task, time_s in expected_s.items():
        assert executed_s[TaskId(task)] == pytest.approx(time_s, abs=1e-6)


def test_a_better_plan_is_worth_as_much_more_as_it_promises() -> None:
    gains, promises = [], []
    for seed in (*range(4), 22, 29, 31):  # plans are adopted in the last ones
        world, without = two_lost(seed, "guided"), two_lost(seed, "guided", going_on)
        assert len(without.epochs) == 2
        made, results = (
            world.wanted[0][1],
            (world.mission_state.result(), without.mission_state.result()),
        )
        gains.append(results[0].executed_objective - results[1].executed_objective)
        adopted = len(world.epochs) == 3
        gain = made.prediction.objective - made.going_on.objective
        promises.append(gain if adopted else 0.0)

    assert gains == pytest.approx(promises, abs=1e-6)
    assert max(promises) > 0.0
