"""Fates and plans for tests of policies, each with only what the test cares about."""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence

from sim.study.generator import mission_of
from sim.study.policies.roster import Planner
from sim.study.policies.situation import Account, TeamNews, TeamSituation
from sim.world.outcome import FlightOutcome
from sim.world.uncertainty import Realization, Uncertainty
from swarm.allocation import Problem, evaluate
from swarm.model import Mission, Plan, TaskId, UavId

CALM = Uncertainty()


class StillClock:
    """Time that stands still."""

    def now_s(self) -> float:
        return 0.0

    def wall_delay_s(self, delay_s: float) -> float:
        return delay_s


class Script:
    """Takes what a script says, one task after the other, if it is open."""

    def __init__(self, routes: Sequence[Sequence[int]]) -> None:
        self.account = Account(StillClock())
        self.heard: list[tuple[float, set[TeamNews]]] = []
        self.asked: list[tuple[float, int]] = []
        self._routes = [list(route) for route in routes]

    def hear(self, situation: TeamSituation, news: Collection[TeamNews]) -> Collection[int]:
        self.heard.append((situation.now_s, set(news)))
        return ()

    def choose(self, situation: TeamSituation, uav: int) -> int | None:
        self.asked.append((situation.now_s, uav))
        for task in self._routes[uav]:
            if task < situation.problem.n_task and situation.state.open[task]:
                self._routes[uav].remove(task)
                return task
        return None


def fate_of(
    mission: Mission,
    uncertainty: Uncertainty = CALM,
    *,
    seed: int = 0,
    lost_at_s: Mapping[str, float] | None = None,
    withdrawn_at_s: Mapping[str, float] | None = None,
) -> Realization:
    """A future in which only this happens."""
    return Realization(
        mission=mission,
        seed=seed,
        span_s=100.0,
        uncertainty=uncertainty,
        lost_at_s={UavId(uav): time_s for uav, time_s in (lost_at_s or {}).items()},
        withdrawn_at_s={TaskId(task): time_s for task, time_s in (withdrawn_at_s or {}).items()},
    )


def calm(problem: Problem) -> Realization:
    """Nothing happens."""
    return fate_of(mission_of(problem, "calm"))


def planner_of(problem: Problem, routes: Sequence[Sequence[int]]) -> Planner:
    """One that has these lists for everything."""
    objective, completion_s = evaluate(problem, routes)
    plan = Plan(
        scenario="test",
        method="guided",
        routes={
            uav: tuple(problem.task_ids[task] for task in route)
            for uav, route in zip(problem.uav_ids, routes, strict=True)
        },
        objective=objective,
        completion_s={
            problem.task_ids[task]: float(completion_s[task]) for route in routes for task in route
        },
        sequence=problem.uav_ids,
        optimum=None,
        evaluations=0,
        elapsed_s=0.0,
        seed=0,
    )

    def planner(mission: Mission, method: str) -> Plan:
        assert method == plan.method
        return plan

    return planner


def flown(problem: Problem, flight: FlightOutcome) -> list[list[int]]:
    """Task indices per UAV in the order of their visits."""
    routes: list[list[int]] = [[] for _ in problem.uav_ids]
    for visit in flight.visits:
        row = problem.uav_ids.index(visit.uav)
        routes[row].append(problem.task_ids.index(visit.task))
    return routes


def times_s(flight: FlightOutcome) -> dict[str, float]:
    """When each task was last visited [s]."""
    return {visit.task: visit.completed_s for visit in flight.visits}
