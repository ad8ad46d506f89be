"""Keys that are revoked while a fleet flies: who has them is out, and the others go on."""

from __future__ import annotations

import contextlib
import re
import shutil
from datetime import datetime
from pathlib import Path

import numpy as np
import pytest

from swarm.identity.founding import found_authority
from swarm.model import Mission, Origin, Task, TaskId, Uav, UavId
from swarm.runtime.clock import unix_s
from tests.process.by_hand import ByHand

pytestmark = [pytest.mark.process]

UAVS = ["uav1", "uav2", "uav3"]
OUT_LIMIT_S = 5.0
"""From the first who hears of it to the last, a router's new beginning included: much more than
the tenths of a second it takes, as a machine of the tests may be busy."""


def _flown() -> Mission:
    rng = np.random.default_rng(5)
    places = [(float(x), float(y), 0.0) for x, y in rng.uniform(0.0, 60.0, (6, 2))]
    tasks = [Task(TaskId(f"t{n}"), place, 1.0, service_s=8.0) for n, place in enumerate(places)]
    uavs = [Uav(UavId(u), (12.0 * n, 0.0, 0.0), 10.0) for n, u in enumerate(UAVS)]
    return Mission("revoked", 600.0, tuple(uavs), tuple(tasks), origin=Origin(46.8, 9.7, 1100.0))


def test_a_revoked_agent_is_out_at_once_and_comes_home_and_the_others_finish(
    tmp_path: Path,
) -> None:
    keys, machines = tmp_path / "keys", tmp_path / "machines"
    found_authority(keys, "revoked", UAVS, now_s=unix_s())
    for name in (*UAVS, "coordinator", "router"):  # each machine has a folder of its own
        shutil.copytree(keys / name, machines / name)
    with contextlib.ExitStack() as stack:
        by_hand = ByHand(tmp_path, stack, _flown(), speedup=8, keys=machines)
        coordinator = by_hand.coordinator("coordinator")
        by_hand.wait_for_done(2)

        words = ["keys", "revoke", str(keys), "uav3", "--connect", by_hand.endpoint]
        revoking = by_hand.start("revoke", words)
        assert revoking.wait(60) == 0, by_hand.log("revoke")

        assert revoking.stdout is not None
        assert revoking.stdout.read() == (
            "revoked: uav3\nroster version 3 published; confirmed by coordinator, uav1, uav2\n"
        )
        assert coordinator.wait(150) == 0, by_hand.log("coordinator")
        assert [agent.wait(150) for agent in by_hand.agents] == [0, 0, 0]
        told = [_time_s(by_hand.log(name), "newer roster in force") for name in UAVS]
        told.append(_time_s(by_hand.log("router"), "roster 3"))
        assert max(told) - min(told) < OUT_LIMIT_S
        assert "its keys were revoked or replaced" in by_hand.log("uav3")
        assert set(by_hand.done()) == {task.id for task in by_hand.mission.tasks}


def _time_s(log: str, text: str) -> float:
    """When a line with ``text`` was logged [unix s]."""
    (line,) = [line for line in log.splitlines() if text in line]
    stamp = re.search(r"timestamp=(\S+)", line)
    assert stamp is not None
    return datetime.fromisoformat(stamp[1]).timestamp()
