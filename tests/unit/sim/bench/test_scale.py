"""What is counted in fleets of several sizes is set side by side."""

from __future__ import annotations

import json
import os
from collections import Counter
from dataclasses import replace
from io import StringIO
from pathlib import Path

import pytest
from rich.console import Console

from agent.links.mavlink_vehicle import TURNAROUNDS
from coordinator.mission_view.mission_state import MissionState
from sim.bench import scale
from sim.bench.fleets import survey_mission
from sim.bench.machine import share_bytes, this_machine
from sim.bench.plan_report import write_figure
from sim.bench.scale import (
    AGENTS,
    TO_SOME,
    MessageCount,
    ScaleBench,
    ScaleRun,
    ScaleSettings,
    published_hz,
    received_hz,
)
from sim.bench.scale_figure import scale_figure
from sim.fleet import capacity
from swarm.cli import main
from swarm.model.ids import COORDINATOR
from swarm.protocol.events import MessageReceived, Tick
from swarm.protocol.messages import Body
from swarm.protocol.uav_messages import ClaimedWay, ClaimPhase
from tests.support.builders import (
    IDLE,
    TIMING,
    choice,
    done,
    epoch,
    held,
    message,
    mission,
    status,
    task,
    uav,
)

SMALL = ScaleRun(
    uavs=2,
    tasks=6,
    up_s=1.5,
    airborne_s=20.0,
    watched_s=10.0,
    cpu_frac={AGENTS: 0.04, "routers": 0.01},
    agent_share_bytes=(20_000_000, 30_000_000),
    published_hz={"status": 5.0, "claim": 0.5, "choice": 0.25},
    received_hz={"claim": 0.5, "epoch": 0.5},
    new_claims_hz=0.375,
    latency_ms=(1.0, 2.0, 30.0),
    told_ms=(3.0, 4.0, 50.0),
    lost=0,
    ended=0,
    load=1.0,
)
LARGE = replace(
    SMALL,
    uavs=200,
    up_s=None,
    airborne_s=None,
    latency_ms=(),
    told_ms=(),
    received_hz={"claim": 99.5},
)
BENCH = ScaleBench(this_machine(), ScaleSettings((2, 200)), (SMALL, LARGE))


def test_messages_of_uavs_and_of_the_coordinator_are_counted_apart() -> None:
    count = MessageCount()
    facts = [
        message("u0", status()),
        message("u1", status()),
        message("u0", held("t0", 1.0)),
        message("u0", choice("t0")),
        message(COORDINATOR, epoch("u0", "u1")),
    ]
    state = MissionState(mission([uav("u0"), uav("u1")], [task("t0", 1.0)]), TIMING)
    core = count.around(state, state)
    core.start(0.0)
    for number, said in enumerate(facts):
        core.step(MessageReceived(said), float(number))
    core.step(Tick(), 10.0)

    assert count.there == {"u0", "u1"}
    assert published_hz(count.heard, 2, 10.0) == {"status": 0.1, "claim": 0.05, "choice": 0.05}
    heard = received_hz(count.heard, 2, 10.0)
    assert heard == {"claim": pytest.approx(0.05), "epoch": pytest.approx(0.1)}


def test_a_decision_is_timed_until_what_is_claimed_next_has_come_to_an_observer() -> None:
    """Whose process looks at what has come a little later."""
    count = MessageCount()
    state = MissionState(mission([uav("u0"), uav("u1")], [task("t0", 1.0)]), TIMING)
    core = count.around(state, state)
    core.start(100.0)
    facts: list[tuple[float, str, Body]] = [
        (100.0, COORDINATOR, epoch("u0", "u1")),
        (100.1, "u0", held("t0", 0.0)),
        (105.01, "u0", done("t0", completed_s=5.0)),
        (105.02, "u0", held("t0", 0.0)),  # said again, late
        (105.03, "u0", replace(held("t1", 5.0), phase=ClaimPhase.PROPOSED)),
        (105.5, "u0", replace(held("t1", 5.0), phase=ClaimPhase.PROPOSED)),
        (106.0, "u1", done("t2", completed_s=6.0)),
        (106.01, "u1", replace(IDLE, decided_s=6.0)),
        (109.0, "u1", replace(held("t3", 9.0), phase=ClaimPhase.PROPOSED)),
        (110.0, "u0", done("t0", completed_s=5.0)),  # said again
        (130.0, "u0", replace(held("t4", 29.9), phase=ClaimPhase.PROPOSED)),
    ]
    for number, (came_s, writer, body) in enumerate(facts, 1):
        core.step(MessageReceived(message(writer, body, number), came_s), came_s + 0.005)

    assert count.claim_delays.told_ms == [pytest.approx(30.0)]


def test_claims_that_are_only_repeated_are_told_apart() -> None:
    count = MessageCount()
    state = MissionState(mission([uav("u0"), uav("u1")], [task("t0", 1.0)]), TIMING)
    core = count.around(state, state)
    core.start(0.0)
    later = replace(IDLE, decided_s=1.0)
    for writer, number in (("u0", 1), ("u1", 1), ("u0", 1), ("u0", 2), ("u0", 1)):
        claim = later if number == 2 else IDLE
        core.step(MessageReceived(message(writer, claim, number)), 0.0)

    assert (count.new_claims, count.heard[True, "claim"]) == (3, 5)


def test_a_claim_that_only_tells_of_grants_is_nothing_new_to_all() -> None:
    count = MessageCount()
    state = MissionState(mission([uav("u0"), uav("u1")], [task("t0", 1.0)]), TIMING)
    core = count.around(state, state)
    core.start(0.0)
    way = ClaimedWay(1, ((0.0, 0.0, 30.0),), flies=True)
    hovers, grants = replace(IDLE, way=way), replace(IDLE, way=replace(way, grants={"u1": 3}))
    asks = replace(grants, way=ClaimedWay(2, ((0.0, 0.0, 30.0), (9.0, 0.0, 30.0))))
    for number, claim in enumerate((hovers, grants, asks), 1):
        core.step(MessageReceived(message("u0", claim, number)), 0.0)

    assert (count.new_claims, count.heard[True, "claim"]) == (2, 3)


