"""One flight with faults: a fleet drawn from a seed or a scenario, and a schedule; played."""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Iterable, Iterator
from contextlib import AbstractContextManager, nullcontext
from dataclasses import dataclass, replace
from functools import lru_cache
from typing import Final

import numpy as np

from coordinator.planner.field_plan import is_field
from sim.faults.field_missions import random_field_mission
from sim.faults.field_plans import quick_field_plan
from sim.faults.injector import FaultInjector
from sim.faults.invariants import TELEMETRY_S, InvariantChecker
from sim.faults.message_log import Violation
from sim.faults.planted_bugs import BUGS
from sim.faults.schedule import Disturbance, DisturbanceKind, format_schedule, parse_schedule
from sim.faults.separated_missions import random_separated_mission
from sim.world.engine import EventQueue, LocalClock, stream
from sim.world.motion import Point, flown_s
from sim.world.network import NetworkConditions, Topology
from sim.world.position_errors import position_errors
from sim.world.rough_network import RoughNetwork
from sim.world.settings import Planner, WorldSettings, vehicles_of
from sim.world.virtual_world import ONLOOKER, OPERATOR_PATIENCE_S, STANDBY, World
from swarm.allocation import Problem, TeamState, evaluate, rank_of, rule_by_name, run
from swarm.model import Mission, Plan, Task, TaskId, Uav, UavId
from swarm.model.ids import COORDINATOR
from swarm.protocol.timing import PRESETS, LinkKind, LinkPreset
from swarm.runtime.errors import Fault, InputError

MOST_UAVS: Final = 6
MOST_TASKS: Final = 15
FIRST_WITH_ACCELERATION: Final = 1_000_000
"""Of the seeds; missions of those before stay as they were."""
STATUS_S: Final = 2.0
"""Calmer than any preset: nothing but the count of steps depends on it here."""
FIRST_IN_FIELD: Final = 2_000_000
"""Of the seeds whose missions have all of the field's constraints."""
FIRST_WITH_SEPARATION: Final = 3_000_000
"""Of the seeds whose UAVs are to keep a distance as well."""
FIRST_OF_MANY: Final = 4_000_000
"""Of the seeds with separation whose fleets are larger."""
FIRST_ASTRAY: Final = 5_000_000
"""Of the seeds with separation whose UAVs are not quite where they believe to be, and lose
messages all the time; most of their fleets are small, a few large."""
_LEAST: Final = 2.6
"""Of the sizes of fleets that are drawn, before they are rounded down to UAVs."""
CLOCK_PPM: Final = 100.0
AREA_M: Final = 120.0
KINDS_OF_TASK: Final = ("look", "lift")
_HEADER = re.compile(r"fleet((?: [a-z]+=[\w.-]+)+)")
_MOST_LOST_ON_GOOD_LINKS: Final = 0.05
"""Share of messages; where more are lost, timers are those of bad links."""


