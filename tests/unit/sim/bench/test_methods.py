from __future__ import annotations

import pytest

from sim.bench.solvers import METHODS
from sim.study.baselines import ortools_routing
from sim.study.generator import random_mission
from swarm.allocation import evaluate
from swarm.runtime.clock import SystemClock
from tests.support.problems import table_1


@pytest.mark.parametrize("name", METHODS)
def test_every_method_lists_every_task_once(name: str) -> None:
    problem = table_1()
    solved = METHODS[name].load()(problem, 0.1, 0, SystemClock())
    assert sorted(task for route in solved.routes for task in route) == list(range(8))
    assert evaluate(problem, solved.routes)[0] <= 120.3336


@pytest.mark.parametrize("name", ["guided", "greedy"])
def test_methods_that_can_be_stopped_tell_how_they_got_better(name: str) -> None:
    problem = random_mission(4, 20, 0)
    solved = METHODS[name].load()(problem, 0.2, 0, SystemClock())
    assert solved.trace
    times_s, worths = zip(*solved.trace, strict=True)
    assert list(times_s) == sorted(times_s)
    assert list(worths) == sorted(worths)


def test_methods_refuse_what_does_not_fit(monkeypatch: pytest.MonkeyPatch) -> None:
    small, large = random_mission(3, 6, 0), random_mission(3, 40, 0)
    exact, ortools = METHODS["exact"].refusal, METHODS["ortools"].refusal
    assert exact is not None
    assert ortools is not None
    assert exact(small, 10.0) is None
    assert exact(small, 1e-9) == "takes too long to prove"
    assert exact(large, 10.0) == "too large to prove"
    assert ortools(large, 10.0) is None
    monkeypatch.setattr(ortools_routing, "matrix_bytes", {large: 5 * 2**30}.__getitem__)
    assert ortools(large, 10.0) == "its matrices would take 5 GiB"
    monkeypatch.setattr(ortools_routing, "is_installed", lambda: False)
    assert ortools(large, 10.0) == "OR-Tools is not installed: pip install 'peckorder[bench]'"