def test_what_is_said_to_one_alone_is_heard_by_one() -> None:
    said = Counter({(True, "claim"): 40, (True, TO_SOME): 40})

    assert published_hz(said, 4, 10.0) == {"claim": 1.0, TO_SOME: 1.0}
    assert received_hz(said, 4, 10.0) == {"claim": 3.0, TO_SOME: 1.0}


def test_decisions_are_timed_by_what_agents_log() -> None:
    count = MessageCount()
    said = {"event": TURNAROUNDS, "target_ms": [1.5, 2.5], "in_force_ms": [], "idled": 0}
    count.log("u0", json.dumps(said), 0.0)
    count.log("u0", "begins", 0.0)

    assert count.latency_ms == [1.5, 2.5]


def test_what_follows_from_the_figures_is_told_with_them() -> None:
    told = BENCH.as_json()
    first, second = told["runs"]

    assert first["agent_cpu_frac"] == pytest.approx(0.02)
    assert first["agent_share_mean_bytes"] == 25e6
    assert (first["said_hz"], first["heard_hz"]) == (5.75, 1.0)
    assert (first["claims_per_decision"], first["besides_hz"]) == (2.0, 0.5)
    assert first["new_claims_per_decision"] == 1.5
    assert (first["latency_p50_ms"], first["latency_p99_ms"]) == (2.0, 30.0)
    assert second["latency_p99_ms"] is None
    assert (first["told_p50_ms"], first["told_p99_ms"]) == (4.0, 50.0)
    assert second["told_p99_ms"] is None
    json.dumps(told, allow_nan=False)


def test_people_read_ratios_to_the_first_fleet_and_what_never_came() -> None:
    text = BENCH.as_markdown()

    assert "| 200 | never | never |" in text
    assert "| 200 | 99.50 | 0.00 | 99.50 | 99.50 |" in text
    console = Console(width=120, record=True, file=StringIO())
    console.print(BENCH)
    assert "What fleets take" in console.export_text()


def test_the_picture_is_drawn_also_where_something_never_came(tmp_path: Path) -> None:
    write_figure(scale_figure(BENCH), tmp_path / "scale.svg")

    assert (tmp_path / "scale.svg").stat().st_size > 10_000


def test_no_message_at_all_is_no_fault() -> None:
    silent = replace(SMALL, published_hz={}, received_hz={})
    assert silent.claims_per_decision is None
    assert ScaleBench(this_machine(), ScaleSettings((2,)), (silent,)).as_markdown()
    assert published_hz(Counter(), 2, 1.0) == {}


@pytest.mark.skipif(not Path("/proc/self/smaps_rollup").exists(), reason="Linux alone tells it")
def test_the_share_of_memory_is_that_of_a_process() -> None:
    assert 1e6 < share_bytes(os.getpid()) < 1e11


def test_a_fleet_too_large_for_the_machine_is_told_so_first(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    told: list[str] = []

    def measured(settings: ScaleSettings, tell: object) -> ScaleBench:
        del settings, tell
        told.append(capsys.readouterr().err)
        return BENCH

    monkeypatch.setattr(capacity, "usable_cores", lambda: 1)
    monkeypatch.setattr(scale, "measure_scale", measured)

    assert main(["bench", "scale", "--sizes", "2,500"]) == 0
    assert told[0].startswith("warning: 500 UAVs, and 1 core can fly about ")
    assert told[0].count("\n") == 1


def test_a_fleet_that_keeps_apart_shares_the_layers_of_a_band() -> None:
    apart = replace(BENCH, settings=replace(BENCH.settings, separation_m=6.0))
    told = " ".join(str(part) for part in apart.parts())

    assert "6 m apart within 30 to 110 m" in told
    assert "a layer for each" in " ".join(str(part) for part in BENCH.parts())
    kept = survey_mission(3, 6, 0, separation_m=6.0)
    assert (kept.separation_m, kept.band_m) == (6.0, (30.0, 110.0))
    assert replace(kept, separation_m=None, band_m=None) == survey_mission(3, 6, 0)


def test_how_near_two_came_is_told_with_how_far_that_may_be_off() -> None:
    told = replace(BENCH, runs=(replace(SMALL, nearest_m=4.3, nearest_error_m=18.0),))
    (run,) = told.as_json()["runs"]

    assert (run["nearest_m"], run["nearest_error_m"]) == (4.3, 18.0)
    lines = told.as_markdown().splitlines()
    heads, row = (next(line for line in lines if key in line) for key in ("nearest", "4.3"))
    cells = dict(zip(heads.split("|"), row.split("|"), strict=True))
    assert cells[" nearest [m] "].strip() == "4.3"
    assert cells[" ± [m] "].strip() == "18.0"


def test_a_thinner_survey_is_the_same_one_drawn_larger() -> None:
    dense, thin = survey_mission(3, 6, 0), survey_mission(3, 6, 0, spacing_m=80.0)
    for near, far in zip(dense.tasks, thin.tasks, strict=True):
        assert far.position_enu_m == pytest.approx([2.0 * each for each in near.position_enu_m])
    assert ScaleSettings(tasks_per_uav=5, spacing_m=100.0).density_per_km2 == pytest.approx(20.0)
    told = "".join(str(part) for part in replace(BENCH, settings=ScaleSettings()).parts())
    assert "40 m apart (104 UAVs/km²)" in told
