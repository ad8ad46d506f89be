"""A scenario flown with faults: drawn from kinds and a seed, or read from a file.

Leaves out: what faults do (sim.faults.director) and how the flight is shown (sim.simulate_command).
"""

from __future__ import annotations

from pathlib import Path

from coordinator.planner.plan import make_plan
from sim.faults.case import Case, Verdict, play
from sim.faults.generator import kinds_of, random_schedule
from sim.faults.schedule import Disturbance, Kind, parse_schedule
from sim.uncertainty import Uncertainty
from sim.world import ONLOOKER
from swarm.clock import SystemClock
from swarm.errors import Fault, InputError
from swarm.model import Mission, Plan
from swarm.model.ids import COORDINATOR

__all__ = ["fly_with_faults", "read_lines"]


def fly_with_faults(
    mission: Mission, *, method: str, seed: int, uncertainty: Uncertainty, faults: str
) -> Verdict:
    """Fly ``mission`` in virtual time on a network on which things go wrong.

    Args:
        mission: the scenario, pop-ups included.
        method: planning method whose rule the agents use.
        seed: of the planner and of all that is uncertain.
        uncertainty: losses and pop-ups beside the faults.
        faults: kinds of fault, ``all``, or the name of a file with a schedule.

    Raises:
        InputError: ``faults`` names neither kinds nor a schedule that can be read.
    """

    def plan(what: Mission, how: str, with_seed: int) -> Plan:
        return make_plan(what.known_at_start(), how, clock=SystemClock(), seed=with_seed)

    span_s = max(plan(mission, method, seed).completion_s.values(), default=0.0)
    fate = uncertainty.draw(mission, span_s, seed)
    lost = tuple(Disturbance(at_s, Kind.LOSE, (str(uav),)) for uav, at_s in fate.lost_at_s.items())
    case = Case(
        seed=seed,
        uavs=len(mission.uavs),
        tasks=len(mission.tasks),
        method=method,
        schedule=(*lost, *_schedule(faults, seed, fate.mission, span_s)),
        mission=fate.mission,
    )
    return play(case, plan)


def read_lines(path: Path) -> list[str]:
    """The lines of a text file.

    Raises:
        InputError: it cannot be read.
    """
    try:
        return path.read_text(encoding="utf-8").splitlines()
    except (OSError, UnicodeDecodeError) as error:
        problem = str(getattr(error, "strerror", None) or error)
        fault = Fault(str(path), "", f"cannot be read: {problem}", "name a readable file")
        raise InputError(fault) from None


def _schedule(faults: str, seed: int, mission: Mission, span_s: float) -> tuple[Disturbance, ...]:
    path = Path(faults)
    if not path.is_file():
        return random_schedule(seed, kinds_of(faults, "--faults"), mission, span_s)
    processes = (COORDINATOR, ONLOOKER, *(uav.id for uav in mission.uavs))
    return parse_schedule(read_lines(path), faults, processes, [task.id for task in mission.tasks])
