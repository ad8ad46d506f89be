"""What a plan looks like to people and to programs: a table, or one JSON object."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from rich.console import Group, RenderableType
from rich.text import Text

from swarm.model import Mission, Plan, TaskId, UavId
from swarm.runtime.table import NONE, Column, ResultTable

_LATE = "bold red"


def plan_as_json(plan: Plan) -> dict[str, object]:
    """The plan as `swarm plan --json` prints it, ready for `json.dumps`.

    ``sequence`` is null for method ``exact``, which has none.
    """
    return {
        "scenario": plan.scenario,
        "method": plan.method,
        "objective": plan.objective,
        "sequence": None if plan.sequence is None else list(plan.sequence),
        "routes": {uav: list(tasks) for uav, tasks in plan.routes.items()},
        "completion_s": dict(plan.completion_s),
        "optimum": plan.optimum,
        "gap": plan.gap,
        "evaluations": plan.evaluations,
        "elapsed_s": plan.elapsed_s,
        "seed": plan.seed,
        "bound": plan.bound,
        "basis": plan.basis,
    }


def plan_from_json(said: Mapping[str, Any]) -> Plan:
    """The plan that `plan_as_json` wrote; inverse of it but for the derived gap."""
    sequence = said["sequence"]
    return Plan(
        scenario=said["scenario"],
        method=said["method"],
        routes={UavId(uav): tuple(tasks) for uav, tasks in said["routes"].items()},
        objective=said["objective"],
        completion_s=dict(said["completion_s"]),
        sequence=None if sequence is None else tuple(sequence),
        optimum=said["optimum"],
        evaluations=said["evaluations"],
        elapsed_s=said["elapsed_s"],
        seed=said["seed"],
        bound=said["bound"],
    )


def late_tasks(mission: Mission, plan: Plan) -> list[TaskId]:
    """Tasks completed after the horizon D, whose terms of J are negative, latest first."""
    late = [task for task, time_s in plan.completion_s.items() if time_s > mission.horizon_s]
    return sorted(late, key=lambda task: -plan.completion_s[task])


def plan_table(mission: Mission, plan: Plan) -> RenderableType:
    """The plan for a terminal of 80 columns: every list with its times, then its worth."""
    late = late_tasks(mission, plan)
    known = mission.known_at_start()
    heading = Text.assemble(
        (plan.scenario, "bold"),
        f" by {plan.method}: {len(known.uavs)} UAVs, {len(known.tasks)} tasks,"
        f" horizon D = {mission.horizon_s:g} s",
    )
    lists = ResultTable(
        (
            Column("UAV", words=True, style="bold"),
            Column("tasks"),
            Column("list, each task @ its completion in s", words=True),
        ),
        [(uav, len(route), _stops(mission, plan, route)) for uav, route in plan.routes.items()],
    )
    worth = ResultTable(
        (Column("", words=True, style="bold"), Column("", words=True)), _worth(mission, plan, late)
    )
    return Group(heading, "", lists, "", worth)


def _stops(mission: Mission, plan: Plan, route: Sequence[TaskId]) -> Text:
    stops = Text()
    for task in route:
        time_s = plan.completion_s[task]
        late = time_s > mission.horizon_s
        text = f"{task}@{_shown_s(time_s, mission.horizon_s)}{'!' if late else ''}"
        stops.append(" " if stops else "").append(text, style=_LATE if late else "")
    return stops or Text(NONE, style="dim")


def _worth(mission: Mission, plan: Plan, late: list[TaskId]) -> list[tuple[str, str | Text]]:
    rows: list[tuple[str, str | Text]] = [("objective J", f"{plan.objective:.4f} value·s")]
    if plan.optimum is None:
        rows.append(("optimum", "not proven: the problem is too large for a quick proof"))
        if plan.bound is not None:
            of_bound = f" ({100.0 * plan.objective / plan.bound:.1f} % of it)" if plan.bound else ""
            rows.append(("bound", f"no lists have more than {plan.bound:.4f} value·s{of_bound}"))
    else:
        gap = "" if plan.gap is None else f", gap {100.0 * plan.gap:.2f} %"
        rows.append(("optimum", f"{plan.optimum:.4f} value·s, proven{gap}"))
    if plan.sequence is not None:
        rows.append(("sequence", ", ".join(plan.sequence)))
    if late:
        shown = ", ".join(
            f"{task} at {_shown_s(plan.completion_s[task], mission.horizon_s)} s"
            for task in late[:5]
        )
        more = f" and {len(late) - 5} more" if len(late) > 5 else ""
        text = f"{len(late)} after D, marked ! and counting against J: {shown}{more}"
        rows.append(("late", Text(text, style=_LATE)))
    known = mission.known_at_start()
    left_out = [task.id for task in known.tasks if task.id not in plan.completion_s]
    if left_out:
        text = f"on no list, for want of a capable UAV: {', '.join(left_out)}"
        rows.append(("left out", Text(text, style=_LATE)))
    pop_ups = len(mission.tasks) - len(known.tasks)
    if pop_ups:
        noun = "task appears" if pop_ups == 1 else "tasks appear"
        rows.append(("pop-ups", f"{pop_ups} {noun} later and cannot be planned"))
    runs = "evaluation" if plan.evaluations == 1 else "evaluations"
    spent = f"{plan.evaluations} {runs}, {plan.elapsed_s:.3f} s, seed {plan.seed}"
    if plan.evaluations == 0 and plan.method in ("greedy", "lookahead") and plan.completion_s:
        spent += "; stopped in the first one, so the last decisions are greedy"
    rows.append(("search", spent))
    return rows


def _shown_s(time_s: float, horizon_s: float) -> str:
    """Seconds, with digits as the mission's length deserves."""
    return f"{time_s:.{2 if horizon_s < 10.0 else 1 if horizon_s < 10_000.0 else 0}f}"
