"""Flies the trials of a study on a Dask cluster, where they outgrow one machine.

Workers need the same version of this package. Jobs are sent in small chunks, each with all that
it needs, so that a worker that is lost costs a chunk, which Dask gives to another one. Leaves
out: starting a cluster (``dask scheduler``, ``dask worker``).
"""

from __future__ import annotations

import logging
import platform
import re
import warnings
from collections.abc import Generator, Iterator, Sequence
from concurrent.futures import CancelledError
from contextlib import contextmanager
from itertools import islice
from typing import Any

import swarm
from sim.study.rows import Row
from sim.study.runner import Fly
from sim.study.trial import Briefing, Job, TrialRunner
from swarm.clock import SystemClock
from swarm.errors import Fault, InputError, SwarmError
from swarm.scenario.findings import printable

__all__ = ["on_dask"]

CONNECT_TIMEOUT_S = 10.0
_CHUNKS_PER_THREAD = 8
_LARGEST_CHUNK = 16
_AHEAD = 2
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

    def fly(briefing: Briefing, jobs: Sequence[Job]) -> Generator[list[Row]]:
        if _ADDRESS.fullmatch(address) is None:
            raise InputError(Fault(_OPTION, printable(address), "is no address", _RIGHT_ADDRESS))
        with _client(address, timeout_s) as client:
            threads = _threads_ready(client, address, timeout_s)
            yield from _flown_by(client, briefing, jobs, threads)

    return fly


@contextmanager
def _client(address: str, timeout_s: float) -> Iterator[Any]:
    try:
        import distributed
    except ImportError as error:
        remedy = "install it with: pip install 'peckorder[study]'"
        raise InputError(Fault(_OPTION, address, "needs Dask's distributed", remedy)) from error
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


def _flown_by(
    client: Any, briefing: Briefing, jobs: Sequence[Job], threads: int
) -> Generator[list[Row]]:
    from distributed import as_completed
    from distributed.scheduler import KilledWorker

    size = min(max(len(jobs) // (_CHUNKS_PER_THREAD * threads), 1), _LARGEST_CHUNK)
    waiting = iter([jobs[at : at + size] for at in range(0, len(jobs), size)])

    def submit(count: int) -> list[Any]:
        return [
            client.submit(_fly_chunk, briefing, list(chunk), pure=False, retries=_RETRIES)
            for chunk in islice(waiting, count)
        ]

    flying = as_completed(submit(_AHEAD * threads), loop=client.loop)
    try:
        for future in flying:
            flown: list[list[Row]] = future.result()
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


def _fly_chunk(briefing: Briefing, jobs: Sequence[Job]) -> list[list[Row]]:
    runner = TrialRunner(briefing, SystemClock())
    return [runner.fly(job) for job in jobs]
