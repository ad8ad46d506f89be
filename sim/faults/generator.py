"""Cases made up from a seed, and scenarios flown with faults that are drawn or read from a file."""

from __future__ import annotations

from collections.abc import Collection, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from coordinator.planner.plan import make_plan
from sim.faults.case import FIRST_ASTRAY, Case, CaseResult, most_of, play
from sim.faults.field_missions import fair_drain_frac
from sim.faults.schedule import (
    FIELD_KINDS,
    Disturbance,
    DisturbanceKind,
    parse_schedule,
    shape_of,
)
from sim.world.engine import stream
from sim.world.network import Topology
from sim.world.settings import RestartMemory
from sim.world.uncertainty import Uncertainty
from sim.world.virtual_world import ONLOOKER, STANDBY
from swarm.model import Mission, Plan
from swarm.model.ids import COORDINATOR
from swarm.runtime.clock import SystemClock
from swarm.runtime.errors import Fault, InputError, remedy_for_name

ASTRAY_M = 1.0
"""At most; ways are planned 2 m farther apart than UAVs are to be, for one of either."""
SPAN_S = 40.0
"""Faults of random fleets begin within this time, which most of their missions take."""


def kinds_of(text: str, source: str) -> tuple[DisturbanceKind, ...]:
    """``all``, or kinds with commas between.

    Raises:
        InputError: there is no such kind.
    """
    if text == "all":
        return tuple(DisturbanceKind)
    kinds = []
    for word in text.split(","):
        if word not in list(DisturbanceKind):
            remedy = remedy_for_name(word, DisturbanceKind, "write all, a file, or some of")
            raise InputError(Fault(source, word, "no kind of fault", remedy))
        kinds.append(DisturbanceKind(word))
    return tuple(kinds)


def random_case(
    seed: int, kinds: Collection[DisturbanceKind] = tuple(DisturbanceKind), bug: str = ""
) -> Case:
    """A fleet of 2 to 6 UAVs with 3 to 15 tasks, or more, and 1 to 6 things that go wrong.

    From `FIRST_ASTRAY` on UAVs are up to `ASTRAY_M` from where they believe to be, and in two of
    three missions up to 20 % of all messages are lost.
    """
    rng, (most_uavs, most_tasks) = stream(seed, "case"), most_of(seed)
    tasks = int(rng.integers(3, most_tasks + 1))
    case = Case(
        seed=seed,
        uavs=most_uavs if seed >= FIRST_ASTRAY else int(rng.integers(2, most_uavs + 1)),
        tasks=tasks,
        popups=int(rng.integers(0, 1 + tasks // 3)),
        topology=Topology(str(rng.choice([each.value for each in Topology]))),
        method="guided" if rng.random() < 0.3 else "greedy",
        standby=bool(rng.random() < 0.3),
        bug=bug,
    )
    if seed >= FIRST_ASTRAY:
        lost_frac = max(0.0, float(stream(seed, "loss").uniform(-0.1, 0.2)))
        case = replace(case, loss_frac=round(lost_frac, 3), astray_m=ASTRAY_M)
    schedule = random_schedule(seed, kinds, case.flown(), SPAN_S, standby=case.standby)
    return replace(case, schedule=schedule)


def random_schedule(
    seed: int,
    kinds: Collection[DisturbanceKind],
    mission: Mission,
    span_s: float,
    *,
    standby: bool = False,
) -> tuple[Disturbance, ...]:
    """What goes wrong in one flight of ``mission``, all of it beginning within ``span_s``.

    Kinds of the field alone are drawn by themselves, so that the others stay what they were; of
    a mission that is not in the field there are none.
    """
    plain, of_field = sorted(set(kinds) - FIELD_KINDS), sorted(FIELD_KINDS.intersection(kinds))
    coordinators = [COORDINATOR, STANDBY] if standby else [COORDINATOR]

    def several(name: str, choice: Sequence[DisturbanceKind], most: int) -> list[Disturbance]:
        rng = stream(seed, name)
        return [
            _draw(rng, choice[int(rng.integers(len(choice)))], mission, coordinators, span_s)
            for _ in range(int(rng.integers(1, 1 + most)))
        ]

    drawn = several("schedule", plain, 6) if plain else []
    if of_field and not mission.is_plain:
        drawn += several("field schedule", of_field, 3)
    return tuple(sorted(drawn, key=lambda each: each.at_s))


def _draw(
    rng: np.random.Generator,
    kind: DisturbanceKind,
    mission: Mission,
    coordinators: Sequence[str],
    span_s: float,
) -> Disturbance:
    shape = shape_of(kind)
    uavs = [uav.id for uav in mission.uavs]
    lasts_s = None
    if shape.lasts and (shape.must_end or rng.random() < 0.8):
        lasts_s = round(float(np.exp(rng.uniform(np.log(0.1), np.log(0.5 * span_s)))), 2)
    memory = None
    if shape.memory and lasts_s is not None:
        memory = RestartMemory(str(rng.choice([each.value for each in RestartMemory])))
    at_s = round(float(rng.uniform(0.0, span_s)), 2)
    names = _names(rng, shape.names, coordinators, uavs, [t.id for t in mission.tasks])
    return Disturbance(
        at_s=at_s,
        kind=kind,
        names=names,
        lasts_s=lasts_s,
        amount=_amount(rng, kind, mission, names) if shape.amount else None,
        memory=memory,
    )


def _amount(
    rng: np.random.Generator, kind: DisturbanceKind, mission: Mission, names: Sequence[str]
) -> float:
    if kind is DisturbanceKind.DRAIN:
        most = fair_drain_frac(mission, names[0])
        return max(0.01, round(most * float(rng.uniform(0.2, 1.0)), 2))
    if not mission.is_plain and kind is DisturbanceKind.SLOW:  # a reserve is not for more
        return round(float(rng.uniform(0.85, 1.0)), 2)
    low, high = {DisturbanceKind.WEATHER: (0.02, 0.5), DisturbanceKind.SKEW: (0.05, 1.0)}.get(
        kind, (0.4, 1.0)
    )
    return round(float(rng.uniform(low, high)), 2)


def _names(
    rng: np.random.Generator,
    wanted: str,
    coordinators: Sequence[str],
    uavs: Sequence[str],
    tasks: Sequence[str],
) -> tuple[str, ...]:
    processes = [*coordinators, *uavs]

    def one(of: Sequence[str]) -> str:
        return of[int(rng.integers(len(of)))]

    match wanted:
        case "process":
            return (one(processes),)
        case "uav":
            return (one(uavs),)
        case "pair":
            first = one(processes)
            return first, one([name for name in processes if name != first])
        case "task":
            return (one(tasks),)
        case "uav task":
            return one(uavs), one(tasks)
        case "group":
            everyone = [*processes, ONLOOKER]
            inside = [name for name in everyone if rng.random() < 0.4]
            return tuple(inside) if 0 < len(inside) < len(everyone) else (one(everyone),)
        case _:
            return ()


def fly_with_faults(
    mission: Mission, *, method: str, seed: int, uncertainty: Uncertainty, faults: str
) -> CaseResult:
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
    lost = tuple(
        Disturbance(at_s, DisturbanceKind.LOSE, (str(uav),)) for uav, at_s in fate.lost_at_s.items()
    )
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
