"""Flies the trials of a study, in this process or in several, and keeps what comes.

Leaves out: other machines (sim.study.dask_cluster).
"""

from __future__ import annotations

import multiprocessing
import os
import signal
import threading
from collections.abc import Callable, Generator, Iterator, Sequence
from concurrent.futures import FIRST_COMPLETED, Future, ProcessPoolExecutor, wait
from concurrent.futures.process import BrokenProcessPool
from contextlib import closing, contextmanager

from sim.study.rows import Row
from sim.study.store import Store
from sim.study.trial import Briefing, Job, TrialRunner
from swarm.clock import SystemClock
from swarm.errors import SwarmError

__all__ = ["Fly", "fly_here", "in_processes", "run_study"]

Fly = Callable[[Briefing, Sequence[Job]], Generator[list[Row]]]
"""Flies jobs and yields the rows of each as soon as it is done, in any order. Closing it gives
up what is left."""

_AHEAD = 3
"""Jobs handed out per process, so that none waits for the next one."""


def run_study(
    briefing: Briefing, store: Store, fly: Fly, progress: Callable[[int, int], None]
) -> list[Row]:
    """Fly what ``store`` does not have yet.

    Args:
        briefing: the study.
        store: told the rows of each job as it is done, so that an interruption loses little.
        fly: where the jobs are flown.
        progress: told the jobs done and their total, at the beginning and after each.

    Returns:
        All rows, sorted by point, trial and policy.
    """
    jobs = store.missing()
    progress(0, len(jobs))
    if jobs:
        with closing(fly(briefing, jobs)) as flown:
            for done, rows in enumerate(flown, start=1):
                store.add(rows)
                progress(done, len(jobs))
    return store.finish()


def fly_here(briefing: Briefing, jobs: Sequence[Job]) -> Generator[list[Row]]:
    """Fly the jobs in this process."""
    runner = TrialRunner(briefing, SystemClock())
    for job in jobs:
        yield runner.fly(job)


def in_processes(count: int) -> Fly:
    """Flies jobs in ``count`` processes of this machine."""

    def fly(briefing: Briefing, jobs: Sequence[Job]) -> Generator[list[Row]]:
        if count == 1 or len(jobs) == 1:
            yield from fly_here(briefing, jobs)
            return
        before = {child.pid for child in multiprocessing.active_children()}
        executor = ProcessPoolExecutor(
            min(count, len(jobs)),
            mp_context=multiprocessing.get_context("spawn"),
            initializer=_begin_worker,
            initargs=(briefing,),
        )
        try:
            yield from _flown_by(executor, jobs, _AHEAD * count)
        except BrokenProcessPool as error:
            raise SwarmError(
                "a process that flew trials died, perhaps of too little memory: fewer --jobs need "
                "less; with --out what is done is kept, and the same command goes on"
            ) from error
        finally:
            for child in multiprocessing.active_children():
                if child.pid not in before:
                    child.terminate()
            executor.shutdown(cancel_futures=True)

    return fly


def _flown_by(
    executor: ProcessPoolExecutor, jobs: Sequence[Job], ahead: int
) -> Generator[list[Row]]:
    waiting = iter(jobs)
    flying: set[Future[list[Row]]] = set()
    while True:
        with _children_without_sigint():
            for job in waiting:
                flying.add(executor.submit(_fly_in_worker, job))
                if len(flying) >= ahead:
                    break
        if not flying:
            return
        done, flying = wait(flying, return_when=FIRST_COMPLETED)
        for future in done:
            yield future.result()


@contextmanager
def _children_without_sigint() -> Iterator[None]:
    """Ctrl-C reaches all processes of a terminal; those started meanwhile leave it to this one.

    They inherit that the signal is blocked, from their first moment on.
    """
    before = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})
    try:
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, before)


# -- in a worker ----------------------------------------------------------------------------

_runner: TrialRunner | None = None
"""Of a worker process; it has one study to fly for, and keeps plans from trial to trial."""


def _begin_worker(briefing: Briefing) -> None:
    global _runner
    threading.Thread(target=_end_with_parent, daemon=True).start()
    _runner = TrialRunner(briefing, SystemClock())


def _fly_in_worker(job: Job) -> list[Row]:
    if _runner is None:
        raise RuntimeError("the worker has not begun")
    return _runner.fly(job)


def _end_with_parent() -> None:
    """A worker whose parent was killed would wait for jobs for ever."""
    parent = multiprocessing.parent_process()
    if parent is not None:
        parent.join()
        os._exit(1)
