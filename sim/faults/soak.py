"""Many random cases, on several processors, until one breaks an invariant; then it is shrunk.

The smallest case that breaks the same invariant is found so: first faults are left out (delta
debugging), then tasks and UAVs, then what is left is made rounder, shorter and milder; over and
over, until nothing more goes.
"""

from __future__ import annotations

import itertools
import multiprocessing
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import FIRST_COMPLETED, Future, ProcessPoolExecutor, wait
from dataclasses import dataclass, replace
from functools import partial

from sim.faults.case import Case, play
from sim.faults.generator import random_case
from sim.faults.message_log import Violation
from sim.faults.schedule import Disturbance, DisturbanceKind, shape_of
from sim.world.network import Topology
from sim.world.settings import RestartMemory

BLOCK = 20
"""Seeds a worker plays between two reports."""


@dataclass(frozen=True, slots=True)
class Breach:
    """A case and what it breaks."""

    case: Case
    broken: Violation


def first_breach(
    seeds: Sequence[int], kinds: Sequence[DisturbanceKind], bug: str = ""
) -> Breach | None:
    """The first of ``seeds`` whose case breaks an invariant; None if none does."""
    for seed in seeds:
        verdict = play(random_case(seed, kinds, bug))
        if verdict.broken is not None:
            return Breach(verdict.case, verdict.broken)
    return None


def soak(
    first: int,
    seeds: int,
    jobs: int,
    kinds: Sequence[DisturbanceKind],
    *,
    bug: str = "",
    progress: Callable[[int], None] = lambda _: None,
) -> Breach | None:
    """Play that many random cases in ``jobs`` processes, up to the first that breaks an invariant.

    Args:
        first: the first seed.
        seeds: how many.
        jobs: processes that play them.
        kinds: what may go wrong.
        bug: a bug put in on purpose; see `sim.faults.planted_bugs`.
        progress: called with the number of cases played since it was last called.

    Returns:
        What broke, of the smallest seed known by then; None if nothing did.
    """
    end = first + seeds
    blocks = [range(start, min(start + BLOCK, end)) for start in range(first, end, BLOCK)]
    if jobs == 1:
        for block in blocks:
            breach = first_breach(block, kinds, bug)
            if breach is not None:
                return breach
            progress(len(block))
        return None
    # Spawned, since the parent may have threads that draw on its terminal.
    context = multiprocessing.get_context("spawn")
    with ProcessPoolExecutor(jobs, mp_context=context) as workers:
        play_block = partial(first_breach, kinds=kinds, bug=bug)
        running: dict[Future[Breach | None], range] = {}
        found: list[Breach] = []
        waiting = iter(blocks)
        while not found:
            for block in itertools.islice(waiting, 2 * jobs - len(running)):
                running[workers.submit(play_block, block)] = block
            if not running:
                return None
            for done in wait(running, return_when=FIRST_COMPLETED).done:
                breach = done.result()
                if breach is not None:
                    found.append(breach)
                progress(len(running.pop(done)))
        for future in running:
            future.cancel()
        return min(found, key=lambda breach: breach.case.seed)


def shrunk(breach: Breach) -> Breach:
    """The smallest case found that breaks the same invariant."""
    invariant = breach.broken.invariant

    def still_breaks(case: Case) -> bool:
        broken = play(case).broken
        return broken is not None and broken.invariant == invariant

    case = shrink(breach.case, still_breaks)
    broken = play(case).broken
    return breach if broken is None else Breach(case, broken)


def shrink(case: Case, still_breaks: Callable[[Case], bool], most_plays: int = 600) -> Case:
    """The smallest case found, in at most so many plays, that ``still_breaks`` as ``case`` does."""
    plays = 0

    def smaller(found: Case, candidates: Iterator[Case]) -> Case | None:
        nonlocal plays
        for candidate in candidates:
            if plays >= most_plays:
                return None
            plays += 1
            if candidate != found and still_breaks(candidate):
                return candidate
        return None

    while True:
        for ways in (_fewer_faults, _smaller_fleets, _milder_faults):
            better = smaller(case, ways(case))
            if better is not None:
                case = better
                break
        else:
            return case


def _fewer_faults(case: Case) -> Iterator[Case]:
    """Without one half of the faults, a quarter, and so on down to each single one."""
    schedule, size = case.schedule, (len(case.schedule) + 1) // 2
    while size:
        for start in range(0, len(schedule), size):
            yield replace(case, schedule=schedule[:start] + schedule[start + size :])
        size //= 2


def _smaller_fleets(case: Case) -> Iterator[Case]:
    """Fewer tasks, UAVs and pop-ups, as far as the faults do not name them; a plainer setting."""
    if case.mission is None:
        named = {name for each in case.schedule for name in each.names}
        for tasks in _fewer(case.tasks):
            if not any(f"t{number}" in named for number in range(tasks, case.tasks)):
                yield replace(case, tasks=tasks, popups=min(case.popups, tasks))
        for uavs in _fewer(case.uavs):
            if not any(f"u{number}" in named for number in range(uavs, case.uavs)):
                yield replace(case, uavs=uavs)
        for popups in _fewer(case.popups + 1):
            yield replace(case, popups=popups - 1)
    if case.standby and not any("standby" in each.names for each in case.schedule):
        yield replace(case, standby=False)
    if case.loss_frac:
        yield replace(case, loss_frac=0.0)
    if case.astray_m:
        yield replace(case, astray_m=0.0)
    if case.method != "greedy":
        yield replace(case, method="greedy")
    if case.topology is not Topology.ROUTER:
        yield replace(case, topology=Topology.ROUTER)


def _fewer(count: int) -> Sequence[int]:
    """Smaller counts, from the smallest on."""
    return sorted({1, count // 2, count - 1} - {0, count})


def _milder_faults(case: Case) -> Iterator[Case]:
    for index, fault in enumerate(case.schedule):
        for milder in _milder(fault):
            changed = (*case.schedule[:index], milder, *case.schedule[index + 1 :])
            yield replace(case, schedule=tuple(sorted(changed, key=lambda each: each.at_s)))


def _milder(fault: Disturbance) -> Iterator[Disturbance]:
    """The same kind of fault, simpler to think about; each of these ends somewhere."""
    if shape_of(fault.kind).names == "group" and len(fault.names) > 1:
        for name in fault.names:
            yield replace(fault, names=tuple(each for each in fault.names if each != name))
    if fault.kind is DisturbanceKind.CRASH and fault.lasts_s is not None:
        yield replace(fault, lasts_s=None, memory=None)
    if fault.memory not in (None, RestartMemory.DISK):
        yield replace(fault, memory=RestartMemory.DISK)
    if fault.lasts_s is not None:
        for lasts_s in _rounder(fault.lasts_s):
            yield replace(fault, lasts_s=lasts_s)
        if fault.lasts_s > 1.0:
            yield replace(fault, lasts_s=float(int(fault.lasts_s / 2.0 + 0.5)))
    for at_s in _rounder(fault.at_s):
        yield replace(fault, at_s=at_s)
    if fault.amount is not None:
        for amount in _rounder(fault.amount):
            yield replace(fault, amount=amount)


def _rounder(number: float) -> Iterator[float]:
    """That number with fewer digits, if it has any to spare, and not 0."""
    for digits in (0, 1):
        rounded = round(number, digits)
        if rounded not in (number, 0.0):
            yield rounded
