"""What `swarm bench routes` sets beside each other: our search, and solvers of others.

The others are modelled as well as their words allow; what they leave out is said by `METHODS`. All
routes are valued by the instance alone.
"""

from __future__ import annotations

import json
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from importlib.util import find_spec
from typing import Any

import numpy as np

from sim.bench.instances import Family, Instance
from swarm.allocation.rules import team_at_start
from swarm.kernels.routes import optimise_routes
from swarm.runtime.clock import SystemClock

_NODE_AFTER_DEPOT = 2
"""The number of the first task in the order of the file."""


@dataclass(frozen=True, slots=True)
class Found:
    """What a solver returned."""

    routes: list[list[int]]
    """Nodes from 1 in the order of the file, without the depot, one list per UAV."""
    seconds: float
    """Until its best was found; its whole time where it does not tell."""


@dataclass(frozen=True, slots=True)
class RouteMethod:
    """One solver."""

    what: str
    module: str | None
    """What must be installed for it; None for ours."""
    seeded: bool
    """Whether a seed decides what it finds."""
    families: frozenset[Family]
    """Whose objective it can state, at least in part."""
    solve: Callable[[Instance, int, float], Found]
    """Of an instance, a seed and a limit [s]."""

    def is_installed(self) -> bool:
        """Whether it can run here."""
        return self.module is None or find_spec(self.module) is not None


def solve_guided(instance: Instance, seed: int, limit_s: float) -> Found:
    """Search as `swarm plan --method guided` does, with the instance's own distances.

    Ends before its limit where the published upper bound proves what it has found.
    """
    clock = SystemClock()
    began_s = clock.now_s()
    seconds, best = 0.0, float("-inf")

    def spent_frac(_: int) -> float:
        if instance.upper_bound is not None and best >= instance.upper_bound:
            return 1.0
        return (clock.now_s() - began_s) / limit_s

    def progress(_: int, value: float) -> None:
        nonlocal seconds, best
        if value > best:
            seconds, best = clock.now_s() - began_s, value

    lists, _ = optimise_routes(
        team_at_start(instance.problem()),
        seed=seed,
        spent_frac=spent_frac,
        progress=progress,
        given=instance.given_times(),
    )
    return Found([[task + _NODE_AFTER_DEPOT for task in tasks] for tasks in lists], seconds)


_ARC_SHARE = 100
"""Arrivals cost this many times what arcs cost, which guided local search needs to go on."""


def solve_ortools(instance: Instance, seed: int, limit_s: float) -> Found:
    """Σ arrivals as soft upper bounds of 0, tasks left out at the price of their profit.

    That is the published objective but for a hundredth of the travel, without which its guided
    local search has nothing to penalise.
    """
    del seed
    from ortools.constraint_solver import pywrapcp, routing_enums_pb2

    manager = pywrapcp.RoutingIndexManager(instance.n_task + 1, instance.n_uav, 0)
    routing = pywrapcp.RoutingModel(manager)
    time = instance.distance.astype(np.int64)
    time[:, 0] = 0  # nobody returns
    transit = routing.RegisterTransitMatrix(time.tolist())
    routing.SetArcCostEvaluatorOfAllVehicles(transit)
    longest = int(time.max()) * (instance.n_task + 1)
    routing.AddDimension(transit, 0, longest, True, "time")
    arrival = routing.GetDimensionOrDie("time")
    profit = _ARC_SHARE * instance.profit
    for node in range(1, instance.n_task + 1):
        index = manager.NodeToIndex(node)
        arrival.SetCumulVarSoftUpperBound(index, 0, _ARC_SHARE)
        if instance.family is Family.MTRPP:
            routing.AddDisjunction([index], round(float(profit[node])))
    parameters = pywrapcp.DefaultRoutingSearchParameters()
    first, improve = (
        routing_enums_pb2.FirstSolutionStrategy,
        routing_enums_pb2.LocalSearchMetaheuristic,
    )
    parameters.first_solution_strategy = first.PARALLEL_CHEAPEST_INSERTION
    parameters.local_search_metaheuristic = improve.GUIDED_LOCAL_SEARCH
    parameters.time_limit.FromMilliseconds(max(1, round(limit_s * 1000.0)))
    clock = SystemClock()
    began_s = clock.now_s()
    best, seconds = None, limit_s

    def improved() -> None:
        nonlocal best, seconds
        cost = routing.CostVar().Max()
        if best is None or cost < best:
            best, seconds = cost, clock.now_s() - began_s

    routing.AddAtSolutionCallback(improved)
    solution = routing.SolveWithParameters(parameters)
    if solution is None:
        return Found([[] for _ in range(instance.n_uav)], limit_s)
    routes = []
    for uav in range(instance.n_uav):
        route, index = [], solution.Value(routing.NextVar(routing.Start(uav)))
        while not routing.IsEnd(index):
            route.append(manager.IndexToNode(index) + 1)
            index = solution.Value(routing.NextVar(index))
        routes.append(route)
    return Found(routes, seconds)