@dataclass(frozen=True, slots=True)
class Case:
    """One flight with faults, from which everything else follows.

    Raises:
        ValueError: too many UAVs or tasks, or an unknown bug.
    """

    seed: int
    uavs: int
    tasks: int
    popups: int = 0
    """How many of the tasks appear only during the mission."""
    topology: Topology = Topology.ROUTER
    method: str = "greedy"
    standby: bool = False
    """Whether a second coordinator stands by."""
    bug: str = ""
    """A bug put in on purpose; see `sim.faults.planted_bugs`."""
    loss_frac: float = 0.0
    """Share of all messages that are lost, whatever the schedule does besides."""
    astray_m: float = 0.0
    """How far a UAV of the field is at most from where it believes to be, and tells the others."""
    schedule: tuple[Disturbance, ...] = ()
    mission: Mission | None = None
    """Flown instead of one drawn from the seed."""

    def __post_init__(self) -> None:
        drawn, (uavs, tasks) = self.mission is None, most_of(self.seed)
        if drawn and not (1 <= self.uavs <= uavs and 1 <= self.tasks <= tasks):
            raise ValueError(f"1..{uavs} UAVs and 1..{tasks} tasks")
        if self.bug and self.bug not in BUGS:
            raise ValueError(f"{self.bug!r} is none of {', '.join(BUGS)}")
        if not (0.0 <= self.loss_frac <= 1.0 and 0.0 <= self.astray_m < math.inf):
            raise ValueError("loss must be within 0..1, and astray 0 m or more")

    def flown(self) -> Mission:
        """The mission."""
        if self.mission is not None:
            return self.mission
        if self.seed >= FIRST_IN_FIELD:
            apart = self.seed >= FIRST_WITH_SEPARATION
            draw = random_separated_mission if apart else random_field_mission
            return draw(self.seed, most_of(self.seed), self.uavs, self.tasks, self.popups)
        return _random_mission(self.seed, self.uavs, self.tasks, self.popups)

    def link(self) -> LinkPreset:
        """Settings of what joins the fleet, as a user would choose them for so many losses."""
        good = self.loss_frac <= _MOST_LOST_ON_GOOD_LINKS
        chosen = PRESETS[LinkKind.NORMAL if good else LinkKind.BAD]
        return replace(chosen, timing=replace(chosen.timing, status_s=STATUS_S))

    def processes(self) -> tuple[str, ...]:
        """Names of all processes that a fault may befall."""
        standby = (STANDBY,) if self.standby else ()
        return (COORDINATOR, ONLOOKER, *standby, *(uav.id for uav in self.flown().uavs))


@dataclass(frozen=True, slots=True)
class CaseResult:
    """What came of a case."""

    case: Case
    broken: Violation | None
    """The first invariant that did not hold."""
    steps: int
    world: World


