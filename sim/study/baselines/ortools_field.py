"""Routing with OR-Tools in the field: batteries, bases, zones, windows, due times, lines.

The whole model is written down in README.md beside this file. It states J and all limits but for
what `LEFT_OUT` says; missions that it has no words for are refused by `refusal`. OR-Tools is an
optional extra (``peckorder[bench]``), imported when used.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from sim.study.baselines.ortools_routing import is_installed
from swarm.allocation.field import FieldProblem
from swarm.allocation.problem import BoolArray, FloatArray, IntArray

LEFT_OUT = (
    "OR-Tools in the field: J is stated exactly, up to weights rounded to a 10000th of the largest "
    "and times to milliseconds, plus a share of the travel, without which its guided local search "
    "has nothing to penalise. Limits are 10 ms wider than they are. What breaks them is dropped."
)
"""What its model leaves out, for every output that shows its figures."""

_MS_PER_S = 1000.0
_LEEWAY_MS = 10
"""Limits are so much wider, so that rounding forbids nothing that is possible."""
_LARGEST_WEIGHT = 10_000
_TRAVEL_SHARE = 0.1
"""What a second of travel costs, as a share of what a second of delay of an average task does."""
_VISITS_PER_UAV = 5
"""To bases, on average."""
_NO_WAY_S = 1e7
_LONGEST_SHARE = 3.0
"""Tasks end at the latest after so many times D, if they are not due."""


def refusal(problem: FieldProblem) -> str | None:
    """Why the model has no words for this mission; None if it has."""
    if not is_installed():
        return "OR-Tools is not installed: pip install 'peckorder[bench]'"
    weight = np.where(problem.capable, problem.weight, np.nan)
    if problem.n_task and (np.nanmax(weight, axis=0) > np.nanmin(weight, axis=0)).any():
        return "OR-Tools has no words for a p that depends on the UAV"
    if (problem.survival < 1.0).any():
        return "OR-Tools has no words for losses"
    if (problem.full_s != problem.full_s[:1]).any():
        return "its model here knows one kind of battery"
    if ((problem.slots > 0) & (problem.slots < problem.n_uav)).any():
        return "its model here knows no slots at bases"
    return None


def field_lists(
    problem: FieldProblem,
    limit_s: float,
    start: Sequence[Sequence[int]] | None = None,
    *,
    makespan: bool = False,
) -> tuple[tuple[int, ...], ...]:
    """Lists of items by guided local search; some may break limits by some milliseconds.

    Args:
        problem: a mission that `refusal` has nothing against.
        limit_s: of the search, which the building of the model precedes [s]; > 0.
        start: lists to begin with; its own first solution when None.
        makespan: look for the earliest end of the last task, not for J.

    Returns:
        Items per UAV; all lists empty if it found no solution in time.
    """
    if not problem.n_uav or not problem.n_task:
        return ((),) * problem.n_uav
    model = _Model(problem, makespan=makespan)
    return model.solved(limit_s, None if start is None else model.stated(start))


@dataclass(frozen=True, slots=True)
class _Stops:
    """Nodes 1, 2, … of the model: every task, lines once each way, then bases several times."""

    item: IntArray
    """(n_stop,) item of a list; negative: a base."""
    enter: IntArray
    """(n_stop,) node of the problem where work begins."""
    leave: IntArray
    """(n_stop,) node of the problem where it ends."""

    @property
    def at_base(self) -> BoolArray:
        """(n_stop,) whether it is a visit to a base."""
        return self.item < 0

    @classmethod
    def of(cls, problem: FieldProblem) -> _Stops:
        """A visit to a base is a node, for it happens once; bases in turn."""
        tasks = np.flatnonzero(problem.capable.any(axis=0))
        items = np.sort(np.concatenate([2 * tasks, 2 * tasks[problem.is_line[tasks]] + 1]))
        items = items[np.isfinite(problem.line_s[:, items >> 1, items & 1]).any(axis=0)]
        swaps = bool(problem.n_base) and np.isfinite(problem.full_s).any()
        visits = np.arange(_VISITS_PER_UAV * problem.n_uav if swaps else 0) % max(1, problem.n_base)
        at_bases, task, way = problem.n_uav + visits, items >> 1, items & 1
        return cls(
            item=np.concatenate([items, -1 - visits]).astype(np.int32),
            enter=np.concatenate([problem.enter[task, way], at_bases]).astype(np.int32),
            leave=np.concatenate([problem.enter[task, 1 - way], at_bases]).astype(np.int32),
        )

    def work_s(self, problem: FieldProblem, uav: int) -> FloatArray:
        """(n_stop,) what that UAV is busy there: line and service, or swap [s]."""
        task, way = self.item >> 1, self.item & 1
        on_line_s = problem.line_s[problem.kind[uav]]
        return np.where(
            self.at_base,
            np.append(problem.swap_s, 0.0)[np.where(self.at_base, -1 - self.item, -1)],
            (problem.service_s + on_line_s.T)[way, np.maximum(task, 0)],
        )


class _Model:
    """One mission as OR-Tools is told of it; solved once."""

    def __init__(self, problem: FieldProblem, *, makespan: bool) -> None:
        from ortools.constraint_solver import pywrapcp

        self._problem = problem
        self._stops = stops = _Stops.of(problem)
        # Node 0 is every UAV's start, told apart by the matrices, and the end.
        self._manager = pywrapcp.RoutingIndexManager(len(stops.item) + 1, problem.n_uav, 0)
        self._routing = pywrapcp.RoutingModel(self._manager)
        weight = problem.weight.max(axis=0)
        self._weight_scale = _LARGEST_WEIGHT / max(float(weight.max()), 1e-300)
        self._weight = np.maximum(1.0, np.rint(weight * self._weight_scale)).astype(np.int64)
        self._add_times()
        self._add_tasks(delays_cost=not makespan)
        if makespan:
            span = int(self._weight.sum())
            self._routing.GetDimensionOrDie("time").SetGlobalSpanCostCoefficient(span)
        if np.isfinite(problem.full_s).any():
            self._add_energy()

    def _add_times(self) -> None:
        """The cumul of a task is its end; arcs cost a share of what they delay."""
        problem, routing = self._problem, self._routing
        transits, sum_s = [], np.zeros((len(self._stops.item) + 1,) * 2)
        for uav in range(problem.n_uav):
            time_s = _times_s(problem, self._stops, uav)
            transits.append(routing.RegisterTransitMatrix(_ms(time_s).tolist()))
            sum_s += time_s
        price = _TRAVEL_SHARE * float(self._weight.mean()) / problem.n_uav
        travel = routing.RegisterTransitMatrix(_ms(sum_s * price).tolist())
        routing.SetArcCostEvaluatorOfAllVehicles(travel)
        longest = int(_LONGEST_SHARE * problem.horizon_s * _MS_PER_S)
        routing.AddDimensionWithVehicleTransits(transits, longest, longest, True, "time")

    def _add_tasks(self, *, delays_cost: bool) -> None:
        """Windows, what ends cost, and what it costs to leave tasks out; visits are free."""
        problem, routing, stops = self._problem, self._routing, self._stops
        time = routing.GetDimensionOrDie("time")
        worth = self._weight * problem.until_s * _MS_PER_S
        dearest = int(worth.sum())
        either: dict[int, list[int]] = {}
        for node, item in enumerate(stops.item.tolist(), start=1):
            index = self._manager.NodeToIndex(node)
            if item < 0:
                routing.AddDisjunction([index], 0)
                continue
            task = item >> 1
            either.setdefault(task, []).append(index)
            on_line_s = np.minimum(problem.line_s[:, task, item & 1], _NO_WAY_S)
            service_s = float(problem.service_s[task])
            first_s = float(problem.opens_s[task]) + service_s + float(on_line_s.min())
            last_s = float(problem.closes_s[task]) + service_s + float(on_line_s.max())
            last_s = min(last_s, float(problem.due_s[task]))
            if first_s > 0.0:
                time.CumulVar(index).SetMin(max(0, int(first_s * _MS_PER_S) - _LEEWAY_MS))
            if np.isfinite(last_s):
                time.CumulVar(index).SetMax(int(last_s * _MS_PER_S) + _LEEWAY_MS)
            if delays_cost:
                time.SetCumulVarSoftUpperBound(index, 0, int(self._weight[task]))
            for uav in np.flatnonzero(~problem.capable[:, task]).tolist():
                routing.VehicleVar(index).RemoveValue(uav)
        for task, ways in either.items():
            required = bool(problem.required[task])
            routing.AddDisjunction(ways, int(worth[task]) + (dearest if required else 0))

    def _add_energy(self) -> None:
        """Its cumul is the airborne time since the last swap.

        At a base it is the whole battery, whatever was left: slack before it burns the rest. What
        leaves a base takes that off again. Filters of the local search see all of that; what they
        do not see is that waiting in the air is airborne time too.
        """
        problem, routing, manager = self._problem, self._routing, self._manager
        full_ms = int(problem.full_s[0] * _MS_PER_S) + _LEEWAY_MS
        transits = []
        for uav in range(problem.n_uav):
            used_ms = _ms(_used_s(problem, self._stops, uav))
            used_ms[1:][self._stops.at_base] -= full_ms
            transits.append(routing.RegisterTransitMatrix(used_ms.tolist()))
        routing.AddDimensionWithVehicleTransits(transits, full_ms, full_ms, False, "energy")
        energy, time = routing.GetDimensionOrDie("energy"), routing.GetDimensionOrDie("time")
        add = routing.solver().Add
        aloft = [routing.Start(uav) for uav in range(problem.n_uav)]
        for uav, index in enumerate(aloft):
            begun_ms = int((problem.full_s[uav] - problem.first_s[uav]) * _MS_PER_S)
            energy.CumulVar(index).SetRange(begun_ms, begun_ms)
        for node, item in enumerate(self._stops.item.tolist(), start=1):
            index = manager.NodeToIndex(node)
            if item < 0:
                energy.CumulVar(index).SetRange(full_ms, full_ms)
            else:
                aloft.append(index)
        for index in aloft:
            add(energy.SlackVar(index) >= time.SlackVar(index))
        # It waits for what opens, and not before bases or what is open.
        longest_ms = [0] * (routing.Size() + problem.n_uav)
        for node, item in enumerate(self._stops.item.tolist(), start=1):
            if item >= 0:
                opens_ms = int(max(0.0, problem.opens_s[item >> 1]) * _MS_PER_S)
                longest_ms[manager.NodeToIndex(node)] = opens_ms
        for index in range(routing.Size()):
            longest = routing.solver().Element(longest_ms, routing.NextVar(index))
            add(time.SlackVar(index) <= longest + _LEEWAY_MS)

    def stated(self, lists: Sequence[Sequence[int]]) -> list[list[int]]:
        """Nodes of lists of items, as far as there are enough visits to bases."""
        visits: dict[int, list[int]] = {}
        for node, item in enumerate(self._stops.item.tolist(), start=1):
            visits.setdefault(item, []).append(node)
        stated: list[list[int]] = []
        for items in lists:
            stated.append([])
            for item in items:
                if not visits.get(item):
                    break
                stated[-1].append(visits[item].pop(0))
        return stated

    def solved(self, limit_s: float, start: list[list[int]] | None) -> tuple[tuple[int, ...], ...]:
        """Lists of items after so long."""
        routing = self._routing
        parameters = _parameters(limit_s)
        routing.CloseModelWithParameters(parameters)
        begin = None if start is None else routing.ReadAssignmentFromRoutes(start, True)
        if begin is None:
            solution = routing.SolveWithParameters(parameters)
        else:
            solution = routing.SolveFromAssignmentWithParameters(begin, parameters)
        if solution is None:
            return ((),) * self._problem.n_uav
        return tuple(self._list(uav, solution) for uav in range(self._problem.n_uav))

    def _list(self, uav: int, solution: Any) -> tuple[int, ...]:
        routing, items = self._routing, list[int]()
        index = solution.Value(routing.NextVar(routing.Start(uav)))
        while not routing.IsEnd(index):
            items.append(int(self._stops.item[self._manager.IndexToNode(index) - 1]))
            index = solution.Value(routing.NextVar(index))
        while items and items[-1] < 0:
            items.pop()
        return tuple(items)


def _times_s(problem: FieldProblem, stops: _Stops, uav: int) -> FloatArray:
    """(n_stop + 1, n_stop + 1) from the end of work at a stop to that at the next [s].

    Row 0 is the UAV's start, column 0 the end of its list, which takes no time.
    """
    leg_s = problem.leg_s[problem.kind[uav]]
    time_s = np.zeros((len(stops.item) + 1,) * 2)
    time_s[0, 1:] = leg_s[uav, stops.enter]
    time_s[1:, 1:] = leg_s[np.ix_(stops.leave, stops.enter)]
    time_s[:, 1:] += stops.work_s(problem, uav)
    return time_s


def _used_s(problem: FieldProblem, stops: _Stops, uav: int) -> FloatArray:
    """The same in the air: no swaps, and column 0 is the way home [s]."""
    used_s = _times_s(problem, stops, uav)
    used_s[:, 1:] -= np.where(stops.at_base, stops.work_s(problem, uav), 0.0)
    used_s[1:, 0] = problem.home_s[uav, stops.leave]
    used_s[1:, 0][stops.at_base] = 0.0
    return used_s


def _ms(time_s: FloatArray) -> npt.NDArray[np.int64]:
    """Whole milliseconds; where there is no way, more than any limit."""
    return np.rint(np.minimum(time_s, _NO_WAY_S) * _MS_PER_S).astype(np.int64)


def _parameters(limit_s: float) -> Any:
    """Guided local search with all operators that can add a visit and a task in one move."""
    from ortools.constraint_solver import pywrapcp, routing_enums_pb2
    from ortools.util import optional_boolean_pb2

    parameters = pywrapcp.DefaultRoutingSearchParameters()
    parameters.first_solution_strategy = (
        routing_enums_pb2.FirstSolutionStrategy.PARALLEL_CHEAPEST_INSERTION
    )
    parameters.local_search_metaheuristic = (
        routing_enums_pb2.LocalSearchMetaheuristic.GUIDED_LOCAL_SEARCH
    )
    operators = parameters.local_search_operators
    operators.use_relocate_and_make_active = optional_boolean_pb2.BOOL_TRUE
    operators.use_exchange_and_make_active = optional_boolean_pb2.BOOL_TRUE
    operators.use_extended_swap_active = optional_boolean_pb2.BOOL_TRUE
    parameters.time_limit.FromMilliseconds(max(1, round(limit_s * _MS_PER_S)))
    return parameters
