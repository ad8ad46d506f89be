"""The whole system against each firmware, commanded in each way.

Real firmware flies where SWARM_SITL_ARDUCOPTER or SWARM_SITL_PX4 says where it is, else the
simulated autopilot in that flavour; the recorded property ``flown`` says which it was.
"""

from __future__ import annotations

import json
import signal
import subprocess
from collections.abc import Callable
from pathlib import Path

import pytest

from agent.vehicle.config import CommandStyle
from sim.fleet.firmware import FirmwareKind
from tests.process.mission import alive, wait_until
from tests.process.pace import pace
from tests.process.programs import Swarm
from tests.sitl.firmware_stand_in import arducopter_stand_in, px4_stand_in
from tests.sitl.whole_run import MEADOW, UAVS, autopilot_of, fly

pytestmark = [pytest.mark.sitl, pytest.mark.process]


@pytest.mark.parametrize("style", CommandStyle)
@pytest.mark.parametrize("kind", FirmwareKind)
def test_the_plan_is_flown(
    tmp_path: Path,
    kind: FirmwareKind,
    style: CommandStyle,
    record_property: Callable[[str, object], None],
) -> None:
    autopilot = autopilot_of(kind)
    record_property("flown", f"{autopilot.option}, {'real' if autopilot.real else 'simulated'}")

    flown = fly(
        tmp_path,
        *("--autopilot", autopilot.option, "--command", style),
        speedup=autopilot.speedup,
    )

    flown.assert_all_done()
    told = flown.told
    assert autopilot.real or told["executed_routes"] == told["routes"], flown.story
    assert told["lost_uavs"] == [], flown.story
    assert told["executed_objective"] >= autopilot.worth * told["objective"], flown.story


@pytest.mark.parametrize("kind", FirmwareKind)
def test_firmware_is_started_on_the_ports_where_agents_look_for_it(
    tmp_path: Path, kind: FirmwareKind
) -> None:
    """Whatever its own folder, and that of temporary files, are called."""
    make = arducopter_stand_in if kind is FirmwareKind.ARDUPILOT else px4_stand_in
    programs, work = tmp_path / "my programs & more", tmp_path / "work (of $HOME)"
    programs.mkdir()
    work.mkdir()
    scenario = programs / "meadow.toml"  # a name that only this test's vehicles carry
    scenario.write_text(MEADOW.read_text())
    place = make(programs, str(scenario), list(UAVS))

    flown = fly(work, "--autopilot", kind, "--firmware", str(place), speedup=pace(20.0))

    flown.assert_all_done()
    wait_until(lambda: not _vehicles(str(scenario)), 10, "the end of all firmware")


def test_vehicles_that_run_already_are_flown_and_left_running(tmp_path: Path) -> None:
    speedup = pace(20.0)
    words = ["autopilot", str(MEADOW), "--json", "--system-id", "41", "--speedup", f"{speedup:g}"]
    vehicles = Swarm(words, stdout=subprocess.PIPE)
    try:
        assert vehicles.stdout is not None
        places = {
            said["uav"]: f"{said['url']}#{said['system_id']}"
            for said in (json.loads(vehicles.stdout.readline()) for _ in UAVS)
        }
        first, second, third = (places[uav] for uav in UAVS)

        flown = fly(tmp_path, "--autopilot", f"uav2={second},{first},{third}", speedup=speedup)

        flown.assert_all_done()
        assert flown.told["lost_uavs"] == []
        assert alive(vehicles.pid)
    finally:
        vehicles.send_signal(signal.SIGTERM)
        assert vehicles.wait(20) == 0
        if vehicles.stdout is not None:
            vehicles.stdout.close()


def _vehicles(scenario: str) -> list[str]:
    """Command lines of processes that simulate vehicles of that scenario."""
    found = []
    for entry in Path("/proc").iterdir():
        try:
            words = (entry / "cmdline").read_bytes().decode().split("\0")
        except (OSError, UnicodeDecodeError):
            continue
        if "autopilot" in words and scenario in words:
            found.append(" ".join(words))
    return found