def solve_vrp_cli(instance: Instance, seed: int, limit_s: float) -> Found:
    """All tasks done, then least arrival times in its own sense, then least duration."""
    del seed
    import vrp_cli

    objectives = ("minimize-unassigned", "minimize-arrival-time", "minimize-duration")
    problem = {
        "plan": {"jobs": [_job(node) for node in range(1, instance.n_task + 1)]},
        "fleet": {"vehicles": [_fleet(instance.n_uav)], "profiles": [{"name": "air"}]},
        "objectives": [[{"type": name}] for name in objectives],
    }
    times = instance.distance.astype(np.int64).ravel().tolist()
    matrix = {"profile": "air", "travelTimes": times, "distances": times}
    config = {
        "termination": {"maxTime": max(1, round(limit_s)), "maxGenerations": 10**9},
        "environment": {"logging": {"enabled": False}},
    }
    said: dict[str, Any] = json.loads(
        vrp_cli.solve_pragmatic(
            problem=json.dumps(problem),
            matrices=[json.dumps(matrix)],
            config=json.dumps(config),
        )
    )
    routes = [_nodes(tour["stops"]) for tour in said["tours"]]
    idle: list[list[int]] = [[] for _ in range(instance.n_uav - len(routes))]
    return Found([*routes, *idle], limit_s)


def _job(node: int) -> dict[str, Any]:
    place = {"location": {"index": node}, "duration": 0.0}
    return {"id": str(node + 1), "services": [{"places": [place]}]}


def _fleet(n_uav: int) -> dict[str, Any]:
    start = {"earliest": "1970-01-01T00:00:00Z", "location": {"index": 0}}
    return {
        "typeId": "uav",
        "vehicleIds": [f"uav{uav + 1}" for uav in range(n_uav)],
        "profile": {"matrix": "air"},
        "costs": {"fixed": 0.0, "distance": 0.0, "time": 1.0},
        "shifts": [{"start": start}],
        "capacity": [10**6],
    }


def _nodes(stops: Sequence[dict[str, Any]]) -> list[int]:
    acts = [act for stop in stops for act in stop["activities"]]
    return [int(act["jobId"]) for act in acts if act["type"] == "service"]


METHODS = {
    "guided": RouteMethod(
        "what plans missions here, on every core", None, True, frozenset(Family), solve_guided
    ),
    "ortools": RouteMethod(
        "OR-Tools routing, one core: arrivals as soft upper bounds of 0, profits as penalties of "
        "tasks left out, which is the published objective but for a hundredth of the travel that "
        "its guided local search needs",
        "ortools",
        False,
        frozenset(Family),
        solve_ortools,
    ),
    "vrp-cli": RouteMethod(
        "reinterpretcat's vrp-cli, every core: all tasks, then its own minimize-arrival-time, then "
        "duration; it cannot weigh profits against arrivals, so instances with profits are not "
        "given to it; its limit is whole seconds",
        "vrp_cli",
        False,
        frozenset({Family.TRP}),
        solve_vrp_cli,
    ),
}
"""By name, ours first."""
