"""What a plan looks like to people and to programs: a table, or one JSON object."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from functools import partial
from typing import Any

from rich.console import Group, RenderableType
from rich.text import Text

from coordinator.mission_view.area_report import areas_in_words
from coordinator.planner.schedule_report import SCHEDULE_COLUMNS, around, flown, reasons
from swarm.model import Mission, Plan, TaskId, Uav, UavId
from swarm.model.plan import LeftOut, Schedule, ScheduleEntry
from swarm.runtime.table import NONE, Column, ResultTable

_LATE = "bold red"


def plan_as_json(plan: Plan) -> dict[str, object]:
    """The plan as `swarm plan --json` prints it, ready for `json.dumps`.

    ``sequence`` is null for method ``exact``, which has none, but in the field, where it decides
    who waits for a slot. Schedules and what is left out come with missions of schema 2 only.
    """
    said: dict[str, object] = {
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
    if plan.schedule is not None:
        said["schedule"] = schedule_as_json(plan.schedule)
        said["left_out"] = {task: reason.value for task, reason in plan.left_out.items()}
        said["required_left_out"] = plan.required_left_out
        said["fewest_left_out"] = plan.fewest_left_out
    return said


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
        schedule=_schedule_from_json(said.get("schedule")),
        left_out={TaskId(task): LeftOut(why) for task, why in said.get("left_out", {}).items()},
        required_left_out=said.get("required_left_out", 0),
        fewest_left_out=said.get("fewest_left_out"),
    )


def schedule_as_json(schedule: Schedule) -> dict[str, object]:
    """Lists by UAV as JSON-ready values, of a plan or of what was flown."""
    return {uav: [_entry_as_json(entry) for entry in entries] for uav, entries in schedule.items()}


def _entry_as_json(entry: ScheduleEntry) -> dict[str, object]:
    return {
        "go": entry.go,
        "from_m": list(entry.from_enu_m),
        "via_m": [list(corner) for corner in entry.via_enu_m],
        "depart_s": entry.depart_s,
        "arrive_s": entry.arrive_s,
        "begin_s": entry.begin_s,
        "end_s": entry.end_s,
        "reversed": entry.is_reversed,
        **({"up_m": list(entry.up_m)} if entry.up_m else {}),
    }


def _schedule_from_json(
    said: Mapping[str, Sequence[Mapping[str, Any]]] | None,
) -> dict[UavId, tuple[ScheduleEntry, ...]] | None:
    if said is None:
        return None
    return {
        UavId(uav): tuple(
            ScheduleEntry(
                go=entry["go"],
                from_enu_m=tuple(entry["from_m"]),
                via_enu_m=tuple(tuple(corner) for corner in entry["via_m"]),
                depart_s=entry["depart_s"],
                arrive_s=entry["arrive_s"],
                begin_s=entry["begin_s"],
                end_s=entry["end_s"],
                is_reversed=entry["reversed"],
                up_m=tuple(entry.get("up_m", ())),
            )
            for entry in entries
        )
        for uav, entries in said.items()
    }


def late_tasks(mission: Mission, plan: Plan) -> list[TaskId]:
    """Tasks completed after the horizon D, whose terms of J are negative, latest first."""
    due = {task.id for task in mission.tasks if task.due_s is not None}
    late = [
        task
        for task, time_s in plan.completion_s.items()
        if time_s > mission.horizon_s and task not in due
    ]
    return sorted(late, key=lambda task: -plan.completion_s[task])


def plan_table(mission: Mission, plan: Plan) -> RenderableType:
    """The plan for a terminal of 80 columns: every list with its times, then its worth."""
    late = late_tasks(mission, plan)
    known = mission.known_at_start()
    heading = Text.assemble(
        (plan.scenario, "bold"),
        f" by {plan.method}: {len(known.uavs)} UAVs, {len(known.tasks)} tasks,"
        f" horizon D = {mission.horizon_s:g} s{around(mission)}",
    )
    if plan.schedule is None:
        columns, says = _LIST_COLUMNS, partial(_stops, mission, plan)
    else:
        columns, says = SCHEDULE_COLUMNS, partial(flown, mission, plan)
    lists = ResultTable(
        columns, [(uav.id, len(plan.routes[uav.id]), says(uav)) for uav in mission.uavs]
    )
    worth = ResultTable(
        (Column("", words=True, style="bold"), Column("", words=True)), _worth(mission, plan, late)
    )
    return Group(heading, "", lists, "", worth)


_LIST_COLUMNS = (
    Column("UAV", words=True, style="bold"),
    Column("tasks"),
    Column("list, each task @ its completion in s", words=True),
)


def _stops(mission: Mission, plan: Plan, uav: Uav) -> Text:
    stops = Text()
    for task in plan.routes[uav.id]:
        time_s = plan.completion_s[task]
        late = time_s > mission.horizon_s
        text = f"{task}@{_shown_s(time_s, mission.horizon_s)}{'!' if late else ''}"
        stops.append(" " if stops else "").append(text, style=_LATE if late else "")
    return stops or Text(NONE, style="dim")


def _worth(mission: Mission, plan: Plan, late: list[TaskId]) -> list[tuple[str, str | Text]]:
    rows: list[tuple[str, str | Text]] = [
        (fact.name, Text(fact.text, style=_LATE if fact.bad else ""))
        for fact in areas_in_words(mission, plan.completion_s)
    ]
    rows.append(("objective J", f"{plan.objective:.4f} value·s"))
    if plan.optimum is None:
        rows.append(("optimum", "not proven: the problem is too large for a quick proof"))
        if plan.bound is not None:
            of_bound = f" ({100.0 * plan.objective / plan.bound:.1f} % of it)" if plan.bound else ""
            rows.append(("bound", f"no lists have more than {plan.bound:.4f} value·s{of_bound}"))
    else:
        gap = "" if plan.gap is None else f", gap {100.0 * plan.gap:.2f} %"
        rows.append(("optimum", f"{plan.optimum:.4f} value·s, proven{gap}"))
    if plan.fewest_left_out is not None and plan.required_left_out > plan.fewest_left_out:
        tasks = "task" if plan.required_left_out == 1 else "tasks"
        least = f"{plan.fewest_left_out} in the optimum"
        if plan.optimum is None:
            least = f"at least {plan.fewest_left_out} in any plan"
        text = f"{plan.required_left_out} required {tasks} left out, {least}"
        rows.append(("", Text(text, style=_LATE)))
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
    if plan.schedule is not None:
        rows += reasons(mission, plan.left_out)
    elif left_out:
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
