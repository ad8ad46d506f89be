"""Many random cases, on several processors, until one breaks an invariant.

Leaves out: how it is shown (sim.faults.cli).
"""

from __future__ import annotations

import itertools
import multiprocessing
from collections.abc import Callable, Sequence
from concurrent.futures import FIRST_COMPLETED, Future, ProcessPoolExecutor, wait
from dataclasses import dataclass
from functools import partial

from sim.faults.case import Case, play
from sim.faults.generator import random_case
from sim.faults.schedule import Kind
from sim.faults.shrink import shrink
from sim.faults.transcript import Broken

__all__ = ["Breach", "first_breach", "shrunk", "soak"]

BLOCK = 20
"""Seeds a worker plays between two reports."""


@dataclass(frozen=True, slots=True)
class Breach:
    """A case and what it breaks."""

    case: Case
    broken: Broken


def first_breach(seeds: Sequence[int], kinds: Sequence[Kind], bug: str = "") -> Breach | None:
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
    kinds: Sequence[Kind],
    *,
    bug: str = "",
    progress: Callable[[int], None] = lambda _: None,
) -> Breach | None:
    """Play that many random cases, up to the first one that breaks an invariant.

    Args:
        first: the first seed.
        seeds: how many.
        jobs: processes that play them.
        kinds: what may go wrong.
        bug: a protocol bug put in on purpose; see `sim.faults.bugs`.
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
