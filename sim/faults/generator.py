"""Cases made up from a seed: how large the fleet is, and what goes wrong when.

Leaves out: the mission itself, which a case draws from its seed (sim.faults.case).
"""

from __future__ import annotations

from collections.abc import Collection, Sequence
from dataclasses import replace

import numpy as np

from sim.faults.case import MOST_TASKS, MOST_UAVS, Case
from sim.faults.schedule import Disturbance, Kind, shape_of
from sim.rough_network import Topology
from sim.streams import stream
from sim.world import ONLOOKER, STANDBY, Recall
from swarm.errors import Fault as InputFault
from swarm.errors import InputError
from swarm.model import Mission
from swarm.model.ids import COORDINATOR
from swarm.suggest import instead

__all__ = ["kinds_of", "random_case", "random_schedule"]

SPAN_S = 40.0
"""Faults of random fleets begin within this time, which most of their missions take."""


def kinds_of(text: str, source: str) -> tuple[Kind, ...]:
    """``all``, or kinds with commas between.

    Raises:
        InputError: there is no such kind.
    """
    if text == "all":
        return tuple(Kind)
    kinds = []
    for word in text.split(","):
        if word not in list(Kind):
            remedy = instead(word, Kind, "write all, a file, or some of")
            raise InputError(InputFault(source, word, "no kind of fault", remedy))
        kinds.append(Kind(word))
    return tuple(kinds)


def random_case(seed: int, kinds: Collection[Kind] = tuple(Kind), bug: str = "") -> Case:
    """A fleet of 2 to 6 UAVs with 3 to 15 tasks, and 1 to 6 things that go wrong."""
    rng = stream(seed, "case")
    tasks = int(rng.integers(3, MOST_TASKS + 1))
    case = Case(
        seed=seed,
        uavs=int(rng.integers(2, MOST_UAVS + 1)),
        tasks=tasks,
        popups=int(rng.integers(0, 1 + tasks // 3)),
        topology=Topology(str(rng.choice([each.value for each in Topology]))),
        method="guided" if rng.random() < 0.3 else "greedy",
        standby=bool(rng.random() < 0.3),
        bug=bug,
    )
    schedule = random_schedule(seed, kinds, case.flown(), SPAN_S, standby=case.standby)
    return replace(case, schedule=schedule)


def random_schedule(
    seed: int,
    kinds: Collection[Kind],
    mission: Mission,
    span_s: float,
    *,
    standby: bool = False,
) -> tuple[Disturbance, ...]:
    """What goes wrong in one flight of ``mission``, all of it beginning within ``span_s``."""
    rng = stream(seed, "schedule")
    choice = sorted(kinds)
    coordinators = [COORDINATOR, STANDBY] if standby else [COORDINATOR]
    drawn = [
        _draw(rng, choice[int(rng.integers(len(choice)))], mission, coordinators, span_s)
        for _ in range(int(rng.integers(1, 7)))
    ]
    return tuple(sorted(drawn, key=lambda each: each.at_s))


def _draw(
    rng: np.random.Generator,
    kind: Kind,
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
        memory = Recall(str(rng.choice([each.value for each in Recall])))
    return Disturbance(
        at_s=round(float(rng.uniform(0.0, span_s)), 2),
        kind=kind,
        names=_names(rng, shape.names, coordinators, uavs, [t.id for t in mission.tasks]),
        lasts_s=lasts_s,
        amount=_amount(rng, kind) if shape.amount else None,
        memory=memory,
    )


def _amount(rng: np.random.Generator, kind: Kind) -> float:
    low, high = {Kind.WEATHER: (0.02, 0.5), Kind.SKEW: (0.05, 1.0)}.get(kind, (0.4, 1.0))
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
