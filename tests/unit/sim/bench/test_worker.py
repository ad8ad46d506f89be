from __future__ import annotations

import json
from dataclasses import asdict
from pathlib import Path

import pytest

from sim.bench.worker import (
    HORIZON_SHARE,
    Answer,
    Job,
    Source,
    do,
    do_in_subprocess,
    main,
    problem_of,
)
from sim.study.baselines.value_per_time import makespan_s, value_per_time
from swarm.clock import SystemClock
from swarm.errors import SwarmError
from swarm.scenario.shipped import resolve_scenario

SMALL = Source(n_uav=3, n_task=9, seed=4)


def check(answer: Answer) -> None:
    assert sorted(task for route in answer.routes for task in route) == list(range(9))
    assert answer.elapsed_s >= 0.0
    assert answer.peak_bytes >= answer.base_bytes > 2**20


def test_random_missions_end_well_before_their_horizon() -> None:
    problem = problem_of(SMALL)
    assert problem.n_uav == 3
    longest_s = makespan_s(problem, value_per_time(problem))
    assert problem.horizon_s == pytest.approx(HORIZON_SHARE * longest_s)
    assert problem_of(Source(n_uav=3, n_task=9, seed=4, horizon_s=77.0)).horizon_s == 77.0


def test_scenarios_are_read_without_their_pop_ups() -> None:
    path = resolve_scenario("valley-popups")
    problem = problem_of(Source(scenario=str(path)))
    assert 0 < problem.n_task < Path(path).read_text().count("[[task]]")


def test_a_job_is_done_here_or_in_a_process_of_its_own() -> None:
    job = Job(SMALL, "value-per-time", 1.0, 0)
    here, there = do(job, SystemClock()), do_in_subprocess(job)
    check(here)
    check(there)
    assert here.routes == there.routes


def test_jobs_and_answers_are_json() -> None:
    said: list[str] = []
    job = json.dumps(asdict(Job(SMALL, "guided", 0.05, 0)))
    assert main(lambda: job, said.append) == 0
    fields = json.loads("".join(said))
    assert fields["trace"]
    check(Answer(**fields))


def test_an_interrupted_job_ends_quietly(monkeypatch: pytest.MonkeyPatch) -> None:
    def interrupt(job: Job, clock: SystemClock) -> Answer:
        raise KeyboardInterrupt

    monkeypatch.setattr("sim.bench.worker.do", interrupt)
    said: list[str] = []
    job = json.dumps(asdict(Job(SMALL, "guided", 0.05, 0)))
    assert main(lambda: job, said.append) == 130
    assert said == []


def test_a_job_that_fails_says_why_in_one_line() -> None:
    with pytest.raises(SwarmError, match=r"method nearest failed: .*no-such-file") as caught:
        do_in_subprocess(Job(Source(scenario="/no-such-file.toml"), "nearest", 1.0, 0))
    assert "\n" not in str(caught.value)


def test_a_job_that_does_not_end_is_ended(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("sim.bench.worker._GRACE_S", 0.0)
    with pytest.raises(SwarmError, match="method nearest was ended after 0 s"):
        do_in_subprocess(Job(SMALL, "nearest", 1e-3, 0))
