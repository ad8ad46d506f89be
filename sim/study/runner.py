"""Flies the trials of a study: in this process, in several, or on a Dask cluster.

Workers of a cluster need the same version of this package. They get jobs in small chunks, each
with all that it needs, so that a worker that is lost costs a chunk, which Dask gives to another.
"""

from __future__ import annotations

import logging
import multiprocessing
import os
import platform
import re
import signal
import threading
import warnings
from collections.abc import Callable, Generator, Iterator, Sequence
from concurrent.futures import FIRST_COMPLETED, CancelledError, Future, ProcessPoolExecutor, wait
from concurrent.futures.process import BrokenProcessPool
from contextlib import closing, contextmanager
from itertools import islice
from typing import Any

import swarm
from sim.study.store import RowStore
from sim.study.trial import TrialContext, TrialJob, TrialRow, TrialRunner
from swarm.runtime.clock import SystemClock
from swarm.runtime.errors import Fault, InputError, SwarmError
from swarm.runtime.extras import require_extra
from swarm.scenario.findings import printable

Fly = Callable[[TrialContext, Sequence[TrialJob]], Generator[list[TrialRow]]]
"""Flies jobs and yields the rows of each as soon as it is done, in any order. Closing it gives
up what is left."""


_JOBS_AHEAD = 3
"""Jobs handed out per process, so that none waits for the next one."""


def run_study(
    briefing: TrialContext, store: RowStore, fly: Fly, progress: Callable[[int, int], None]
) -> list[TrialRow]:
    """Fly what ``store`` does not have yet; all rows, sorted by point, trial and policy.

    The store is told the rows of each job as it is done, so that an interruption loses little.
    ``progress`` is told the jobs done and their total, at the beginning and after each.
    """
    jobs = store.missing()
    progress(0, len(jobs))
    if jobs:
        with closing(fly(briefing, jobs)) as flown:
            for done, rows in enumerate(flown, start=1):
                store.add(rows)
                progress(done, len(jobs))
    return store.finish()


def fly_here(briefing: TrialContext, jobs: Sequence[TrialJob]) -> Generator[list[TrialRow]]:
    """Fly the jobs in this process."""
    runner = TrialRunner(briefing, SystemClock())
    for job in jobs:
        yield runner.fly(job)


def in_processes(count: int) -> Fly:
    """Flies jobs in ``count`` processes of this machine."""

    def fly(briefing: TrialContext, jobs: Sequence[TrialJob]) -> Generator[list[TrialRow]]:
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
            yield from _flown_in_processes(executor, jobs, _JOBS_AHEAD * count)
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


def _flown_in_processes(
    executor: ProcessPoolExecutor, jobs: Sequence[TrialJob], ahead: int
) -> Generator[list[TrialRow]]:
    waiting = iter(jobs)
    flying: set[Future[list[TrialRow]]] = set()
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


def _begin_worker(briefing: TrialContext) -> None:
    global _runner
    threading.Thread(target=_end_with_parent, daemon=True).start()
    _runner = TrialRunner(briefing, SystemClock())


def _fly_in_worker(job: TrialJob) -> list[TrialRow]:
    if _runner is None:
        raise RuntimeError("the worker has not begun")
    return _runner.fly(job)


def _end_with_parent() -> None:
    """A worker whose parent was killed would wait for jobs for ever."""
    parent = multiprocessing.parent_process()
    if parent is not None:
        parent.join()
        os._exit(1)


CONNECT_TIMEOUT_S = 10.0
_CHUNKS_PER_THREAD = 8
_LARGEST_CHUNK = 16
_CHUNKS_AHEAD = 2
"""Chunks handed out per thread of the cluster, so that none waits for the next one."""
_RETRIES = 3
_ADDRESS = re.compile(r"((tcp|tls|ws|wss)://)?([^\s/:\[\]]+|\[[0-9a-fA-F:.]+\]):[0-9]{1,5}")
_RIGHT_ADDRESS = "give the address that 'dask scheduler' prints, such as tcp://10.0.0.1:8786"
_OPTION = "--scheduler"
_LOGGERS = ("distributed", "distributed.client")
"""Those that Dask gives levels of their own."""


