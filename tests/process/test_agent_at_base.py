"""An agent's process is killed while its vehicle lands, swaps and climbs, and started again."""

from __future__ import annotations

import contextlib
import os
import re
import signal
from pathlib import Path

import pytest

from swarm.model import Base, BaseId, Mission, Origin, Task, TaskId, Uav, UavId, Zone, ZoneId
from tests.process.by_hand import LIMIT_S, ByHand
from tests.process.mission import wait_until
from tests.process.programs import run_swarm

pytestmark = [pytest.mark.process]

SPEEDUP = 6.0
FLIGHTS = [("ardupilot", False), pytest.param("px4", True, marks=pytest.mark.slow)]
"""Firmware, and whether it starts again without anybody's word."""
WHY_NOT = ("stays on the ground: battery at", "does not stand at a base", "has not confirmed it")
"""Before its battery is full, or once it flies already; and on a machine that is slow."""


def paddock() -> Mission:
    """One UAV that has to change its battery to do both of its tasks, round a zone."""
    hedge = ((120.0, -40.0), (140.0, -40.0), (140.0, 40.0), (120.0, 40.0))
    return Mission(
        name="paddock",
        horizon_s=900.0,
        uavs=(Uav(UavId("uav1"), (0.0, 0.0, 0.0), 10.0, acceleration_m_s2=2.5, endurance_s=165.0),),
        tasks=tuple(
            Task(TaskId(name), (east_m, north_m, 0.0), 5.0, service_s=5.0)
            for name, east_m, north_m in (("t1", 300.0, 60.0), ("t2", -250.0, 60.0))
        ),
        origin=Origin(46.8, 9.7, 1100.0),
        bases=(Base(BaseId("shed"), (60.0, 0.0, 0.0), swap_s=60.0, slots=1),),
        zones=(Zone(ZoneId("hedge"), hedge),),
        zone_margin_m=5.0,
    )


def let_start(hand: ByHand, name: str) -> list[tuple[int, str]]:
    """Say that it may start, until it climbs; what came of each word."""
    came: list[tuple[int, str]] = []

    def climbs() -> bool:
        if "climbing" not in hand.log(name):
            said = run_swarm("ready", "uav1", "--mission", "paddock", *hand.seat)
            came.append((said.returncode, said.stdout + said.stderr))
        return "climbing" in hand.log(name)

    wait_until(climbs, LIMIT_S, "a start")
    return came


@pytest.mark.parametrize(("flavour", "by_itself"), FLIGHTS)
def test_killed_while_it_lands_swaps_and_climbs_it_goes_on_each_time(
    tmp_path: Path, flavour: str, by_itself: bool
) -> None:
    with contextlib.ExitStack() as stack:
        hand = ByHand(tmp_path, stack, paddock(), SPEEDUP, flavour=flavour, by_itself=by_itself)
        hand.coordinator("coordinator")
        stands = "its battery is being changed" if by_itself else "and then let it start again"
        moments = (("uav1", "event=lands"), ("uav1-2", stands), ("uav1-3", "climbing"))
        for life, (name, moment) in enumerate(moments, 2):
            if moment == "climbing" and not by_itself:
                hand.wait_for(name, stands)
                assert "climbing" not in hand.log(name)
                came = let_start(hand, name)
                refused = [text for status, text in came if status]
                assert len(refused) < len(came), came
                assert all(any(why in text for why in WHY_NOT) for text in refused), came
            hand.wait_for(name, moment)
            os.kill(hand.agents[0].pid, signal.SIGKILL)
            hand.agents[0].wait()
            hand.restart("uav1", f"uav1-{life}")

        assert hand.agents[0].wait(120) == 0, hand.log("uav1-4")
        logs = "".join(hand.log(name) for name in ("uav1", "uav1-2", "uav1-3", "uav1-4"))
        assert sorted(re.findall(r'event="task done".*?\btask=(\w+)', logs)) == ["t1", "t2"], logs
        assert 'event="battery swapped"' in logs
        assert "vehicle given up" not in logs
        assert "landed at home" in hand.log("uav1-4")