def most_of(seed: int) -> tuple[int, int]:
    """How many UAVs and tasks the mission of that seed may have.

    From `FIRST_ASTRAY` on the number of UAVs is drawn from a Pareto distribution of exponent 2:
    a quarter of the fleets have two, a third three, one in seven more than six, one in seventy more
    than twenty.
    """
    if seed >= FIRST_ASTRAY:
        larger = 1.0 - float(stream(seed, "size").random()) * (1.0 - (_LEAST / 41.0) ** 2)
        uavs = int(_LEAST / math.sqrt(larger))
        return uavs, max(MOST_TASKS, uavs * 3 // 2)
    return (40, 60) if seed >= FIRST_OF_MANY else (MOST_UAVS, MOST_TASKS)


def quick_plan(mission: Mission, method: str, seed: int) -> Plan:
    """The greedy lists of a random sequence: how good a plan is does not matter here."""
    if is_field(mission):
        return quick_field_plan(mission, method, seed)
    problem = Problem.from_mission(mission.known_at_start())
    sequence = stream(seed, "sequence").permutation(problem.n_uav).tolist()
    start, rule = TeamState.at_start(problem), rule_by_name("greedy")
    routes, _ = run(problem, start, rank_of(sequence), rule)
    objective, completion_s = evaluate(problem, routes)
    lists = {
        uav: tuple(problem.task_ids[task] for task in route)
        for uav, route in zip(problem.uav_ids, routes, strict=True)
    }
    return Plan(
        scenario=mission.name,
        method=method,
        routes=lists,
        objective=objective,
        completion_s={t: float(completion_s[i]) for i, t in enumerate(problem.task_ids)},
        sequence=tuple(problem.uav_ids[uav] for uav in sequence),
        optimum=None,
        evaluations=1,
        elapsed_s=0.0,
        seed=seed,
    )


def play(
    case: Case,
    make_plan: Planner = quick_plan,
    join: Callable[[EventQueue, NetworkConditions, int], RoughNetwork] = RoughNetwork,
) -> CaseResult:
    """Fly ``case`` to its end, or until an invariant breaks; ``join`` makes its network."""
    network: list[RoughNetwork] = []
    link = case.link()
    conditions = NetworkConditions(
        case.topology, lease_s=link.lease_s, answer_s=link.answer_s, loss_frac=case.loss_frac
    )

    def make_network(queue: EventQueue) -> RoughNetwork:
        network.append(join(queue, conditions, case.seed))
        return network[0]

    mission, judge = case.flown(), InvariantChecker(case.astray_m)
    bug: AbstractContextManager[None] = BUGS[case.bug]() if case.bug else nullcontext()
    with bug:
        world = World(
            mission,
            make_plan,
            method=case.method,
            seed=case.seed,
            timing=link.timing,
            setting=WorldSettings(
                network=make_network,
                clocks=_clocks(case),
                standby=case.standby,
                kept={
                    each.names[0] for each in case.schedule if each.kind is DisturbanceKind.CRASH
                },
                plan_s=0.05,
                telemetry_s=TELEMETRY_S,
                vehicle=vehicles_of(mission, errors=_position_errors(case)),
            ),
            watch=judge,
        )
        injector = FaultInjector(world, network[0], case.schedule)
        judge.attend(world, network[0], injector)
        world.run(limit_s(case))
        judge.conclude()
    return CaseResult(case, judge.broken, world.steps, world)


def limit_s(case: Case) -> float:
    """By then every living agent must be home: one UAV alone could have done it all.

    The slowest flies from task to task across the area; refusals, a missing coordinator, an
    operator who is not heard and a stalemate take their time.
    """
    mission, timing = case.flown(), case.link().timing
    last_s = max((each.ends_s for each in case.schedule), default=0.0)
    slow = min(
        (e.amount or 1.0 for e in case.schedule if e.kind is DisturbanceKind.SLOW), default=1.0
    )
    starts = [uav.position_enu_m for uav in mission.uavs]
    places = np.array([*starts, *(task.position_enu_m for task in mission.tasks)])
    across_m = float(np.linalg.norm(places.max(axis=0) - places.min(axis=0)))
    across_s = max(
        flown_s(across_m, slow * uav.speed_m_s, uav.acceleration_m_s2) for uav in mission.uavs
    )
    appears_s = max((task.appears_s for task in mission.tasks), default=0.0)
    work_s = sum(task.service_s + across_s for task in mission.tasks)
    work_s += sum(each.kind is DisturbanceKind.ADD for each in case.schedule) * across_s
    if any(each.kind is DisturbanceKind.HOLD for each in case.schedule):
        last_s += OPERATOR_PATIENCE_S
    if not mission.is_plain:
        work_s += _field_work_s(mission, across_s) + timing.clear_s
    waits_s = timing.abandon_s + timing.stalemate_s + 2.0 * timing.reconsider_s + 60.0
    return max(last_s, appears_s) + work_s + waits_s


def _field_work_s(mission: Mission, across_s: float) -> float:
    """What may come on top: ways round zones in wind, windows, and a swap before every task."""
    swap_s = max((base.swap_s for base in mission.bases), default=0.0)
    opens_s = max((task.opens_s for task in mission.tasks), default=0.0)
    visit_s = 4.0 * across_s + len(mission.uavs) * swap_s
    return opens_s + (len(mission.tasks) + len(mission.uavs)) * visit_s


def format_case(case: Case) -> str:
    """Lines that `parse_case` reads: the fleet, unless it is a scenario's, then the schedule."""
    facts = {"seed": case.seed, "uavs": case.uavs, "tasks": case.tasks, "popups": case.popups}
    words = {**facts, "topology": case.topology.value, "method": case.method}
    words |= {"standby": "yes" if case.standby else "", "bug": case.bug}
    words |= {"loss": f"{case.loss_frac:g}" if case.loss_frac else ""}
    words |= {"astray": f"{case.astray_m:g}" if case.astray_m else ""}
    header = " ".join(f"{key}={value}" for key, value in words.items() if value != "")
    return f"fleet {header}\n{format_schedule(case.schedule)}"


def parse_case(lines: Iterable[str], source: str) -> Case:
    """The case that `format_case` wrote, or a person.

    Raises:
        InputError: a line cannot be understood.
    """
    remedy = "begin with: fleet seed=N uavs=N tasks=N"
    text = list(lines)
    first = next((n for n, line in enumerate(text) if line.partition("#")[0].strip()), 0)
    found = _HEADER.fullmatch(text[first].strip()) if text else None
    if found is None:
        raise InputError(Fault(source, f"line {first + 1}", "no fleet", remedy))
    words = dict(word.split("=", 1) for word in found[1].split())
    try:
        case = Case(
            seed=int(words.pop("seed", "0")),
            uavs=int(words.pop("uavs", "0")),
            tasks=int(words.pop("tasks", "0")),
            popups=int(words.pop("popups", "0")),
            topology=Topology(words.pop("topology", Topology.ROUTER.value)),
            method=words.pop("method", "greedy"),
            standby=words.pop("standby", "no") == "yes",
            bug=words.pop("bug", ""),
            loss_frac=float(words.pop("loss", "0")),
            astray_m=float(words.pop("astray", "0")),
        )
        if words:
            raise ValueError(f"unknown: {', '.join(words)}")
    except ValueError as fault:
        raise InputError(Fault(source, f"line {first + 1}", str(fault), remedy)) from None
    text[first] = ""
    tasks = [task.id for task in case.flown().tasks]
    return replace(case, schedule=parse_schedule(text, source, case.processes(), tasks))


@lru_cache(maxsize=64)
def _random_mission(seed: int, uavs: int, tasks: int, popups: int) -> Mission:
    """Drawn as the largest of its seed, so that a smaller one is a part of the larger.

    From `FIRST_WITH_ACCELERATION` on most UAVs take their time to change speed.
    """
    rng, more_rng = stream(seed, "mission"), stream(seed, "acceleration")
    fleet = []
    for number in range(MOST_UAVS):
        success = {kind: float(rng.uniform(0.3, 1.0)) for kind in KINDS_OF_TASK}
        if rng.random() < 0.3:
            success[str(rng.choice(KINDS_OF_TASK))] = 0.0
        survival = {kind: float(rng.uniform(0.8, 1.0)) for kind in KINDS_OF_TASK}
        start, speed_m_s = _point(rng, AREA_M / 3.0), float(rng.uniform(4.0, 15.0))
        uav = Uav(UavId(f"u{number}"), start, speed_m_s, success, survival)
        if seed >= FIRST_WITH_ACCELERATION and more_rng.random() < 0.7:
            uav = replace(uav, acceleration_m_s2=float(more_rng.uniform(0.5, 5.0)))
        fleet.append(uav)
    board = []
    for number in range(MOST_TASKS):
        appears_s = float(rng.uniform(1.0, 25.0))
        board.append(
            Task(
                TaskId(f"t{number}"),
                _point(rng, AREA_M),
                value=float(rng.uniform(0.5, 7.0)),
                service_s=float(rng.uniform(0.0, 4.0) * rng.integers(0, 2)),
                kind=str(rng.choice(KINDS_OF_TASK)),
                appears_s=appears_s if number < popups else 0.0,
            )
        )
    return Mission(f"random-{seed}", 300.0, tuple(fleet[:uavs]), tuple(board[:tasks]))


def _point(rng: np.random.Generator, size_m: float) -> tuple[float, float, float]:
    east_m, north_m = rng.uniform(0.0, size_m, 2).tolist()
    return east_m, north_m, 0.0


def _position_errors(case: Case) -> Callable[[str], Iterator[Point]] | None:
    if case.astray_m == 0.0:
        return None
    return lambda uav: position_errors(case.seed, uav, case.astray_m)


def _clocks(case: Case) -> dict[str, LocalClock]:
    """No two clocks show the same, or run quite as fast."""
    clocks = {}
    for name in case.processes():
        rng = stream(case.seed, "clock", name)
        rate = 1.0 + 1e-6 * float(rng.uniform(-CLOCK_PPM, CLOCK_PPM))
        clocks[name] = LocalClock(float(rng.uniform(0.0, 1e4)), rate)
    return clocks
