"""What a mission is measured by: J of the lists it began with, and a bound on J of any lists.

Both concern the tasks of those lists: what was known at the start.
"""

from __future__ import annotations

from dataclasses import dataclass

from coordinator.mission_view.results import lists_objective
from coordinator.planner.bound import upper_bound
from coordinator.planner.options import ShouldStop
from swarm.allocation.problem import Problem
from swarm.protocol.board import is_of_field, mission_of
from swarm.protocol.messages import MissionPhase
from swarm.protocol.registers import Replica


@dataclass(slots=True, eq=False)
class Baseline:
    """Of one flight of a mission."""

    problem: Problem
    """Of the tasks on the first lists."""
    routes: tuple[tuple[int, ...], ...]
    """The first lists, as indices into the problem."""
    objective: float
    """J of these lists [value·s]."""
    bound: float | None = None
    """No lists of those tasks have a larger J [value·s]; None as long as it is not known."""
    sought: bool = False

    def work_out(self, should_stop: ShouldStop) -> float:
        """The bound; takes a while, on one thread."""
        return upper_bound(self.problem, self.routes, should_stop, threads=1).objective


def baseline_of(replica: Replica, name: str) -> Baseline | None:
    """What the mission of that name is measured by.

    Returns:
        None where that is not to be known: in a later epoch than the first, without lists, or
        as long as a task of theirs has not been heard of.
    """
    brief, epoch = replica.brief, replica.epoch
    if brief is None or epoch is None:
        return None
    if epoch.number != 1 or epoch.phase is not MissionPhase.RUNNING:
        return None
    listed = {task for tasks in epoch.routes.values() for task in tasks}
    if not listed or not listed <= replica.board.keys():
        return None
    mission = mission_of(replica, name, brief)
    if is_of_field(mission):  # its lists tell neither waiting nor visits to bases
        return None
    tasks = [task for task in mission.tasks if task.id in listed]
    if len(tasks) != len(listed):
        return None
    index = {str(task.id): place for place, task in enumerate(tasks)}
    routes = tuple(
        tuple(index[task] for task in epoch.routes.get(uav.id, ())) for uav in mission.uavs
    )
    problem = Problem.from_mission(mission, tasks=tasks)
    objective = lists_objective(problem, epoch.routes)
    return None if objective is None else Baseline(problem, routes, objective)
