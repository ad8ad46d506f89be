"""The functions of ``import swarm``: what they take, and what they give.

Missions and plans are data of this package; planning, flying and recordings are not. So a
function that needs an upper package finds it by an entry point of the group
``peckorder.interface``, as `swarm.cli` finds its commands: nothing here imports upwards, and
everything is imported when it is called.
"""

from __future__ import annotations

import os
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from importlib.metadata import entry_points
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypedDict, Unpack

from swarm.model import Evaluation, Mission, Plan, TaskId, UavId
from swarm.model.plan import Routes
from swarm.runtime.errors import SwarmError
from swarm.runtime.extras import missing_extra

if TYPE_CHECKING:
    from swarm.allocation.own_rule import DecisionRule
    from swarm.protocol.events import CommonEvent

__all__ = [
    "INTERFACE_GROUP",
    "Flight",
    "UncertaintyOptions",
    "evaluate",
    "load",
    "plan",
    "read_recording",
    "simulate",
]

INTERFACE_GROUP = "peckorder.interface"


class UncertaintyOptions(TypedDict, total=False):
    """What may go wrong in `simulate`; the options of ``swarm simulate`` by the same names.

    Each kind is drawn from the seed by itself, so asking for one leaves the others as they were.
    """

    loss: float
    """Probability that a UAV is lost, at a random moment of the mission."""
    popup: float
    """Probability that a task known at the start appears during the mission instead."""
    popups_per_min: float
    """Rate of tasks that appear besides."""
    withdrawals_per_min: float
    """Rate at which a random task is taken off the board."""
    outcomes: bool
    """Whether attempts succeed or fail by chance; otherwise each is worth its p."""
    survival: bool
    """Whether tasks cost UAVs by chance; otherwise later tasks are worth their S."""
    speed_frac: float
    """Share of its cruise speed at which every UAV really flies."""
    drain_frac: float
    """How many times as fast as they should batteries really drain."""
    speed_sd_frac: float
    """Standard deviation of a UAV's speed, as a share of its cruise speed."""
    leg_sd_frac: float
    """The same for each leg by itself."""
    wind_m_s: float
    """Speed of a steady wind from a random direction [m/s]."""
    position_error_m: float
    """Standard deviation, east and north each, of where a UAV stops for a task [m]."""
    message_loss: float
    """Share of messages that never arrive."""
    delay_s: float
    """Least delay of a message [s]."""
    jitter_s: float
    """Mean of what comes on top of it [s]."""
    partitions_per_min: float
    """Rate at which half of the fleet is cut off from the rest and the coordinator."""
    partition_s: float
    """How long such a partition lasts [s]."""
    lost_at_s: Mapping[UavId, float]
    """UAVs that are lost in any case, and when [s mission time]."""
    withdrawn_at_s: Mapping[TaskId, float]
    """Tasks that are withdrawn in any case, and when [s mission time]."""


@dataclass(frozen=True, slots=True, eq=False)
class Flight:
    """What became of a mission, simulated or recorded."""

    mission: Mission
    """With the tasks that appeared in flight."""
    plan: Plan | None
    """What it began with; None for a recording that missed it."""
    routes: Routes
    """Visits that ended done, in order, duplicates included."""
    completion_s: Mapping[TaskId, float]
    """First successful visit of each task [s mission time]."""
    objective: float
    """J, eq. 1, over the tasks done, with the times that came about [value·s]."""
    value: float
    """The same, but where outcomes are drawn by chance only success counts [value·s]."""
    done: tuple[TaskId, ...]
    failed: tuple[TaskId, ...]
    open: tuple[TaskId, ...]
    """Neither done nor failed nor withdrawn."""
    lost_uavs: tuple[UavId, ...]
    duplicate_visits: int
    """Visits to a task that had already been done."""
    makespan_s: float
    """Latest completion [s mission time]."""
    epochs: int
    """Plans that were in force, one after the other."""
    story: tuple[tuple[float | None, str], ...]
    """What happened, line by line, with mission time [s], which is None before the start."""
    facts: Sequence[tuple[float, CommonEvent]] = field(default=(), repr=False)
    """Of a recording: all that its recorder heard, and when by its clock [s]; messages are
    `swarm.protocol.events.MessageReceived`. Of a simulation nothing."""
    cut_short: str | None = None
    """Of a flight that ends before its time: where and why, in a line."""


def load(scenario: str | os.PathLike[str]) -> Mission:
    """The mission of a scenario file, or of one that ships, such as ``"table-1"``.

    Args:
        scenario: path of the file, or a shipped name; a path that exists wins.

    Raises:
        SwarmError: there is none, or it is wrong; a line for each fault.
    """
    from swarm.scenario import load_scenario, resolve_scenario

    return load_scenario(resolve_scenario(os.fspath(scenario)))


