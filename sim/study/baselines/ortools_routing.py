"""Routing with OR-Tools, made to come as near to eq. 1 as its model allows.

It is an optional extra (``peckorder[bench]``), imported when used. How its model falls short of the
objective is said by `SHORTFALL`.
"""

from __future__ import annotations

from collections.abc import Sequence
from importlib.util import find_spec
from typing import Any

import numpy as np

from sim.study.baselines.index_rules import Routes
from swarm.allocation.problem import IntArray, Problem
from swarm.runtime.extras import MissingExtraError

SHORTFALL = (
    "OR-Tools has no value that falls with time and depends on who serves: a task's lateness "
    "costs its value times the average p of the fleet (a soft upper bound of 0 on its arrival), "
    "each UAV's own p enters as a cost of the arc at half the horizon, survival not at all, and "
    "times are whole numbers. Where p is the same for all UAVs and survival is 1 that is eq. 1 but "
    "for rounding and a small cost of travel. Its routes are scored by J of eq. 1 like all others."
)
"""What its model leaves out, for every output that shows its figures."""

_UNITS_PER_HORIZON = 100_000
_LARGEST_WEIGHT = 1_000
_DIMENSION = "time"


def is_installed() -> bool:
    """Whether OR-Tools can be imported."""
    return find_spec("ortools") is not None


def require_installed() -> None:
    """Refuse in one line.

    Raises:
        InputError: OR-Tools is not installed.
    """
    if not is_installed():
        raise MissingExtraError("--methods ortools", "bench")


def matrix_bytes(problem: Problem) -> int:
    """Memory that the travel times take, one matrix per UAV and twice with its p [byte]."""
    return 2 * 8 * problem.n_uav * (problem.n_task + 1) ** 2


def ortools_routes(
    problem: Problem,
    limit_s: float,
    *,
    success_share: float = 0.5,
    start: Sequence[Sequence[int]] | None = None,
) -> Routes:
    """Lists by parallel cheapest insertion and guided local search.

    Args:
        problem: the mission; tasks that nobody is capable of stay off the lists.
        limit_s: of the search, which the building of the model precedes [s]; > 0.
        success_share: how much of the horizon the difference between a UAV's p and the best p is
            taken to cost, within 0..1; 0 leaves only the average p.
        start: lists to begin with, all tasks on them; its own first solution when None.

    Returns:
        Task indices per UAV; all lists empty if it found no solution in time.

    Raises:
        InputError: OR-Tools is not installed.
    """
    require_installed()
    from ortools.constraint_solver import pywrapcp, routing_enums_pb2

    tasks = np.flatnonzero(problem.capable.any(axis=0))
    if not len(tasks) or not problem.n_uav:
        return [[] for _ in range(problem.n_uav)]
    # Node 0 is every UAV's start, told apart by the matrices, and the end, reached in no time.
    manager = pywrapcp.RoutingIndexManager(len(tasks) + 1, problem.n_uav, 0)
    routing = pywrapcp.RoutingModel(manager)
    _model(problem, tasks, success_share, manager, routing)

    parameters = pywrapcp.DefaultRoutingSearchParameters()
    first, improve = (
        routing_enums_pb2.FirstSolutionStrategy,
        (routing_enums_pb2.LocalSearchMetaheuristic),
    )
    parameters.first_solution_strategy = first.PARALLEL_CHEAPEST_INSERTION
    parameters.local_search_metaheuristic = improve.GUIDED_LOCAL_SEARCH
    parameters.time_limit.FromMilliseconds(max(1, round(limit_s * 1000.0)))
    if start is None:
        solution = routing.SolveWithParameters(parameters)
    else:
        node = {int(task): i + 1 for i, task in enumerate(tasks)}
        routing.CloseModelWithParameters(parameters)
        begin = routing.ReadAssignmentFromRoutes([[node[t] for t in r] for r in start], True)
        solution = routing.SolveFromAssignmentWithParameters(begin, parameters)
    if solution is None:
        return [[] for _ in range(problem.n_uav)]
    return [_route(uav, tasks, manager, routing, solution) for uav in range(problem.n_uav)]


def _model(
    problem: Problem, tasks: IntArray, success_share: float, manager: Any, routing: Any
) -> None:
    """Minimise Σ average weight · time of arrival + what a lower p than the best costs."""
    weight = problem.weight[:, tasks]
    able = problem.capable[:, tasks]
    scale = _LARGEST_WEIGHT / max(float(weight.max()), 1e-300)
    between = np.ix_(tasks, tasks)
    transits = []
    for uav in range(problem.n_uav):
        time_s = np.zeros((len(tasks) + 1, len(tasks) + 1))
        time_s[0, 1:] = problem.travel_s(uav, problem.start_enu_m[uav])[tasks]
        time_s[1:, 1:] = problem.travel_between_s(uav)[between]
        time_s[:, 1:] += problem.service_s[tasks]
        units = np.rint(time_s * (_UNITS_PER_HORIZON / problem.horizon_s)).astype(np.int64)
        transit = routing.RegisterTransitMatrix(units.tolist())
        transits.append(transit)
        if success_share > 0.0:
            lost = (weight.max(axis=0) - weight[uav]) * scale * success_share * _UNITS_PER_HORIZON
            units[:, 1:] += np.rint(lost).astype(np.int64)
            transit = routing.RegisterTransitMatrix(units.tolist())
        routing.SetArcCostEvaluatorOfVehicle(transit, uav)
    longest = 10_000 * _UNITS_PER_HORIZON  # late tasks are allowed, as by eq. 1
    routing.AddDimensionWithVehicleTransits(transits, 0, longest, True, _DIMENSION)
    time = routing.GetDimensionOrDie(_DIMENSION)
    average = weight.sum(axis=0) / able.sum(axis=0)
    for i in range(len(tasks)):
        index = manager.NodeToIndex(i + 1)
        time.SetCumulVarSoftUpperBound(index, 0, max(1, round(float(average[i] * scale))))
        for uav in np.flatnonzero(~able[:, i]).tolist():
            routing.VehicleVar(index).RemoveValue(uav)


def _route(uav: int, tasks: IntArray, manager: Any, routing: Any, solution: Any) -> list[int]:
    route = []
    index = solution.Value(routing.NextVar(routing.Start(uav)))
    while not routing.IsEnd(index):
        route.append(int(tasks[manager.IndexToNode(index) - 1]))
        index = solution.Value(routing.NextVar(index))
    return route
