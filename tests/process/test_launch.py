"""The processes of a run can be had by name, and those that cannot are named."""

from __future__ import annotations

import asyncio
from pathlib import Path

import pytest

from sim.fleet.launcher import Launcher
from sim.fleet.layout import BusKind, LaunchOptions
from swarm.scenario.write import format_scenario
from tests.process.chaos_play import survey
from tests.process.mission import alive

pytestmark = [pytest.mark.process]


def test_processes_are_killed_restarted_and_ended_by_name(tmp_path: Path) -> None:
    mission = survey(2, 2)
    scenario = tmp_path / "scenario.toml"
    scenario.write_text(format_scenario(mission))
    options = LaunchOptions(
        scenario=scenario,
        method="greedy",
        seed=0,
        speedup=4.0,
        bus=BusKind.ROUTER,
        position_rate_hz=10.0,
        acceptance_radius_m=1.0,
        start_timeout_s=60.0,
    )

    async def scenario_of_names() -> None:
        launch = Launcher(mission, options)
        try:
            await launch.start()
            pilots = {f"autopilot of {uav.id}" for uav in mission.uavs}
            assert set(launch.names) == {"router 1", "coordinator", "uav01", "uav02"} | pilots
            folder = launch.layout.state
            assert folder is not None
            assert folder.is_dir()

            former = launch.child("router 1")
            await launch.child("router 1").kill()
            assert not launch.runs("router 1")
            assert not alive(former.pid)
            again = await launch.restart("router 1")
            assert again.arguments == former.arguments
            assert again is launch.child("router 1")
            assert launch.runs("router 1")

            with pytest.raises(ValueError, match="no process is called 'uav09'"):
                launch.child("uav09")
            with pytest.raises(ValueError, match="back at the start"):
                await launch.restart("autopilot of uav01")
            launch.child("uav01").pause()
        finally:
            await launch.stop()
        assert not any(alive(child.pid) for child in launch.lives)
        assert not folder.exists()

    asyncio.run(scenario_of_names())
