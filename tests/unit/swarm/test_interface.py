"""`import swarm`: light, typed as it runs, and one clear line for what is wrong."""

from __future__ import annotations

import inspect
import subprocess
import sys
from collections.abc import Callable
from dataclasses import fields
from pathlib import Path
from typing import Any, get_type_hints

import pytest

import coordinator.interface
import sim.interface
import swarm
from coordinator.planner.plan import make_plan
from sim.world.uncertainty import Uncertainty
from swarm.interface import UncertaintyOptions
from swarm.model import UavId

UPPER: dict[str, Callable[..., Any]] = {
    "plan": coordinator.interface.plan,
    "read_recording": coordinator.interface.read_recording,
    "simulate": sim.interface.simulate,
}
TABLE_1 = swarm.load("table-1")


def closest(turn: swarm.Turn) -> swarm.Task | None:
    return min(turn.open, key=turn.travel_s)


def test_importing_it_imports_nothing_else() -> None:
    program = (
        "import sys; before = {*sys.modules}; import swarm; dir(swarm); swarm.__version__\n"
        "print(*sorted({*sys.modules} - before))"
    )
    words = [sys.executable, "-c", program]
    done = subprocess.run(words, capture_output=True, text=True, check=True)

    own = sys.stdlib_module_names | {"_peckorder_editable"}  # which finds the sources
    assert {name for name in done.stdout.split() if name.partition(".")[0] not in own} <= {
        "swarm",
        "swarm.lazy_names",
    }


def test_every_name_is_there_and_no_other_is_offered() -> None:
    assert dir(swarm) == sorted(swarm.__all__)
    for name in swarm.__all__:
        assert getattr(swarm, name) is not None
        if name != "__version__":
            assert f"{name}`" in (swarm.__doc__ or "") or inspect.getdoc(getattr(swarm, name))
    with pytest.raises(AttributeError, match="no attribute 'simluate'"):
        swarm.simluate  # type: ignore[attr-defined]  # noqa: B018


@pytest.mark.parametrize("name", UPPER)
def test_what_is_called_is_what_is_documented(name: str) -> None:
    offered: Callable[..., Any] = getattr(swarm, name)
    inner = UPPER[name]

    assert inspect.signature(offered) == inspect.signature(inner)


def test_everything_that_may_go_wrong_can_be_asked_for() -> None:
    options = get_type_hints(UncertaintyOptions)

    assert options == get_type_hints(Uncertainty)
    assert [*options] == [item.name for item in fields(Uncertainty)]


def test_a_plan_is_flown_as_planned_and_worth_what_evaluate_says() -> None:
    plan = swarm.plan(TABLE_1, "greedy")
    flight = swarm.simulate(TABLE_1, plan)

    assert plan.objective == pytest.approx(118.49, abs=0.01)
    assert plan.optimum == pytest.approx(120.33, abs=0.01)
    assert flight.routes == plan.routes
    assert flight.plan == plan
    found = swarm.evaluate(TABLE_1, flight.routes)
    assert found.objective == pytest.approx(flight.objective)
    assert found.completion_s == pytest.approx(flight.completion_s)
    assert swarm.evaluate(TABLE_1, {}).objective == 0.0


@pytest.mark.parametrize(("method", "kept_frac"), [("greedy", 0.25), ("exact", 0.0)])
def test_of_a_limit_a_bound_is_kept_a_share_but_from_a_proof_nothing(
    method: str, kept_frac: float, monkeypatch: pytest.MonkeyPatch
) -> None:
    kept = []

    def noted(mission: swarm.Mission, method: str, **options: Any) -> swarm.Plan:
        kept.append(options["bound_frac"])
        return make_plan(mission, method, **options)

    monkeypatch.setattr("coordinator.interface.make_plan", noted)
    swarm.plan(TABLE_1, method, time_limit_s=10.0)

    assert kept == [kept_frac]


def test_agents_fly_by_the_users_rule_as_it_was_planned() -> None:
    plan = swarm.plan(TABLE_1, closest)
    flight = swarm.simulate(TABLE_1, closest)

    assert plan.method == "closest"
    assert plan.optimum == pytest.approx(120.33, abs=0.01)
    assert flight.routes == plan.routes
    assert flight.done == tuple(task.id for task in TABLE_1.tasks)


def test_a_rule_meets_losses_and_popups_and_may_decline() -> None:
    def only_early(turn: swarm.Turn) -> swarm.Task | None:
        return closest(turn) if turn.now_s < 1.0 else None

    first = swarm.simulate(TABLE_1, closest, seed=5, loss=0.6, popup=0.4)
    again = swarm.simulate(TABLE_1, closest, seed=5, loss=0.6, popup=0.4)
    few = swarm.simulate(TABLE_1, only_early)

    assert first.lost_uavs
    assert any(task.appears_s > 0.0 for task in first.mission.tasks)
    assert (first.routes, first.story) == (again.routes, again.story)
    assert 0 < len(few.done) < len(TABLE_1.tasks)
    assert len(few.open) == len(TABLE_1.tasks) - len(few.done)


