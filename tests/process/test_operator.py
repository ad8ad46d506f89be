"""An operator commands a fleet of real processes whose coordinator has been killed."""

from __future__ import annotations

import contextlib
import json
from pathlib import Path

import pytest

from tests.process.by_hand import ByHand
from tests.process.long_fleet import UAVS, does, long_mission_of_three, swarm

pytestmark = [pytest.mark.process]


def test_an_operator_commands_a_fleet_without_a_coordinator(tmp_path: Path) -> None:
    with contextlib.ExitStack() as stack:
        by_hand = ByHand(tmp_path, stack, long_mission_of_three("commanded"), speedup=4)
        coordinator = by_hand.coordinator("coordinator")
        for uav in UAVS:
            by_hand.wait_for(uav, "event=decided")
        coordinator.kill()
        coordinator.wait()

        held = swarm(by_hand, "hold", "uav1", "--reason", "helicopter")
        assert (held.returncode, held.stderr) == (0, "")
        assert held.stdout == "uav1 is holding: held by the operator: helicopter\n"
        assert does(by_hand, "uav1") == "holding"
        assert "held" in swarm(by_hand, "status").stdout

        resumed = swarm(by_hand, "resume", "uav1")
        assert (resumed.returncode, resumed.stderr) == (0, "")
        by_hand.wait_for("uav1", "command=resume")

        sent_home = swarm(by_hand, "return", "uav2")
        assert (sent_home.returncode, sent_home.stderr) == (0, "")
        assert by_hand.agents[1].wait(60) == 0, by_hand.log("uav2")

        unknown = swarm(by_hand, "hold", "uav9")
        assert unknown.returncode == 2
        assert unknown.stderr == (
            "UAV: 'uav9' is not in mission commanded; the fleet is uav1, uav2, uav3\n"
        )
        late = swarm(by_hand, "hold", "uav2", "--timeout-s", "2")
        assert late.returncode == 1
        assert late.stderr.startswith("swarm: nobody flies uav2")

        aborted = swarm(by_hand, "abort", "--json")
        assert (aborted.returncode, aborted.stderr) == (0, "")
        told = json.loads(aborted.stdout)
        assert (told["command"], told["obeyed"]) == ("abort", True)
        assert [by_hand.agents[n].wait(90) for n in (0, 2)] == [0, 0]
        assert by_hand.done() == []
