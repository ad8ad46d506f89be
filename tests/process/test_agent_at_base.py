"""An agent's process is killed while its vehicle lands, swaps and climbs, and started again."""

from __future__ import annotations

import contextlib
import os
import re
import signal
from pathlib import Path

import pytest

from swarm.model import Base, BaseId, Mission, Origin, Task, TaskId, Uav, UavId, Zone, ZoneId
from tests.process.by_hand import ByHand

pytestmark = [pytest.mark.process]

SPEEDUP = 6.0


def paddock() -> Mission:
    """One UAV that has to change its battery to do both of its tasks, round a zone."""
    hedge = ((120.0, -40.0), (140.0, -40.0), (140.0, 40.0), (120.0, 40.0))
    return Mission(
        name="paddock",
        horizon_s=900.0,
        uavs=(Uav(UavId("uav1"), (0.0, 0.0, 0.0), 10.0, acceleration_m_s2=2.5, endurance_s=150.0),),
        tasks=tuple(
            Task(TaskId(name), (east_m, north_m, 0.0), 5.0, service_s=5.0)
            for name, east_m, north_m in (("t1", 320.0, 60.0), ("t2", 320.0, -60.0))
        ),
        origin=Origin(46.8, 9.7, 1100.0),
        bases=(Base(BaseId("shed"), (60.0, 0.0, 0.0), swap_s=60.0, slots=1),),
        zones=(Zone(ZoneId("hedge"), hedge),),
        zone_margin_m=5.0,
    )


@pytest.mark.parametrize("flavour", ["ardupilot", "px4"])
def test_killed_while_it_lands_swaps_and_climbs_it_goes_on_each_time(
    tmp_path: Path, flavour: str
) -> None:
    with contextlib.ExitStack() as stack:
        hand = ByHand(tmp_path, stack, paddock(), SPEEDUP, flavour=flavour, by_itself=True)
        hand.coordinator("coordinator")
        moments = (
            ("uav1", 'event="lands"'),
            ("uav1-2", "its battery is being changed"),
            ("uav1-3", "climbing"),
        )
        for life, (name, moment) in enumerate(moments, 2):
            hand.wait_for(name, moment)
            os.kill(hand.agents[0].pid, signal.SIGKILL)
            hand.agents[0].wait()
            hand.restart("uav1", f"uav1-{life}")

        assert hand.agents[0].wait(120) == 0, hand.log("uav1-4")
        logs = "".join(hand.log(name) for name in ("uav1", "uav1-2", "uav1-3", "uav1-4"))
        assert sorted(re.findall(r'event="task done".*?\btask=(\w+)', logs)) == ["t1", "t2"], logs
        assert logs.count('event="battery swapped"') == 1, logs
        assert "vehicle given up" not in logs
        assert "landed at home" in hand.log("uav1-4")
