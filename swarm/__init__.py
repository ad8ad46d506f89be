"""Task allocation for fleets of UAVs, from Python: load, plan, evaluate, simulate, read back.

    import swarm

    mission = swarm.load("valley-survey")           # a scenario file, or one that ships
    plan = swarm.plan(mission, "guided", seed=1)    # lists, J, and a bound on any J
    flight = swarm.simulate(mission, plan, loss=0.3, seed=1)
    print(flight.objective / plan.objective, flight.lost_uavs)

A rule of one's own, a `DecisionRule`, is a function of a `Turn`; plans and flights take it like a
method's name:

    def nearest(turn: swarm.Turn) -> swarm.Task | None:
        return min(turn.open, key=turn.travel_s)

    swarm.simulate(mission, nearest, loss=0.3).value

Missions need no file: `Mission`, `Uav` and `Task` are plain, checked data. Distances are metres
east, north and up from the mission's origin, times are seconds. Wrong input raises `ValueError`
or `SwarmError` with one clear line for each fault. Examples: sim/examples. What is not named here
may change from release to release.

Everything is imported when it is first used. Below this package is also what all processes
share: model, scenarios, allocation, protocol, bus, identity, runtime.
"""

from __future__ import annotations

from swarm.lazy_names import names_from

TYPE_CHECKING = False  # as typing has it, which everybody would have to import for it
if TYPE_CHECKING:
    from swarm.allocation.own_rule import DecisionRule, Turn
    from swarm.interface import Flight, evaluate, load, plan, read_recording, simulate
    from swarm.model import Evaluation, Mission, Plan, Task, TaskId, Uav, UavId
    from swarm.runtime.errors import SwarmError

__version__ = "0.1.0"

__all__ = [
    "DecisionRule",
    "Evaluation",
    "Flight",
    "Mission",
    "Plan",
    "SwarmError",
    "Task",
    "TaskId",
    "Turn",
    "Uav",
    "UavId",
    "__version__",
    "evaluate",
    "load",
    "plan",
    "read_recording",
    "simulate",
]

if not TYPE_CHECKING:  # a type checker must know no other name
    __getattr__ = names_from(
        __name__,
        {
            "swarm.allocation.own_rule": ("DecisionRule", "Turn"),
            "swarm.interface": ("Flight", "evaluate", "load", "plan", "read_recording", "simulate"),
            "swarm.model": ("Evaluation", "Mission", "Plan", "Task", "TaskId", "Uav", "UavId"),
            "swarm.runtime.errors": ("SwarmError",),
        },
    )


def __dir__() -> list[str]:
    """What is meant for users; modules of the package are imported by their names."""
    return sorted(__all__)