def on_dask(address: str, timeout_s: float = CONNECT_TIMEOUT_S) -> Fly:
    """Flies jobs on the cluster whose scheduler is at ``address``, such as tcp://10.0.0.1:8786.

    The flying raises InputError where there is no such cluster or it cannot do the work, and
    SwarmError when it is lost.
    """

    def fly(briefing: TrialContext, jobs: Sequence[TrialJob]) -> Generator[list[TrialRow]]:
        if _ADDRESS.fullmatch(address) is None:
            raise InputError(Fault(_OPTION, printable(address), "is no address", _RIGHT_ADDRESS))
        with _client(address, timeout_s) as client:
            threads = _threads_ready(client, address, timeout_s)
            yield from _flown_on_cluster(client, briefing, jobs, threads)

    return fly


@contextmanager
def _client(address: str, timeout_s: float) -> Iterator[Any]:
    require_extra("study", _OPTION)
    import distributed

    with warnings.catch_warnings(), _silent(*_LOGGERS):
        # The versions that matter here are compared below.
        warnings.simplefilter("ignore", distributed.versions.VersionMismatchWarning)
        try:
            client = distributed.Client(address, timeout=timeout_s, set_as_default=False)
        except (OSError, ValueError) as error:
            fault = Fault(_OPTION, address, "no Dask scheduler answers there", _RIGHT_ADDRESS)
            raise InputError(fault) from error
        try:
            yield client
        finally:
            client.close(timeout=timeout_s)


@contextmanager
def _silent(*loggers: str) -> Iterator[None]:
    """What goes wrong is told in one line, without the tracebacks that Dask logs besides."""
    levels = {name: logging.getLogger(name).level for name in loggers}
    for name in loggers:
        logging.getLogger(name).setLevel(logging.CRITICAL)
    try:
        yield
    finally:
        for name, level in levels.items():
            logging.getLogger(name).setLevel(level)


def _threads_ready(client: Any, address: str, timeout_s: float) -> int:
    """Threads of the cluster's workers, once it has some with the same package."""
    try:
        client.wait_for_workers(1, timeout=timeout_s)
        found: dict[str, str] = client.run(_installed)
    except TimeoutError as error:
        fault = Fault(_OPTION, address, "the cluster has no workers", "start a 'dask worker' there")
        raise InputError(fault) from error
    except ImportError as error:
        remedy = f"install peckorder {swarm.__version__} where the workers run"
        raise InputError(Fault(_OPTION, address, f"a worker lacks {error.name}", remedy)) from error
    here = _installed()
    for worker, there in found.items():
        if there != here:
            problem = f"worker {worker} has {there}, and this is {here}"
            raise InputError(Fault(_OPTION, address, problem, "use the same versions everywhere"))
    threads: dict[str, int] = client.nthreads()
    return max(1, sum(threads.values()))


def _flown_on_cluster(
    client: Any, briefing: TrialContext, jobs: Sequence[TrialJob], threads: int
) -> Generator[list[TrialRow]]:
    from distributed import as_completed
    from distributed.scheduler import KilledWorker

    size = min(max(len(jobs) // (_CHUNKS_PER_THREAD * threads), 1), _LARGEST_CHUNK)
    waiting = iter([jobs[at : at + size] for at in range(0, len(jobs), size)])

    def submit(count: int) -> list[Any]:
        return [
            client.submit(_fly_chunk, briefing, list(chunk), pure=False, retries=_RETRIES)
            for chunk in islice(waiting, count)
        ]

    flying = as_completed(submit(_CHUNKS_AHEAD * threads), loop=client.loop)
    try:
        for future in flying:
            flown: list[list[TrialRow]] = future.result()
            future.release()
            for more in submit(1):
                flying.add(more)
            yield from flown
    except KilledWorker as error:
        problem = "workers of the cluster died again and again at the same trials"
        raise SwarmError(f"{problem}; with --out what is done is kept") from error
    except (CancelledError, OSError) as error:
        problem = "the Dask cluster was lost; with --out what is done is kept"
        raise SwarmError(f"{problem}, and the same command goes on") from error
    finally:
        client.cancel(list(flying.futures))


# -- on a worker ----------------------------------------------------------------------------


def _installed() -> str:
    """What has to be the same for the same numbers to come out."""
    return f"peckorder {swarm.__version__} on Python {platform.python_version()}"


def _fly_chunk(briefing: TrialContext, jobs: Sequence[TrialJob]) -> list[list[TrialRow]]:
    runner = TrialRunner(briefing, SystemClock())
    return [runner.fly(job) for job in jobs]
