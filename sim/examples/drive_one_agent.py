# %% [markdown]
"""# Drive one agent: its real core and MAVLink bridge, against the model of an ArduCopter.

    python -m sim.examples.drive_one_agent

In virtual time, in this one process: a queue says what time it is, MAVLink frames go from the
bridge to the autopilot's model and back, and what the vehicle reports goes to the agent. Shows
the seams of the runtime: cores take events and give actions, and know neither clock nor socket.
"""

# %%
from __future__ import annotations

from collections.abc import Callable

import swarm
from agent.core.interface import Telemetry, VehicleReport
from agent.vehicle.config import BridgeConfig
from sim.autopilot.config import VehicleConfig
from sim.world.bridged_vehicle import BridgedVehicle, Equipment
from sim.world.engine import EventQueue
from sim.world.network import IdealNetwork
from sim.world.settings import WorldSettings
from sim.world.virtual_world import World
from swarm.model.frames import DEFAULT_ORIGIN

MISSION = swarm.Mission(
    name="alone",
    horizon_s=300.0,
    uavs=(swarm.Uav(swarm.UavId("quad"), (0.0, 0.0, 0.0), speed_m_s=8.0),),
    tasks=(
        swarm.Task(swarm.TaskId("gate"), (60.0, 0.0, 0.0), value=2.0, service_s=5.0),
        swarm.Task(swarm.TaskId("barn"), (60.0, 45.0, 0.0), value=1.0),
    ),
)

# %% [markdown]
"""The vehicle: a simulated autopilot behind the bridge that also flies real ones. What it reports
is printed and handed on.
"""


# %%
def make_vehicle(
    queue: EventQueue, uav: str, report: Callable[[VehicleReport], None]
) -> BridgedVehicle:
    """A simulated autopilot behind a bridge."""

    def tell(news: VehicleReport) -> None:
        if not isinstance(news, Telemetry):
            print(f"{queue.now_s():7.2f} s  {uav}: {news}")
        report(news)

    flies = VehicleConfig(1, MISSION.uavs[0].position_enu_m, DEFAULT_ORIGIN, cruise_m_s=8.0)
    return BridgedVehicle(queue, uav, tell, Equipment(flies, BridgeConfig(1, DEFAULT_ORIGIN)), 0)


def make_plan(mission: swarm.Mission, method: str, seed: int) -> swarm.Plan:
    """What the coordinator of this world plans by."""
    return swarm.plan(mission, method, seed=seed, bound=False)


# %% [markdown]
"""The world: a queue of events, a bus that loses nothing, the coordinator, and the agent. It flies
to both tasks and lands.
"""

# %%
world = World(
    MISSION,
    make_plan,
    method="greedy",
    seed=0,
    setting=WorldSettings(lambda queue: IdealNetwork(queue, 0.0), vehicle=make_vehicle),
)
world.run(limit_s=600.0)
result = world.mission_state.result()
print(f"done: {', '.join(result.done)}; J {result.executed_objective:.2f} value·s")
