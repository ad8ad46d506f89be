"""Keys that are revoked, and given anew, while a fleet flies: who is out, and who goes on."""

from __future__ import annotations

import contextlib
import shutil
import time
from pathlib import Path

import numpy as np
import pytest

from swarm.clock import unix_s
from swarm.identity.founding import found_authority
from swarm.model import Mission, Origin, Task, TaskId, Uav, UavId
from tests.process.by_hand import ByHand

pytestmark = [pytest.mark.process, pytest.mark.timeout(120)]

UAVS = ["uav1", "uav2", "uav3"]
OUT_LIMIT_S = 1.5


def _flown() -> Mission:
    rng = np.random.default_rng(5)
    places = [(float(x), float(y), 0.0) for x, y in rng.uniform(0.0, 120.0, (9, 2))]
    tasks = [Task(TaskId(f"t{n}"), place, 1.0, service_s=4.0) for n, place in enumerate(places)]
    uavs = [Uav(UavId(u), (12.0 * n, 0.0, 0.0), 10.0) for n, u in enumerate(UAVS)]
    return Mission("revoked", 600.0, tuple(uavs), tuple(tasks), origin=Origin(46.8, 9.7, 1100.0))


def test_a_revoked_agent_is_out_at_once_and_the_others_finish_its_work(tmp_path: Path) -> None:
    keys = tmp_path / "keys"
    found_authority(keys, "revoked", UAVS, now_s=unix_s())
    with contextlib.ExitStack() as stack:
        for name in (*UAVS, "coordinator", "router"):  # each machine has a folder of its own
            shutil.copytree(keys / name, tmp_path / "machines" / name)
        by_hand = ByHand(tmp_path, stack, _flown(), speedup=4, keys=tmp_path / "machines")
        coordinator = by_hand.coordinator("coordinator")
        by_hand.wait_for_done(2)

        words = ["keys", "revoke", str(keys), "uav3", "--connect", by_hand.endpoint]
        began_s = time.monotonic()
        revoking = by_hand.start("revoke", words)
        by_hand.wait_for("uav3", "link to the bus")
        took_s = time.monotonic() - began_s

        assert revoking.wait(20) == 0, by_hand.log("revoke")
        assert revoking.stdout is not None
        said = revoking.stdout.read()
        print(said, took_s, time.monotonic() - began_s)
        assert "confirmed by coordinator, uav1, uav2" in said
        assert coordinator.wait(60) == 0
