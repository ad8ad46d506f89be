"""Studies flown by several processes: the same numbers, and clean ends."""

from __future__ import annotations

import logging
import multiprocessing
import os
import signal
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest
from distributed import LocalCluster

from sim.study.design import Factor, RandomMissions, Study
from sim.study.policies.roster import ROSTER, PolicyRoster
from sim.study.runner import Fly, fly_here, in_processes, on_dask, run_study
from sim.study.store import RowStore, read_rows
from sim.study.trial import TrialContext, TrialRow, jobs_of
from sim.world.uncertainty import Uncertainty
from swarm.runtime.errors import InputError, SwarmError
from tests.process.mission import wait_until
from tests.support.fake_policies import FAKES
from tests.support.study_rows import without_wall_times

pytestmark = pytest.mark.process

STUDY = Study(
    name="test",
    missions=RandomMissions(3, 6),
    policies=("guided", "cbba", "nearest"),
    trials=3,
    uncertainty=Uncertainty(loss=0.3, popup=0.3, message_loss=0.1, speed_sd_frac=0.1),
    varied=(Factor("popup", (0.6,), trials=2),),
)


def flown(fly: Fly, study: Study = STUDY, roster: PolicyRoster = ROSTER) -> list[TrialRow]:
    rows = run_study(TrialContext(study, roster), RowStore(study), fly, lambda *_: None)
    return [without_wall_times(row) for row in rows]


@pytest.fixture(scope="module")
def numbers() -> list[TrialRow]:
    """What one process finds."""
    return flown(fly_here)


def test_numbers_are_the_same_with_one_process_and_with_two(numbers: list[TrialRow]) -> None:
    assert flown(in_processes(2)) == numbers
    assert not multiprocessing.active_children()


def test_death_of_a_process_is_told_and_ends_the_others() -> None:
    study = Study("test", RandomMissions(2, 3), ("deadly",), trials=4)

    with pytest.raises(SwarmError, match="a process that flew trials died"):
        flown(in_processes(2), study, FAKES)

    assert not multiprocessing.active_children()


def children(pid: int) -> list[int]:
    listed = (Path("/proc") / str(pid) / "task" / str(pid) / "children").read_text()
    return [int(child) for child in listed.split()]


def alive(pid: int) -> bool:
    try:
        state = (Path("/proc") / str(pid) / "stat").read_text().rsplit(")", 1)[1].split()[0]
    except (FileNotFoundError, ProcessLookupError):
        return False
    return state != "Z"


@pytest.mark.parametrize("ending", [signal.SIGINT, signal.SIGKILL])
def test_study_that_is_ended_keeps_what_is_done_and_leaves_no_process(
    ending: signal.Signals, tmp_path: Path
) -> None:
    rows = tmp_path / "trials.csv"
    options = ["--trials", "100000", "--policies", "nearest", "--no-bound", "--jobs", "2"]
    with subprocess.Popen(
        [sys.executable, "-m", "swarm", "study", "meadow", "--out", str(tmp_path), *options],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        start_new_session=True,
    ) as process:
        try:
            wait_until(
                lambda: rows.exists() and len(rows.read_text().splitlines()) > 5, 60.0, "trials"
            )
            helpers = children(process.pid)
            if ending is signal.SIGINT:
                os.killpg(process.pid, ending)  # as a terminal does
            else:
                process.kill()
            out, err = process.communicate(timeout=20)
        finally:
            process.kill()

    assert len(helpers) >= 2
    wait_until(lambda: not any(map(alive, helpers)), 10.0, "the end of all processes")
    assert len(read_rows(rows)) >= 4
    assert out == ""
    if ending is signal.SIGINT:
        assert process.returncode == 130
        assert err.splitlines()[-1].startswith("interrupted after ")
        assert "Traceback" not in err


# -- Dask -----------------------------------------------------------------------------------


def dask_cluster(workers: int) -> LocalCluster:
    """A scheduler in this process, on loopback, and workers in processes of their own."""
    return LocalCluster(
        n_workers=workers,
        threads_per_worker=1,
        processes=True,
        host="127.0.0.1",
        dashboard_address="127.0.0.1:0",
        scheduler_kwargs={"dashboard": False},
        silence_logs=logging.CRITICAL,
    )


@pytest.fixture(scope="module")
def cluster() -> Iterator[LocalCluster]:
    with dask_cluster(2) as two:
        yield two
    assert not multiprocessing.active_children()


def test_numbers_are_the_same_on_a_dask_cluster(
    cluster: LocalCluster, numbers: list[TrialRow]
) -> None:
    assert flown(on_dask(cluster.scheduler_address)) == numbers


def test_lost_worker_of_a_dask_cluster_costs_nothing(cluster: LocalCluster) -> None:
    fly = on_dask(cluster.scheduler_address)
    rows: list[list[TrialRow]] = []
    jobs = jobs_of(STUDY)
    flying = fly(TrialContext(STUDY, ROSTER), jobs)
    rows.append(next(flying))
    os.kill(next(iter(cluster.workers.values())).pid, signal.SIGKILL)
    rows += flying

    assert len(rows) == len(jobs)


def test_address_without_a_scheduler_is_one_clear_line() -> None:
    with pytest.raises(InputError) as caught:
        flown(on_dask("tcp://127.0.0.1:9", timeout_s=0.5))

    assert str(caught.value) == (
        "--scheduler: tcp://127.0.0.1:9: no Dask scheduler answers there; give the address that "
        "'dask scheduler' prints, such as tcp://10.0.0.1:8786"
    )


def test_cluster_without_workers_is_one_clear_line() -> None:
    with dask_cluster(0) as empty, pytest.raises(InputError) as caught:
        flown(on_dask(empty.scheduler_address, timeout_s=0.5))

    assert str(caught.value).endswith("the cluster has no workers; start a 'dask worker' there")