def plan(
    mission: Mission,
    method: str | DecisionRule = "guided",
    *,
    seed: int = 0,
    time_limit_s: float | None = None,
    bound: bool = True,
) -> Plan:
    """Plan a mission, as far as it is known at its start.

    The same seed gives the same plan, unless a limit in time cuts the search short.

    Args:
        mission: what to plan.
        method: ``"greedy"`` or ``"lookahead"``, the rules of the paper with the best priority
            sequence; ``"guided"``, optimised lists; ``"exact"``, the proven best lists of a small
            mission; or a rule of one's own, by which the UAVs decide in the mission's order.
        seed: of what is drawn in the search; >= 0.
        time_limit_s: for all of it, the bound included [s]; some seconds by itself when None.
            All of it is the proof's with ``"exact"``.
        bound: where the optimum cannot be proven, spend some seconds on an upper bound on J.

    Returns:
        Lists, times and J; ``optimum`` or ``bound`` say how good it is. In the field also the
        schedule, and what is left out.

    Raises:
        ValueError: there is no such method, or a number is out of range.
        SwarmError: ``"exact"`` was asked of a mission that is too large for it, or another method
            does not heed what the mission asks for in the field.
    """
    made: Plan = _implementation("plan")(
        mission, method, seed=seed, time_limit_s=time_limit_s, bound=bound
    )
    return made


def evaluate(mission: Mission, routes: Mapping[UavId, Sequence[TaskId]]) -> Evaluation:
    """What lists are worth by eq. 1.

    Args:
        mission: whose UAVs and tasks, pop-ups included.
        routes: task ids by UAV id in order of execution; UAVs that are left out do nothing. In the
            field also the bases where batteries are changed, as ``"base:b0"``; lines are flown
            whichever way is better at that place of the list.

    Raises:
        ValueError: an id is unknown, a task is on the lists twice, or in the field one cannot be
            done there.
    """
    from swarm.allocation.objective import evaluate as value
    from swarm.allocation.problem import Problem

    if unknown := routes.keys() - {uav.id for uav in mission.uavs}:
        raise ValueError(f"no such UAV in {mission.name}: {', '.join(sorted(unknown))}")
    if not mission.is_flat:
        from swarm.allocation.field.lists import evaluate_in_field

        return evaluate_in_field(mission, routes)
    problem = Problem.from_mission(mission)
    columns = {task: column for column, task in enumerate(problem.task_ids)}
    wanted = [task for tasks in routes.values() for task in tasks]
    if lacking := [task for task in wanted if task not in columns]:
        raise ValueError(f"no such task in {mission.name}: {', '.join(lacking)}")
    lists = [[columns[task] for task in routes.get(uav, ())] for uav in problem.uav_ids]
    objective, times_s = value(problem, lists)
    return Evaluation(objective, {task: float(times_s[columns[task]]) for task in wanted})


def simulate(
    mission: Mission,
    policy: str | Plan | DecisionRule = "guided",
    *,
    seed: int = 0,
    coordinator_lost_s: float | None = None,
    record: str | os.PathLike[str] | None = None,
    **uncertainty: Unpack[UncertaintyOptions],
) -> Flight:
    """Fly a mission in virtual time, by the agents' real code, to its end.

    Unless told otherwise nothing is uncertain, and what is flown is what was planned. The same
    arguments give the same flight.

    Args:
        mission: pop-ups included.
        policy: what the fleet flies by: the method of a plan (``"guided"``, ``"greedy"`` or
            ``"lookahead"``); a plan made by one of them; or a rule of one's own, followed by
            agents without a coordinator once the mission has begun.
        seed: of the planner and of all that is uncertain; >= 0.
        coordinator_lost_s: mission time at which the coordinator dies [s]; None if it lives.
        record: a new file that is to hold a recording, ``FILE.mcap``; needs the extra ``ground``.
        **uncertainty: what may go wrong; see `swarm.interface.UncertaintyOptions`.

    Raises:
        ValueError: no fleet can fly by that, or a number is out of range.
        SwarmError: the recording cannot be written.
    """
    flown: Flight = _implementation("simulate")(
        mission,
        policy,
        seed=seed,
        coordinator_lost_s=coordinator_lost_s,
        record=record,
        **uncertainty,
    )
    return flown


def read_recording(recording: str | os.PathLike[str]) -> Flight:
    """What became of a mission that was recorded with ``--record`` or ``swarm record``.

    Args:
        recording: path of the file, ``FILE.mcap``; up to where it is torn, if it is.

    Raises:
        SwarmError: it cannot be read, is no recording, or the extra ``ground`` is not installed.
    """
    told: Flight = _implementation("read_recording")(Path(recording))
    return told


def _implementation(name: str) -> Any:
    """What an upper package offers under ``name``, with one line for what is not installed."""
    found = [entry for entry in entry_points(group=INTERFACE_GROUP) if entry.name == name]
    if not found:
        raise SwarmError(f"swarm.{name} is not installed here; install peckorder anew")

    def call(*arguments: Any, **options: Any) -> Any:
        try:
            return found[0].load()(*arguments, **options)
        except ModuleNotFoundError as error:
            if (lacking := missing_extra(error, f"swarm.{name}")) is None:
                raise
            raise lacking from error

    return call
