"""Without faults, fleets of real bridges and simulated autopilots fly the offline plan."""

from __future__ import annotations

import numpy as np
import pytest

from agent.vehicle.config import CommandStyle
from sim.autopilot.firmware import FirmwareModelName
from swarm.model import Mission, Plan, Task, TaskId, Uav, UavId
from tests.support.bridged_fleet import KINDS, BridgedFleet
from tests.support.fleet_builders import plan_for
from tests.support.seeds import seeds

LEG_COSTS_S = {CommandStyle.REPOSITION: 0.25, CommandStyle.MISSION: 0.35}
"""What a leg takes longer than at cruise speed from place to place: the way of the command, or
the upload; and the stop, which is seen by the next position, 0.2 s later at most."""
GIVING_WAY_COSTS_S = 0.05
"""What a leg takes beside where missions give way to targets: two items more to give and to read
back, and two commands more. The time that real firmware saves by it is not simulated."""
FIRST_MISSION_COSTS_S = {FirmwareModelName.ARDUPILOT: 0.0, FirmwareModelName.PX4: 2.2}
"""What the first mission takes beside, which is not flown for 2 s after its upload."""


def scattered(seed: int) -> Mission:
    """Three UAVs and six tasks in a field of 100 m."""
    rng = np.random.default_rng([seed, 17])

    def place() -> tuple[float, float, float]:
        east_m, north_m = rng.uniform(0.0, 100.0, 2).tolist()
        return east_m, north_m, 0.0

    uavs = (
        Uav(UavId(f"u{n}"), (30.0 * n, 0.0, 0.0), float(rng.uniform(6.0, 12.0))) for n in range(3)
    )
    tasks = (
        Task(TaskId(f"t{n}"), place(), float(rng.uniform(1.0, 5.0)), service_s=1.0)
        for n in range(6)
    )
    return Mission(f"scattered-{seed}", 300.0, tuple(uavs), tuple(tasks))


@pytest.mark.parametrize("seed", seeds(1, 3))
@pytest.mark.parametrize(("flavour", "style"), KINDS)
def test_executed_lists_equal_the_offline_plan(
    flavour: FirmwareModelName, style: CommandStyle, seed: int
) -> None:
    mission = scattered(seed)
    plan = plan_for(mission, "greedy", seed)

    def make_plan(_mission: Mission, _method: str, _seed: int) -> Plan:
        return plan

    fleet = BridgedFleet(flavour, style, mission=mission, seed=seed, plan=make_plan).fly()

    fleet.assert_all_done()
    begins_s = FIRST_MISSION_COSTS_S[flavour] if style is CommandStyle.MISSION else 0.0
    gives_way = (flavour, style) == (FirmwareModelName.ARDUPILOT, CommandStyle.MISSION)
    leg_costs_s = LEG_COSTS_S[style] + (GIVING_WAY_COSTS_S if gives_way else 0.0)
    result = fleet.world.mission_state.result()
    assert result.executed_routes == plan.routes
    for route in plan.routes.values():
        for legs, task in enumerate(route, start=1):
            late_s = result.executed_completion_s[task] - plan.completion_s[task]
            assert 0.0 <= late_s <= begins_s + legs * leg_costs_s
