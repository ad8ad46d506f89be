from __future__ import annotations

import io
from dataclasses import replace

from rich.console import Console

from coordinator.planner.plan_report import plan_table
from coordinator.planner.schedule_report import charge_at_landing, flown, waits_s
from swarm.model import Base, BaseId, Mission, Plan, Task, TaskId, Uav, UavId
from swarm.model.plan import START, LeftOut, ScheduleEntry, at_base

U1, U2 = UavId("uav1"), UavId("uav2")
MISSION = Mission(
    name="field",
    horizon_s=500.0,
    uavs=(
        Uav(U1, (0.0, 0.0, 0.0), 10.0, endurance_s=200.0, charge_frac=0.9),
        Uav(U2, (50.0, 0.0, 0.0), 10.0),
    ),
    tasks=(
        Task(TaskId("road"), (100.0, 0.0, 0.0), 5.0, path_enu_m=((100.0, 0, 0), (300.0, 0, 0))),
        Task(TaskId("gate"), (100.0, 50.0, 0.0), 5.0, opens_s=250.0),
        Task(TaskId("pump"), (900.0, 50.0, 0.0), 5.0),
        Task(TaskId("kiosk"), (900.0, 0.0, 0.0), 5.0, due_s=20.0),
    ),
    bases=(Base(BaseId("yard"), (0.0, 50.0, 0.0), 60.0),),
)


def entry(
    go: str,
    depart_s: float,
    arrive_s: float,
    begin_s: float,
    end_s: float,
    *,
    is_reversed: bool = False,
) -> ScheduleEntry:
    via_m = ((1.0, 0.0),)
    return ScheduleEntry(go, (0.0, 0.0), via_m, depart_s, arrive_s, begin_s, end_s, is_reversed)


ENTRIES = (
    entry("road", 0.0, 30.0, 30.0, 50.0, is_reversed=True),
    entry(at_base(BaseId("yard")), 50.0, 70.0, 80.0, 140.0),
    entry("gate", 230.0, 245.0, 250.0, 260.0),
    entry(START, 260.0, 280.0, 280.0, 280.0),
)
PLAN = Plan(
    scenario="field",
    method="greedy",
    routes={U1: (TaskId("road"), TaskId("gate")), U2: ()},
    objective=3450.0,
    completion_s={TaskId("road"): 50.0, TaskId("gate"): 260.0},
    sequence=(U1, U2),
    optimum=None,
    evaluations=2,
    elapsed_s=0.1,
    seed=0,
    schedule={U1: ENTRIES, U2: ()},
    left_out={TaskId("pump"): LeftOut.ENERGY, TaskId("kiosk"): LeftOut.DUE},
    required_left_out=1,
)


def shown(plan: Plan) -> str:
    console = Console(width=80, file=io.StringIO(), highlight=False)
    console.print(plan_table(MISSION, plan))
    assert isinstance(console.file, io.StringIO)
    return console.file.getvalue()


def test_charge_counts_what_each_sortie_began_with_and_its_time_in_the_air() -> None:
    charges = charge_at_landing(MISSION.uavs[0], ENTRIES)

    # 180 s at first, 80 s in the air; 200 s after the swap, airborne from 230 to 280 s.
    assert charges == [None, 0.5, None, 0.75]
    assert charge_at_landing(MISSION.uavs[1], ENTRIES) == [None] * 4


def test_waits_are_those_in_the_air_and_on_the_ground() -> None:
    assert waits_s(ENTRIES) == [0.0, 10.0, 95.0, 0.0]
    assert waits_s(()) == []


def test_list_tells_swaps_waits_directions_and_the_way_home() -> None:
    assert flown(MISSION, PLAN, MISSION.uavs[0]).plain == (
        "road(reversed)@50.0 wait:10.0 swap:yard@80.0-140.0(50%) wait:95.0 gate@260.0 "
        "home:start@280.0(75%)"
    )
    assert flown(MISSION, PLAN, MISSION.uavs[1]).plain == "–"


def test_only_tasks_without_due_time_can_be_late() -> None:
    late = replace(MISSION, horizon_s=200.0)
    due = replace(late, tasks=(MISSION.tasks[0], replace(MISSION.tasks[1], due_s=300.0)))

    assert "gate@260.0!" in flown(late, PLAN, late.uavs[0]).plain
    assert "gate@260.0 " in flown(due, PLAN, due.uavs[0]).plain


def test_table_says_in_words_why_tasks_are_left_out() -> None:
    text = " ".join(shown(PLAN).split())

    assert "1 base" in text
    assert "pump: nobody has the energy for it beside the rest" in text
    assert "kiosk: not worth it, or nobody gets done by the due time" in text
    assert "than the" not in text


def test_table_says_who_leaves_out_less() -> None:
    proven = replace(PLAN, optimum=5000.0, fewest_left_out=0)
    bounded = replace(PLAN, bound=5000.0, fewest_left_out=0)

    assert "1 required task left out, 0 in the optimum" in " ".join(shown(proven).split())
    assert "gap" not in shown(proven)
    assert "1 required task left out, at least 0 in any plan" in " ".join(shown(bounded).split())
    assert max(len(line) for line in shown(proven).splitlines()) <= 80
