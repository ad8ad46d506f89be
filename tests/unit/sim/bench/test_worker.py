from __future__ import annotations

import json
from dataclasses import asdict
from pathlib import Path

import pytest

from sim.bench.solvers import (
    HORIZON_SHARE,
    MissionSource,
    PlanningJob,
    PlanningRun,
    main,
    problem_of,
    run_in_subprocess,
    run_job,
)
from sim.study.baselines.index_rules import makespan_s, value_per_time
from swarm.runtime.clock import SystemClock
from swarm.runtime.errors import SwarmError
from swarm.scenario.files import resolve_scenario

SMALL = MissionSource(n_uav=3, n_task=9, seed=4)


def check(answer: PlanningRun) -> None:
    assert sorted(task for route in answer.routes for task in route) == list(range(9))
    assert answer.elapsed_s >= 0.0
    assert answer.peak_bytes >= answer.base_bytes > 2**20


def test_random_missions_end_well_before_their_horizon() -> None:
    problem = problem_of(SMALL)
    assert problem.n_uav == 3
    longest_s = makespan_s(problem, value_per_time(problem))
    assert problem.horizon_s == pytest.approx(HORIZON_SHARE * longest_s)
    assert problem_of(MissionSource(n_uav=3, n_task=9, seed=4, horizon_s=77.0)).horizon_s == 77.0


def test_scenarios_are_read_without_their_pop_ups() -> None:
    path = resolve_scenario("valley-popups")
    problem = problem_of(MissionSource(scenario=str(path)))
    assert 0 < problem.n_task < Path(path).read_text().count("[[task]]")


def test_a_job_is_done_here_or_in_a_process_of_its_own() -> None:
    job = PlanningJob(SMALL, "value-per-time", 1.0, 0)
    here, there = run_job(job, SystemClock()), run_in_subprocess(job)
    check(here)
    check(there)
    assert here.routes == there.routes


def test_jobs_and_answers_are_json() -> None:
    said: list[str] = []
    job = json.dumps(asdict(PlanningJob(SMALL, "guided", 0.05, 0)))
    assert main(lambda: job, said.append) == 0
    fields = json.loads("".join(said))
    assert fields["trace"]
    check(PlanningRun(**fields))


def test_an_interrupted_job_ends_quietly(monkeypatch: pytest.MonkeyPatch) -> None:
    def interrupt(job: PlanningJob, clock: SystemClock) -> PlanningRun:
        raise KeyboardInterrupt

    monkeypatch.setattr("sim.bench.solvers.run_job", interrupt)
    said: list[str] = []
    job = json.dumps(asdict(PlanningJob(SMALL, "guided", 0.05, 0)))
    assert main(lambda: job, said.append) == 130
    assert said == []


def test_a_job_that_fails_says_why_in_one_line() -> None:
    with pytest.raises(SwarmError, match=r"method nearest failed: .*no-such-file") as caught:
        run_in_subprocess(
            PlanningJob(MissionSource(scenario="/no-such-file.toml"), "nearest", 1.0, 0)
        )
    assert "\n" not in str(caught.value)


def test_a_job_that_does_not_end_is_ended(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("sim.bench.solvers._GRACE_S", 0.0)
    with pytest.raises(SwarmError, match="method nearest was ended after 0 s"):
        run_in_subprocess(PlanningJob(SMALL, "nearest", 1e-3, 0))
