"""A mission of the field in the air: zones, a base, batteries for half of it, lines, pictures.

Asserted is what no slow machine may change: every task is done, nobody comes nearer to a zone than
the margin, nobody's charge falls below the reserve. How long it takes beside the plan is for
`swarm bench legs`. Real firmware flies where SWARM_SITL_ARDUCOPTER or SWARM_SITL_PX4 says where it
is, else the simulated autopilot in that flavour.
"""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import pytest

from agent.vehicle.config import CommandStyle
from sim.bench.flown_legs import legs_flown, limits_kept
from sim.fleet.firmware import FirmwareKind
from swarm.scenario import load_scenario
from swarm.scenario.files import resolve_scenario
from tests.process.mission import SwarmRun
from tests.process.pace import pace
from tests.sitl.whole_run import autopilot_of, by_day

pytestmark = [pytest.mark.sitl, pytest.mark.process, pytest.mark.timeout(650)]

VINEYARD = resolve_scenario("vineyard")
SPEEDUP = 4.0
"""More, and a UAV is told of by so few places that it cannot be judged by them. What all processes
are kept waiting for on a busy machine costs charge, so many times over, that no plan counted on."""
FLIGHTS = by_day(FirmwareKind.ARDUPILOT, CommandStyle.REPOSITION)


@pytest.mark.parametrize(("kind", "style"), FLIGHTS)
def test_a_mission_of_the_field_keeps_its_limits(
    tmp_path: Path,
    kind: FirmwareKind,
    style: CommandStyle,
    record_property: Callable[[str, object], None],
) -> None:
    autopilot, mission = autopilot_of(kind), load_scenario(VINEYARD)
    record_property("flown", f"{autopilot.option}, {'real' if autopilot.real else 'simulated'}")
    speedup = min(autopilot.speedup, pace(SPEEDUP))
    words = [str(VINEYARD), "--autopilot", autopilot.option, "--command", style]
    words += ["--speedup", f"{speedup:g}"]
    with SwarmRun(words, tmp_path) as run:
        status, told = run.result(timeout_s=550.0)
        run.assert_nothing_left()

    assert status == 0, run.story()
    found = limits_kept(mission, told)
    assert (found.tasks, found.done) == (12, 12), run.story()
    assert found.nearest_zone_m is not None
    assert found.nearest_zone_m >= found.margin_m
    assert found.charge_frac is not None
    assert found.charge_frac >= found.reserve_frac, run.story()
    assert len(legs_flown(mission, told, "run")) >= 6
    changed = [
        entry["end_s"] > entry["begin_s"]
        for entries in told["executed_schedule"].values()
        for entry in entries
        if entry["go"] == "base:press-house"
    ]
    assert any(changed), run.story()
