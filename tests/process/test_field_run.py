"""A mission of the field flown by real processes: zones, a base, batteries for half of the list."""

from __future__ import annotations

import math
from itertools import pairwise
from pathlib import Path
from typing import Any

import pytest

from swarm.model import Base, BaseId, Mission, Origin, Task, TaskId, Uav, UavId, Zone, ZoneId
from tests.process.mission import SwarmRun
from tests.process.pace import pace
from tests.process.test_secure_run import written

pytestmark = [pytest.mark.process]

PLACES = ((50, 200), (150, 260), (330, 250), (420, 60), (330, -130), (120, -150))
POND = ((180.0, 40.0), (280.0, 40.0), (280.0, 160.0), (180.0, 160.0))
HERD = ((200.0, -100.0), (280.0, -100.0), (240.0, -20.0))


def pasture() -> Mission:
    """Two UAVs and six tasks round a pond and a herd, and a barn where batteries are changed."""
    uavs = [
        Uav(
            UavId(f"uav{number + 1}"),
            (20.0 * number, 0.0, 0.0),
            10.0,
            acceleration_m_s2=2.5,
            endurance_s=180.0,
            reserve_frac=0.2,
        )
        for number in range(2)
    ]
    tasks = [
        Task(TaskId(f"t{number + 1}"), (float(east_m), float(north_m), 0.0), 5.0, service_s=5.0)
        for number, (east_m, north_m) in enumerate(PLACES)
    ]
    return Mission(
        name="pasture",
        horizon_s=900.0,
        uavs=tuple(uavs),
        tasks=tuple(tasks),
        origin=Origin(46.8, 9.7, 1100.0),
        bases=(Base(BaseId("barn"), (80.0, -40.0, 0.0), swap_s=15.0, slots=1),),
        zones=(Zone(ZoneId("pond"), POND), Zone(ZoneId("herd"), HERD)),
        zone_margin_m=10.0,
    )


def swaps(told: dict[str, Any], key: str) -> list[str]:
    """Bases where batteries were changed, or were to be, for a task that came after."""
    tasks = {task for route in told["routes"].values() for task in route}
    return [
        entry["go"]
        for entries in told[key].values()
        for entry, after in pairwise(entries)
        if entry["go"].startswith("base:")
        and entry["end_s"] > entry["begin_s"]
        and after["go"] in tasks
    ]


@pytest.mark.parametrize(
    "more",
    [
        ["--autopilot", "sim-px4"],
        pytest.param(["--command", "reposition"], marks=pytest.mark.slow),
    ],
)
def test_every_task_is_done_round_zones_with_batteries_changed_on_the_way(
    tmp_path: Path, more: list[str]
) -> None:
    mission, folder = pasture(), tmp_path / "run"
    folder.mkdir()
    words = [written(mission, tmp_path), "--speedup", f"{pace(8.0):g}", *more]
    with SwarmRun(words, folder) as run:
        status, told = run.result()
        run.assert_nothing_left()

    assert status == 0, run.story()
    assert sorted(told["done"]) == [task.id for task in mission.tasks]
    assert told["left_out"] == {}
    assert "base:barn" in swaps(told, "schedule")
    assert "base:barn" in swaps(told, "executed_schedule")
    assert told["executed_schedule"].keys() == {"uav1", "uav2"}
    assert told["closest_approach_m"] > 0.0
    assert math.isclose(
        told["makespan_s"],
        max(
            entry["end_s"]
            for entries in told["executed_schedule"].values()
            for entry in entries
            if entry["go"] in told["done"]
        ),
    )
