"""Schedules and rules of the field's problem by plain loops over `FieldProblem`.

What the kernels compute (swarm.kernels.field) is defined here. Leaves out: where tables come from;
an independent reading of the whole text lies in tests.support.field_oracle.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Sequence
from dataclasses import dataclass, field, replace

from swarm.allocation.field import FieldProblem, FieldState
from swarm.kernels.field import FieldRefusal

TOLERANCE_S = 1e-6

Times = tuple[float, float, float, float]
"""Departure, arrival, beginning, end [s]."""


@dataclass(frozen=True, slots=True)
class Stand:
    """Where a UAV stands and is free."""

    time_s: float
    sortie_end_s: float
    node: int | None
    """None: at a place that the state alone knows."""
    landed: bool
    survived: float
    value: float = 0.0


@dataclass(slots=True)
class Flown:
    """What became of one list."""

    stand: Stand
    times: list[Times] = field(default_factory=list)
    refusal: FieldRefusal = FieldRefusal.NONE
    home: int = -1
    home_s: tuple[float, float] = (math.nan, math.nan)


class PlainField:
    """One problem and one state, item by item."""

    def __init__(self, problem: FieldProblem, state: FieldState) -> None:
        self.problem = problem
        self.state = state

    def begin(self, uav: int) -> Stand:
        state = self.state
        landed = bool(state.landed_at[uav] >= 0)
        times_s = float(state.free_s[uav]), float(state.sortie_end_s[uav])
        return Stand(*times_s, None, landed, float(state.survived[uav]))

    def leg_s(self, uav: int, stand: Stand, node: int) -> float:
        if stand.node is None:
            return float(self.state.first_s[uav, node])
        return float(self.problem.leg_s[self.problem.kind[uav], stand.node, node])

    def base_node(self, base: int) -> int:
        return self.problem.n_uav + base

    def departure_s(self, uav: int, stand: Stand, item: int) -> float:
        if not stand.landed or item < 0:
            return stand.time_s
        leg_s = self.leg_s(uav, stand, int(self.problem.enter[item // 2, item % 2]))
        if math.isinf(leg_s):
            return stand.time_s
        return max(stand.time_s, float(self.problem.opens_s[item // 2]) - leg_s)

    def task(self, uav: int, stand: Stand, item: int) -> tuple[Stand, Times] | FieldRefusal:
        problem = self.problem
        task, backwards = divmod(item, 2)
        if not problem.capable[uav, task]:
            return FieldRefusal.INCAPABLE
        leg_s = self.leg_s(uav, stand, int(problem.enter[task, backwards]))
        line_s = float(problem.line_s[problem.kind[uav], task, backwards])
        if math.isinf(leg_s) or math.isinf(line_s):
            return FieldRefusal.NO_WAY
        depart_s = self.departure_s(uav, stand, item)
        arrive_s = depart_s + leg_s
        begin_s = max(arrive_s, float(problem.opens_s[task]))
        if begin_s > problem.closes_s[task] + TOLERANCE_S:
            return FieldRefusal.WINDOW
        end_s = (begin_s + line_s) + float(problem.service_s[task])
        if end_s > problem.due_s[task] + TOLERANCE_S:
            return FieldRefusal.DUE
        full_s = float(problem.full_s[uav])
        sortie_end_s = depart_s + full_s if stand.landed else stand.sortie_end_s
        leaves = int(problem.enter[task, 1 - backwards])
        home_s = float(problem.home_s[uav, leaves])
        if math.isinf(home_s):
            return FieldRefusal.NO_WAY
        if end_s + home_s > sortie_end_s + TOLERANCE_S:
            return FieldRefusal.ENERGY
        gain = stand.survived * float(problem.weight[uav, task])
        gain *= float(problem.until_s[task]) - end_s
        survived = stand.survived * float(problem.survival[uav, task])
        after = Stand(end_s, sortie_end_s, leaves, False, survived, stand.value + gain)
        return after, (depart_s, arrive_s, begin_s, end_s)

    def arrival_s(self, uav: int, stand: Stand, base: int) -> float:
        return stand.time_s + self.leg_s(uav, stand, self.base_node(base))

    def swap(
        self, uav: int, stand: Stand, base: int, begin_s: float
    ) -> tuple[Stand, Times] | FieldRefusal:
        arrive_s = self.arrival_s(uav, stand, base)
        if math.isinf(arrive_s):
            return FieldRefusal.NO_WAY
        full_s = float(self.problem.full_s[uav])
        sortie_end_s = stand.time_s + full_s if stand.landed else stand.sortie_end_s
        if begin_s > sortie_end_s + TOLERANCE_S:
            return FieldRefusal.ENERGY
        ready_s = begin_s + float(self.problem.swap_s[base])
        after = replace(
            stand, time_s=ready_s, sortie_end_s=math.inf, node=self.base_node(base), landed=True
        )
        return after, (stand.time_s, arrive_s, begin_s, ready_s)

    def fly(self, lists: Sequence[Sequence[int]]) -> list[Flown]:
        """All lists together; every arrival at a base is gone through in its order."""
        problem, state = self.problem, self.state
        flown = [Flown(self.begin(uav)) for uav in range(problem.n_uav)]
        slots = {
            base: [-math.inf] * int(problem.slots[base])
            for base in range(problem.n_base)
            if problem.slots[base] > 0
        }
        landed = [
            (float(state.free_s[uav]), int(state.rank[uav]), uav)
            for uav in range(problem.n_uav)
            if state.landed_at[uav] >= 0 and int(state.landed_at[uav]) in slots
        ]
        for ready_s, _, uav in sorted(landed):
            leaves_s = ready_s if state.active[uav] else math.inf
            if state.active[uav] and lists[uav]:
                leaves_s = self.departure_s(uav, flown[uav].stand, lists[uav][0])
            taken = slots[int(state.landed_at[uav])]
            first = taken.index(min(taken))
            taken[first] = max(taken[first], leaves_s)
        arrivals: list[tuple[float, int, int]] = []
        for uav in range(problem.n_uav):
            if lists[uav] and not (state.active[uav] and state.free_s[uav] < math.inf):
                flown[uav].refusal = FieldRefusal.INCAPABLE
            elif lists[uav]:
                self._fly_on(uav, lists[uav], flown[uav], arrivals)
        while arrivals:
            arrive_s, rank, uav = min(arrivals)
            arrivals.remove((arrive_s, rank, uav))
            one, items = flown[uav], lists[uav]
            base = -1 - items[len(one.times)]
            begin_s = arrive_s
            if base in slots:
                begin_s = max(begin_s, min(slots[base]) + float(problem.land_s[uav]))
            step = self.swap(uav, one.stand, base, begin_s)
            if isinstance(step, FieldRefusal) or math.isinf(begin_s):
                one.refusal = FieldRefusal.ENERGY
                self._go_home(uav, items, one)
                continue
            one.stand, times = step
            one.times.append(times)
            if base in slots:
                leaves_s = one.stand.time_s
                if len(one.times) < len(items):
                    leaves_s = self.departure_s(uav, one.stand, items[len(one.times)])
                slots[base][slots[base].index(min(slots[base]))] = leaves_s
            self._fly_on(uav, items, one, arrivals)
        return flown

    def _fly_on(
        self,
        uav: int,
        items: Sequence[int],
        one: Flown,
        arrivals: list[tuple[float, int, int]],
    ) -> None:
        while len(one.times) < len(items):
            item = items[len(one.times)]
            if item < 0:
                arrive_s = self.arrival_s(uav, one.stand, -1 - item)
                if math.isinf(arrive_s):
                    one.refusal = FieldRefusal.NO_WAY
                    break
                arrivals.append((arrive_s, int(self.state.rank[uav]), uav))
                return
            step = self.task(uav, one.stand, item)
            if isinstance(step, FieldRefusal):
                one.refusal = step
                break
            one.stand, times = step
            one.times.append(times)
        self._go_home(uav, items, one)

    def _go_home(self, uav: int, items: Sequence[int], one: Flown) -> None:
        if not one.times:
            return
        node = one.stand.node
        assert node is not None
        one.home = int(self.problem.home[uav, node])
        depart_s = one.stand.time_s
        one.home_s = (depart_s, depart_s + float(self.problem.home_s[uav, node]))


def greedy_step(plain: PlainField, uav: int, stand: Stand, open_tasks: Sequence[int]) -> int | None:
    """The item of the largest p·S·m·(until − end), of equals the smaller index; None: none."""
    problem = plain.problem
    best: tuple[float, int] | None = None
    for task in sorted(open_tasks):
        for item in (2 * task, 2 * task + 1)[: 1 + bool(problem.is_line[task])]:
            step = plain.task(uav, stand, item)
            if isinstance(step, FieldRefusal):
                continue
            weight = stand.survived * float(problem.weight[uav, task])
            score = weight * (float(problem.until_s[task]) - step[1][3])
            if best is None or score > best[0]:
                best = score, item
    return None if best is None else best[1]


def greedy_base(
    plain: PlainField,
    uav: int,
    lists: Sequence[Sequence[int]],
    here: int,
    open_tasks: Sequence[int],
) -> int | None:
    """The base to which greedy goes if it can do no task after what is on ``lists``; None: none.

    All ways over several bases are tried, and the one whose last is ready earliest is taken; one
    base goes before several. Others are known to do what is on their lists and no more.
    """
    bases = [base for base in range(plain.problem.n_base) if base != here]
    for n_swap in (1, len(bases)):
        found = []
        for count in range(1, n_swap + 1):
            for way in itertools.permutations(bases, count):
                flown = plain.fly(with_more(lists, uav, [-1 - base for base in way]))[uav]
                if flown.refusal is not FieldRefusal.NONE:
                    continue
                if greedy_step(plain, uav, flown.stand, open_tasks) is not None:
                    found.append((flown.stand.time_s, way[-1], way[0]))
        if found:
            return min(found)[2]
    return None


def with_more(
    lists: Sequence[Sequence[int]], uav: int, items: Sequence[int]
) -> list[Sequence[int]]:
    """``lists`` with ``items`` at the end of one."""
    return [[*own, *items] if row == uav else own for row, own in enumerate(lists)]


def best_lists(plain: PlainField) -> tuple[int, float]:
    """Required tasks left out by the best lists of all, and what those are worth.

    All tasks on all lists in all orders and directions, and before each any bases in any order,
    each at most once, but not the one at which the UAV stands.
    """
    problem = plain.problem
    best = (problem.n_task + 1, 0.0)
    for owners in itertools.product(range(-1, problem.n_uav), repeat=problem.n_task):
        owned = [
            [task for task, owner in enumerate(owners) if owner == uav]
            for uav in range(problem.n_uav)
        ]
        n_left_out = sum(
            bool(problem.required[task]) for task, owner in enumerate(owners) if owner < 0
        )
        if n_left_out > best[0]:
            continue
        for lists in itertools.product(*(_lists_of(plain, u, own) for u, own in enumerate(owned))):
            flown = plain.fly(lists)
            if all(one.refusal is FieldRefusal.NONE for one in flown):
                best = min(best, (n_left_out, -sum(one.stand.value for one in flown)))
    return best[0], -best[1]


def _lists_of(plain: PlainField, uav: int, tasks: Sequence[int]) -> list[tuple[int, ...]]:
    """All that can be flown while every slot is free, or that a wait for one might help."""
    problem = plain.problem
    few = problem.slots > 0
    visits = [
        way
        for count in range(problem.n_base + 1)
        for way in itertools.permutations(range(problem.n_base), count)
    ]
    found = []
    for order in itertools.permutations(tasks):
        ways = [(2 * task, 2 * task + 1)[: 1 + bool(problem.is_line[task])] for task in order]
        for items in itertools.product(*ways):
            for before in itertools.product(visits, repeat=len(order)):
                own: list[int] = []
                for way, item in zip(before, items, strict=True):
                    own += [*(-1 - base for base in way), item]
                at = int(plain.state.landed_at[uav])
                if own and at >= 0 and own[0] == -1 - at:
                    continue
                alone: list[Sequence[int]] = [()] * problem.n_uav
                if any(item < 0 and few[-1 - item] for item in own) or (
                    plain.fly(with_more(alone, uav, own))[uav].refusal is FieldRefusal.NONE
                ):
                    found.append(tuple(own))
    return found