def test_a_turn_tells_what_eq_1_needs() -> None:
    turns: list[swarm.Turn] = []

    def watched(turn: swarm.Turn) -> swarm.Task | None:
        turns.append(turn)
        return max(turn.open, key=turn.gain)

    plan = swarm.plan(TABLE_1, watched, bound=False)

    first = turns[0]
    uav = TABLE_1.uavs[0]
    assert (first.uav, first.now_s, first.position_enu_m) == (uav.id, 0.0, uav.position_enu_m)
    assert first.open == TABLE_1.tasks
    task = first.open[0]
    assert first.completion_s(task) == first.travel_s(task) + task.service_s
    left_s = TABLE_1.horizon_s - first.completion_s(task)
    assert first.gain(task) == pytest.approx(TABLE_1.success(uav, task) * task.value * left_s)
    assert plan.method == "watched"


def test_a_recording_tells_what_the_flight_told(tmp_path: Path) -> None:
    path = tmp_path / "flight.mcap"
    flown = swarm.simulate(TABLE_1, "greedy", seed=1, record=path)
    told = swarm.read_recording(path)

    assert told.routes == flown.routes
    assert told.objective == pytest.approx(flown.objective)
    assert told.plan is not None
    assert told.plan.objective == pytest.approx(flown.objective)
    assert (told.cut_short, flown.facts) == (None, ())
    assert len(told.facts) > 10


SMALL = swarm.Mission("small", 10.0, (swarm.Uav(swarm.UavId("u"), (0.0, 0.0, 0.0), 1.0),), ())


@pytest.mark.parametrize(
    ("call", "line"),
    [
        (lambda: swarm.load("tabel-1"), "tabel-1: no such scenario file; did you mean 'table-1'?"),
        (lambda: swarm.load("nowhere/"), "no such scenario file"),
        (lambda: swarm.plan(TABLE_1, "gready"), "no such method 'gready'; did you mean 'greedy'?"),
        (lambda: swarm.plan(TABLE_1, seed=-1), "seed must be >= 0, not -1"),
        (lambda: swarm.plan(TABLE_1, time_limit_s=0.0), "time_limit_s must be > 0, not 0.0"),
        (lambda: swarm.plan(TABLE_1, 3), "must be a function of a Turn, not 3"),  # type: ignore[arg-type]
        (lambda: swarm.plan(TABLE_1, lambda _: SMALL), "one of turn.open or None"),  # type: ignore[arg-type,return-value]
        (lambda: swarm.evaluate(TABLE_1, {"u9": ()}), "no such UAV in table-1: u9"),  # type: ignore[dict-item]
        (lambda: swarm.evaluate(TABLE_1, {"uav1": ("t9",)}), "no such task in table-1: t9"),  # type: ignore[dict-item]
        (lambda: swarm.evaluate(TABLE_1, {"uav1": ("t1", "t1")}), "t1 is on the lists twice"),  # type: ignore[dict-item]
        (lambda: swarm.simulate(TABLE_1, "exact"), "no fleet can fly by 'exact'; choose one of"),
        (
            lambda: swarm.simulate(SMALL, swarm.plan(TABLE_1, "greedy")),
            "another mission than small",
        ),
        (
            lambda: swarm.simulate(TABLE_1, swarm.plan(TABLE_1, closest)),
            "no fleet can fly by a plan of 'closest'",
        ),
        (
            lambda: swarm.simulate(TABLE_1, los=0.1),  # type: ignore[call-arg]
            "no such uncertainty 'los'; did you mean 'loss'",
        ),
        (lambda: swarm.simulate(TABLE_1, loss=2.0), "loss must be within 0..1, not 2.0"),
        (lambda: swarm.simulate(TABLE_1, lost_at_s={"u9": 1.0}), "no such UAV in table-1: u9"),  # type: ignore[dict-item]
        (lambda: swarm.simulate(TABLE_1, coordinator_lost_s=-1.0), "coordinator_lost_s must be >="),
        (lambda: swarm.simulate(TABLE_1, record="x.txt"), "end the name in .mcap"),
        (lambda: swarm.read_recording("nothing.mcap"), "nothing.mcap: cannot be read"),
    ],
)
def test_wrong_input_is_told_in_one_line(call: Callable[[], object], line: str) -> None:
    with pytest.raises((ValueError, swarm.SwarmError)) as caught:
        call()

    said = str(caught.value)
    assert line in said
    assert "\n" not in said


def test_lists_of_the_field_are_worth_what_their_plan_says_with_swaps_on_them() -> None:
    mission = swarm.load("reservoir-inspection")
    made = swarm.plan(mission, "greedy", bound=False)
    assert made.schedule is not None
    # The last entry is the way home, which is on no list.
    lists = {uav: [entry.go for entry in made.schedule[uav][:-1]] for uav in made.routes}

    found = swarm.evaluate(mission, lists)  # type: ignore[arg-type]

    assert any(name.startswith("base:") for names in lists.values() for name in names)
    assert found.objective >= made.objective - 1e-6
    assert found.completion_s.keys() == made.completion_s.keys()


def test_a_list_of_the_field_that_cannot_be_flown_is_refused_with_the_reason() -> None:
    mission = swarm.load("reservoir-inspection")
    far = ("weir", "chapel", "quarry", "gauge")

    with pytest.raises(ValueError, match=r"uav1 cannot do \w+ there: its battery does not last"):
        swarm.evaluate(mission, {UavId("uav1"): far})  # type: ignore[dict-item]
    with pytest.raises(ValueError, match="no such task or base in reservoir-inspection: base:b9"):
        swarm.evaluate(mission, {UavId("uav1"): ("base:b9",)})  # type: ignore[dict-item]
    with pytest.raises(ValueError, match="more than once on the lists: weir"):
        swarm.evaluate(mission, {UavId("uav1"): ("weir", "weir")})  # type: ignore[dict-item]
