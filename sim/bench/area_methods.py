"""Who flies an area mission in `swarm bench areas`, undisturbed and with a UAV lost.

Undisturbed, lists are flown by our evaluator, whoever made them. With a UAV lost ours is flown by
the real agents and their coordinator in virtual time, as nobody knows beforehand what they make of
it; the fixed split is what `sim.study.baselines.strips` says.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial

import numpy as np

from coordinator.planner.options import after_time
from coordinator.planner.plan import make_plan
from sim.bench.area_coverage import FlownLine, SurveyedGround
from sim.bench.field_methods import index_lists
from sim.bench.field_score import score_in_field
from sim.study.baselines import ortools_field
from sim.study.baselines.strips import Lists, relaunched, strips, taken_over
from sim.world.engine import stream
from sim.world.stochastic_world import StochasticWorld
from sim.world.uncertainty import Uncertainty
from swarm.allocation.field import FieldProblem
from swarm.model import Mission, Plan, TaskId, UavId
from swarm.runtime.clock import Clock
from swarm.runtime.errors import Fault, InputError

GUIDED = "guided"
_FEWEST_UAVS = 2
_EARLIEST_FRAC, _LATEST_FRAC = 0.2, 0.6
"""When a UAV is lost, as shares of the makespan of strips."""


@dataclass(frozen=True, slots=True)
class SearchTimes:
    """How long methods search [s]."""

    guided_s: float
    ortools_s: float


@dataclass(frozen=True, slots=True)
class AreaFlight:
    """What became of one mission by one method."""

    lines: tuple[FlownLine, ...]
    """Those that were flown, each once."""
    objective: float
    """J of eq. 1 of it [value·s]."""
    broken: int = 0
    """Lines on lists that could not be flown where they stood; see `FieldScore`."""


@dataclass(frozen=True, slots=True)
class Loss:
    """A UAV, and when it is lost [s mission time]."""

    uav: UavId
    at_s: float


class AreaCase:
    """A mission whose tasks are the lines of its areas.

    Raises:
        InputError: it has no areas, other tasks beside their lines, areas that appear later, or no
            UAVs that one could be lost of.
    """

    def __init__(self, mission: Mission, times: SearchTimes, clock: Clock) -> None:
        by_id = {task.id: task for task in mission.tasks}
        self.areas = [[by_id.pop(name) for name in area.line_ids] for area in mission.areas]
        later = [area.id for area in mission.areas if area.appears_s > 0.0]
        problem, remedy = None, "name a scenario with [[area]] and no other task"
        if not mission.areas:
            problem = "has no areas to cover"
        elif by_id:
            problem = f"has tasks that are no lines of areas, such as {min(by_id)}"
        elif later:
            problem, remedy = f"does not know {later[0]} from the start", "leave out its appears_s"
        elif len(mission.uavs) < _FEWEST_UAVS:
            problem, remedy = "has nobody to share its areas with", "give it two UAVs or more"
        if problem is not None:
            raise InputError(Fault("SCENARIO", mission.name, problem, remedy))
        lines = tuple(line for area in self.areas for line in area)
        self.mission = replace(mission, tasks=lines)
        self.problem = FieldProblem.from_mission(self.mission)
        self.ground = SurveyedGround(self.mission)
        self.strips = strips(self.problem, self.areas)
        self.times = times
        self._clock = clock
        self._plans: dict[int, Plan] = {}

    def plan(self, seed: int) -> Plan:
        """As `swarm plan` makes it in the time that there is; once for each seed."""
        if seed not in self._plans:
            stop = after_time(self._clock, self.times.guided_s)
            self._plans[seed] = make_plan(
                self.mission, GUIDED, clock=self._clock, seed=seed, stop=stop
            )
        return self._plans[seed]

    def flown(self, lists: Sequence[Sequence[int]]) -> AreaFlight:
        """What our evaluator makes of lists of items."""
        score = score_in_field(self.problem, lists)
        done = np.flatnonzero(np.isfinite(score.end_s)).tolist()
        ids, begin_s, end_s = self.problem.task_ids, score.begin_s.tolist(), score.end_s.tolist()
        lines = tuple(FlownLine(ids[task], begin_s[task], end_s[task]) for task in done)
        return AreaFlight(lines, score.objective, score.broken)

    def loss(self, seed: int) -> Loss:
        """Who is lost in the future of that seed, and when."""
        rng = stream(seed, "area-loss")
        uav = int(rng.integers(self.problem.n_uav))
        makespan_s = max((line.end_s for line in self.flown(self.strips).lines), default=0.0)
        share = float(rng.uniform(_EARLIEST_FRAC, _LATEST_FRAC))
        return Loss(self.problem.uav_ids[uav], share * makespan_s)


@dataclass(frozen=True, slots=True)
class AreaMethod:
    """One way to share an area out."""

    what: str
    fly: Callable[[AreaCase, int], AreaFlight] | None
    """Undisturbed, with a seed; None: as another method does."""
    seeded: bool = False
    """Whether a seed decides what it finds."""
    fly_under_loss: Callable[[AreaCase, int, Loss], AreaFlight] | None = None
    """With a UAV lost; None: it has no word for that."""
    refusal: Callable[[AreaCase], str | None] = lambda _: None
    """Why it has no words for a mission; None if it has."""


def flight_of(plan: Plan) -> AreaFlight:
    """A plan in the field, flown as it is."""
    entries = [entry for own in (plan.schedule or {}).values() for entry in own]
    lines = tuple(
        FlownLine(TaskId(entry.go), entry.begin_s, entry.end_s)
        for entry in entries
        if entry.go in plan.completion_s
    )
    return AreaFlight(lines, plan.objective)


def _fly_guided(case: AreaCase, seed: int) -> AreaFlight:
    return flight_of(case.plan(seed))


def _fly_guided_under_loss(case: AreaCase, seed: int, loss: Loss) -> AreaFlight:
    """Flown by the agents from their plan on, their coordinator alive, in virtual time."""
    mission = case.mission
    happens = Uncertainty(lost_at_s={loss.uav: loss.at_s})
    fate = happens.draw(mission, mission.horizon_s, seed)
    plan = case.plan(seed)
    flown = StochasticWorld(fate, lambda *_: plan, method=GUIDED, seed=seed)
    flown.run()
    result = flown.world.mission_state.result()
    on_line_s = _on_line_s(case.problem)
    lines = tuple(
        FlownLine(task, end_s - on_line_s[result.done_by[task], task], end_s)
        for task, end_s in result.executed_completion_s.items()
    )
    return AreaFlight(lines, result.executed_objective)


def _on_line_s(problem: FieldProblem) -> Mapping[tuple[UavId, TaskId], float]:
    """What a UAV is busy on a line: the mean of both ways, as nobody tells which one it flew."""
    busy_s = problem.line_s.mean(axis=2) + problem.service_s
    return {
        (uav, task): float(busy_s[kind, column])
        for uav, kind in zip(problem.uav_ids, problem.kind.tolist(), strict=True)
        for column, task in enumerate(problem.task_ids)
    }


def _fly_strips(case: AreaCase, seed: int) -> AreaFlight:
    del seed
    return case.flown(case.strips)


def _fly_strips_under_loss(
    case: AreaCase, seed: int, loss: Loss, *, after: Callable[..., tuple[Lists, int]]
) -> AreaFlight:
    del seed
    lost = case.problem.uav_ids.index(loss.uav)
    lists, _ = after(case.problem, case.strips, lost, loss.at_s)
    return case.flown(lists)


def _relaunch_refusal(case: AreaCase) -> str | None:
    return None if case.problem.n_base else "there is no base to set out from anew"


def _fly_ortools(case: AreaCase, seed: int, *, makespan: bool, warm: bool) -> AreaFlight:
    del seed
    problem, limit_s = _without_slots(case.problem), case.times.ortools_s
    start = index_lists(problem, "value-per-time") if warm else None
    return case.flown(ortools_field.field_lists(problem, limit_s, start, makespan=makespan))


def _without_slots(problem: FieldProblem) -> FieldProblem:
    """What its model is given: it knows no slots at bases, and lists are flown with them after."""
    return replace(problem, slots=np.zeros_like(problem.slots))


def _ortools_refusal(case: AreaCase) -> str | None:
    return ortools_field.refusal(_without_slots(case.problem))


def _ortools(what: str, *, makespan: bool, warm: bool) -> AreaMethod:
    start = "from value-per-time's lists" if warm else "from its own start"
    fly = partial(_fly_ortools, makespan=makespan, warm=warm)
    return AreaMethod(
        f"OR-Tools routing on one core, {what}, {start}", fly, refusal=_ortools_refusal
    )


METHODS: Mapping[str, AreaMethod] = {
    GUIDED: AreaMethod(
        "lists as swarm plan makes them, on every core",
        _fly_guided,
        seeded=True,
        fly_under_loss=_fly_guided_under_loss,
    ),
    "strips": AreaMethod(
        "a fixed split, the lines as one vehicle would mow them in pieces of equal length",
        _fly_strips,
        fly_under_loss=partial(_fly_strips_under_loss, after=taken_over),
    ),
    "strips-relaunched": AreaMethod(
        "the same, but who takes over lands first, gets a full battery and sets out anew",
        None,
        fly_under_loss=partial(_fly_strips_under_loss, after=relaunched),
        refusal=_relaunch_refusal,
    ),
    "ortools": _ortools("for J", makespan=False, warm=False),
    "ortools-warm": _ortools("for J", makespan=False, warm=True),
    "ortools-makespan": _ortools("for the earliest end", makespan=True, warm=False),
    "ortools-makespan-warm": _ortools("for the earliest end", makespan=True, warm=True),
}
"""By name, in the order of tables."""
