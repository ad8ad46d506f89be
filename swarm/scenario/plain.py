"""The gate before commands that cannot do all that a scenario of schema 2 may ask for.

None of them may pass over a word of the file in silence. `require_plain` is called where a
command loads its scenario, and goes from there when the command can do it all.
"""

from __future__ import annotations

from collections.abc import Sequence

from swarm.model import Mission, Task
from swarm.model.mission import PLAIN_CONSTRAINTS, chances
from swarm.runtime.errors import Fault, InputError

_TABLES = {"base": "[[base]]", "zone": "[[zone]]"}


def require_plain(mission: Mission, command: str) -> None:
    """Refuse a mission that asks for more than the paper's, on behalf of ``command``.

    Raises:
        InputError: one line, with every key that the command does not heed.
    """
    asked = [_TABLES.get(key, key) for key in mission.constraints if key not in PLAIN_CONSTRAINTS]
    asked += [f"task {task.id}, at which nobody can succeed" for task in nobody_can(mission)[:1]]
    if asked:
        words = " and ".join([", ".join(asked[:-1]), asked[-1]] if asked[1:] else asked)
        problem = f"does not heed {words} of mission {mission.name} yet"
        remedy = "leave them out" if asked[1:] else "leave it out"
        raise InputError(Fault(command, "", problem, remedy))


def nobody_can(mission: Mission) -> Sequence[Task]:
    """The tasks at which no UAV can succeed, whatever else there is; none without UAVs."""
    hopeless = mission.tasks if mission.uavs else ()
    for uav in mission.uavs:
        odds = chances(uav.success, hopeless, mission.success_default)
        hopeless = tuple(task for task, p in zip(hopeless, odds, strict=True) if p <= 0.0)
        if not hopeless:
            break
    return hopeless
