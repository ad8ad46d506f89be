"""Brute force over all assignments, lists, directions and base visits of tiny problems.

Best is: fewest tasks without due_s left out, then largest J. Before each task a list may visit up
to ``in_a_row`` bases, of which no two neighbours are the same. What is skipped can't matter:

- A list whose beginning can't be flown is not continued: every rule is checked item by item.
- A base without a limit of slots, or with a slot for every UAV, never makes anybody wait.
- Of the lists of one UAV with the same tasks that visit no other base, only the best is kept:
  they neither wait for others nor make others wait.
- A list that visits a base with few slots may be delayed there by others. Delays never make an end
  earlier nor a due time or window easier; so the list without its delays tells a bound of its
  value, and whether the windows can be met. Delays may save energy, though, as a later start waits
  less in the air; so behind such a base only the time really flown is held against the battery.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field, replace

from tests.support.field_oracle.flight import FlightTimes
from tests.support.field_oracle.scenario import FieldBase, FieldScenario, FieldTask, FieldUav
from tests.support.field_oracle.schedule import (
    Flight,
    Flown,
    Item,
    Refused,
    Swap,
    Work,
    do_task,
    reach_base,
    swap_there,
    take_off,
)
from tests.support.field_oracle.slots import fly_all, objective

ROUNDING = 1e-9
"""Sums of bounds are compared with so much to spare."""

Lists = dict[str, tuple[Item, ...]]


@dataclass(frozen=True, slots=True)
class Best:
    """The best that there is."""

    n_left_out: int
    """Tasks without due_s left out."""
    objective: float
    lists: Lists
    flights: dict[str, Flight]


@dataclass(slots=True)
class _Options:
    """The lists of one UAV with the same tasks."""

    alone: tuple[float, tuple[Item, ...]] | None = None
    """The best of those that nobody delays, with its value."""
    shared: list[tuple[float, tuple[Item, ...]]] = field(default_factory=list)
    """Those that others may delay, each with a bound of its value; largest first."""

    def all(self) -> list[tuple[float, tuple[Item, ...]]]:
        """Every list worth a look, largest bound first."""
        own = [] if self.alone is None else [self.alone]
        return sorted(own + self.shared, key=lambda option: -option[0])


@dataclass(slots=True)
class _Bar:
    """What the next plan must be worth more than."""

    value: float


def best_plan(
    scenario: FieldScenario,
    times: FlightTimes | None = None,
    *,
    in_a_row: int = 2,
    sequence: Sequence[str] | None = None,
) -> Best:
    """The best plan of all.

    Args:
        scenario: a tiny one: up to 6 tasks, up to 4 with bases.
        times: its legs, if they are at hand.
        in_a_row: so many bases at most between two tasks.
        sequence: decides about slots between arrivals at the same instant; the file's order if
            None.
    """
    times = times or FlightTimes(scenario)
    options = [_options(scenario, times, uav, in_a_row) for uav in scenario.uavs]
    required = {task.id for task in scenario.known if task.due_s is None}
    partitions = []
    for subsets in _partitions(options):
        done = frozenset().union(*subsets)
        bound = sum(own[s].all()[0][0] for own, s in zip(options, subsets, strict=True))
        partitions.append((len(required - done), -bound, subsets))
    partitions.sort(key=lambda each: each[:2])
    best: Best | None = None
    for n_left_out, negative_bound, subsets in partitions:
        if best is not None and (n_left_out, negative_bound) >= (best.n_left_out, -best.objective):
            break
        choices = [own[subset].all() for own, subset in zip(options, subsets, strict=True)]
        bar = _Bar(-math.inf)
        if best is not None and best.n_left_out == n_left_out:
            bar.value = best.objective
        for plan in _combinations(scenario, choices, bar):
            flights = fly_all(scenario, times, plan, sequence)
            value = objective(flights)
            if value is not None and value > bar.value:
                best = Best(n_left_out, value, plan, flights)
                bar.value = value
    if best is None:
        raise AssertionError("empty lists can always be flown")
    return best


def reasons_left_out(
    scenario: FieldScenario, times: FlightTimes, done: frozenset[str]
) -> dict[str, str]:
    """Why each known task that is not ``done`` was left out, in the words of the JSON."""
    reasons = {}
    for task in scenario.known:
        if task.id in done:
            continue
        if not any(can_do_alone(scenario, times, uav, task) for uav in scenario.uavs):
            reasons[task.id] = "nobody can"
        elif task.due_s is not None:
            reasons[task.id] = "due"
        elif task.closes_s < math.inf:
            reasons[task.id] = "window"
        else:
            reasons[task.id] = "energy"
    return reasons


def can_do_alone(
    scenario: FieldScenario, times: FlightTimes, uav: FieldUav, task: FieldTask
) -> bool:
    """Whether ``uav`` can do ``task`` as its only one, with as many swaps as it takes.

    From a base it departs as late as the opening allows, so that being there early never harms:
    the earliest readiness at every base is enough to look at.
    """
    ready = {uav.start.name: take_off(uav)}
    unseen = [uav.start.name]
    while unseen:
        unseen.sort(key=lambda name: ready[name].time_s)
        flown = ready[unseen.pop(0)]
        ways = (False, True) if task.is_line else (False,)
        for backwards in ways:
            step = do_task(scenario, times, uav, flown, Work(task.id, backwards))
            if not isinstance(step, Refused):
                return True
        for base, swapped in _swaps(scenario, times, uav, flown):
            known = ready.get(base.stop.name)
            if known is None or swapped.time_s < known.time_s:
                ready[base.stop.name] = swapped
                if base.stop.name not in unseen:
                    unseen.append(base.stop.name)
    return False


def _swaps(
    scenario: FieldScenario, times: FlightTimes, uav: FieldUav, flown: Flown
) -> Iterator[tuple[FieldBase, Flown]]:
    """Every base that can be visited next, and what is after the swap, without delay."""
    if uav.endurance_s == math.inf:
        return  # nothing to swap
    for base in scenario.bases:
        if flown.landed and base.stop.name == flown.here.name:
            continue
        reached = reach_base(times, uav, flown, base)
        if isinstance(reached, Refused):
            continue
        step = swap_there(uav, flown, *reached, base, reached[0].time_s)
        if not isinstance(step, Refused):
            yield base, step[0]


def _options(
    scenario: FieldScenario, times: FlightTimes, uav: FieldUav, in_a_row: int
) -> dict[frozenset[str], _Options]:
    """All lists of ``uav`` worth a look, by their tasks."""
    found: dict[frozenset[str], _Options] = {frozenset(): _Options(alone=(0.0, ()))}
    n_uavs = len(scenario.uavs)
    few = {base.id for base in scenario.bases if base.slots is not None and base.slots < n_uavs}

    def grow(flown: Flown, items: tuple[Item, ...], left: tuple[FieldTask, ...], row: int) -> None:
        delayed = any(isinstance(item, Swap) and item.base in few for item in items)
        for task in left:
            for backwards in (False, True) if task.is_line else (False,):
                work = Work(task.id, backwards)
                step = _work(scenario, times, uav, flown, work, delayed=delayed)
                if step is None:
                    continue
                longer = (*items, work)
                _keep(found, longer, step.value, delayed=delayed)
                grow(step, longer, tuple(t for t in left if t is not task), 0)
        if row < in_a_row and left:
            for base, swapped in _swaps(scenario, times, uav, flown):
                grow(swapped, (*items, Swap(base.id)), left, row + 1)

    grow(take_off(uav), (), scenario.known, 0)
    for options in found.values():
        options.shared.sort(key=lambda option: -option[0])
    return found


def _work(
    scenario: FieldScenario,
    times: FlightTimes,
    uav: FieldUav,
    flown: Flown,
    work: Work,
    *,
    delayed: bool,
) -> Flown | None:
    if not delayed:
        step = do_task(scenario, times, uav, flown, work)
        return None if isinstance(step, Refused) else step[0]
    # With an endless battery, and then the time really flown against the real one.
    endless = replace(flown, budget_s=math.inf)
    step = do_task(scenario, times, uav, endless, work)
    if isinstance(step, Refused):
        return None
    after, entry = step
    waited_s = entry.begin_s - entry.arrive_s
    home = times.home(uav, after.here)
    airborne_s = after.airborne_s - waited_s
    if home is None or airborne_s + home[1].time_s > flown.budget_s + 2e-6:
        return None
    return replace(after, airborne_s=airborne_s, budget_s=flown.budget_s)


def _keep(
    found: dict[frozenset[str], _Options],
    items: tuple[Item, ...],
    value: float,
    *,
    delayed: bool,
) -> None:
    tasks = frozenset(item.task for item in items if isinstance(item, Work))
    options = found.setdefault(tasks, _Options())
    if delayed:
        options.shared.append((value, items))
    elif options.alone is None or value > options.alone[0]:
        options.alone = (value, items)


def _partitions(
    options: Sequence[dict[frozenset[str], _Options]],
) -> Iterator[tuple[frozenset[str], ...]]:
    """Every choice of disjoint sets of tasks, one of each UAV."""
    if not options:
        yield ()
        return
    for rest in _partitions(options[1:]):
        taken = frozenset().union(*rest) if rest else frozenset()
        for subset in options[0]:
            if not subset & taken:
                yield (subset, *rest)


def _combinations(
    scenario: FieldScenario,
    choices: Sequence[list[tuple[float, tuple[Item, ...]]]],
    bar: _Bar,
    sure: float = 0.0,
) -> Iterator[Lists]:
    """Every choice of one list of each UAV whose bounds and ``sure`` together pass the bar."""
    if not choices:
        yield {}
        return
    *others, own = choices
    uav = scenario.uavs[len(others)]
    rest = sum(lists[0][0] for lists in others)
    for bound, items in own:
        if sure + bound + rest <= bar.value - ROUNDING:
            return
        for plan in _combinations(scenario, others, bar, sure + bound):
            yield {**plan, uav.id: items}
