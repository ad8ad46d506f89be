"""The whole system while something happens to its vehicles: the others do what is left.

Each run strikes two of three UAVs, since a run takes its time. Faults count from the arming
of their vehicle: 20 s later it is about to reach its first task, or still waits for others.
"""

from __future__ import annotations

from pathlib import Path

import pytest

from tests.sitl.whole_run import fly

pytestmark = [pytest.mark.sitl, pytest.mark.process]

REASONS = {
    "pilot": " switched it to ",
    "reboot": "the autopilot rebooted",
    "silent": "nothing heard for ",
    "failsafe-rtl": "a failsafe switched it to RTL",
    "battery-low": "battery at 10%",
}


@pytest.mark.parametrize(
    ("vehicles", "faults"),
    [
        pytest.param("sim", ["uav2:pilot@20", "uav3:reboot@20"], marks=pytest.mark.slow),
        # Only a PX4 that is commanded by missions cannot be pulled back by an order under way.
        ("sim-px4 --command uav3=mission", ["uav2:silent@20+100", "uav3:pilot@20"]),
        pytest.param(
            "sim", ["uav2:battery-low@18", "uav3:failsafe-rtl@20"], marks=pytest.mark.slow
        ),
    ],
    ids=["pilot-and-reboot", "silent-and-pilot", "battery-and-failsafe"],
)
def test_what_a_lost_vehicle_leaves_is_done_by_others_and_the_story_says_why(
    tmp_path: Path, vehicles: str, faults: list[str]
) -> None:
    struck = [word for fault in faults for word in ("--fault", fault)]

    flown = fly(tmp_path, "--autopilot", *vehicles.split(), *struck)

    flown.assert_all_done()
    for fault in faults:
        uav, _, what = fault.partition(":")
        assert REASONS[what.partition("@")[0]] in flown.said_of(uav), flown.story
    assert len(flown.told["executed_routes"]["uav1"]) >= 3, flown.story
    assert flown.told["lost_uavs"] == [], flown.story  # agents live on, and say so


def test_tasks_of_vehicles_that_do_not_move_are_done_by_another(tmp_path: Path) -> None:
    flown = fly(
        tmp_path,
        *("--fault", "uav2:stuck@16", "--fault", "uav3:gps-lost@18+200"),
        *("--command", "uav2=mission"),
    )

    flown.assert_all_done()
    assert len(flown.told["executed_routes"]["uav1"]) >= 3, flown.story


def test_a_fleet_does_without_a_vehicle_that_never_arms(tmp_path: Path) -> None:
    flown = fly(
        tmp_path,
        *("--autopilot", "sim-px4", "--fault", "uav2:refuse-arming@0"),
        *("--start-timeout-s", "20"),
    )

    flown.assert_all_done()
    assert flown.told["executed_routes"]["uav2"] == []
