"""What judges flights in the field: sound ones pass, and each rule finds what breaks it.

Flights are sound by themselves; what is planted is a stricter mission, or a flight made by hand.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from functools import cache
from itertools import pairwise
from typing import Any

import pytest

from sim.faults.drawn_zones import DrawnZone
from sim.faults.field_judge import Chances, FieldJudge, VehicleFlaw
from sim.world.flight_log import BaseStay, LastSeen
from sim.world.flown_path import MotionPiece
from sim.world.simulation import simulate_mission
from sim.world.track import Track
from sim.world.uncertainty import Uncertainty
from sim.world.virtual_world import World
from swarm.model import Base, BaseId, Mission, Task, TaskId, Uav, UavId, Zone, ZoneId

BASE = Base(BaseId("b0"), (0.0, 0.0, 0.0), swap_s=30.0)
MISSION = Mission(
    "judged",
    600.0,
    tuple(
        Uav(UavId(f"u{n}"), (10.0 * n, 20.0, 0.0), 10.0, endurance_s=40.0, charge_frac=0.6)
        for n in range(2)
    ),
    (
        Task(TaskId("t0"), (60.0, 0.0, 0.0), 1.0, service_s=8.0),
        Task(TaskId("t1"), (0.0, 60.0, 0.0), 1.0, service_s=8.0),
        Task(TaskId("t2"), (60.0, 60.0, 0.0), 1.0, service_s=8.0),
        Task(TaskId("t3"), (-60.0, 0.0, 0.0), 1.0, service_s=8.0),
    ),
    bases=(BASE,),
    schema=2,
)
SQUARE = ((90.0, -10.0), (110.0, -10.0), (110.0, 10.0), (90.0, 10.0))
ZONE = Zone(ZoneId("lake"), SQUARE)


@cache
def _flown() -> World:
    return simulate_mission(MISSION, method="greedy", seed=0, uncertainty=Uncertainty()).world


@pytest.fixture
def world() -> World:
    """A sound flight, whose mission may be made stricter."""
    flown = _flown()
    flown.mission = MISSION
    flown.fallen_s.clear()
    return flown


def broken(world: World, zones: list[DrawnZone] | None = None) -> list[str]:
    return [invariant for invariant, _ in FieldJudge(world).complaints(zones)]


def stricter(world: World, make: Callable[[Task, float, float], Task]) -> None:
    """Change the task that was begun last, by when it was begun and ended."""
    entries = [each for flown in world.executed_schedule().values() for each in flown]
    last = max((each for each in entries if each.go.startswith("t")), key=lambda each: each.end_s)
    tasks = (
        make(task, last.begin_s, last.end_s) if task.id == last.go else task
        for task in world.mission.tasks
    )
    world.mission = replace(world.mission, tasks=tuple(tasks))


def test_a_sound_flight_passes(world: World) -> None:
    assert set(world.mission_state.result().done) == {"t0", "t1", "t2", "t3"}
    assert len(world.flight_log.stays) >= 2
    assert broken(world) == []


def test_nobody_may_run_out_of_energy(world: World) -> None:
    world.fallen_s["u1"] = 30.0

    assert broken(world) == ["fell"]


@pytest.mark.parametrize("by_s", [0.1, -0.1])
def test_work_begins_not_before_it_opens(world: World, by_s: float) -> None:
    stricter(world, lambda task, begin_s, _: replace(task, opens_s=begin_s + by_s))

    assert broken(world) == (["out of its window"] if by_s > 0.0 else [])


@pytest.mark.parametrize("by_s", [0.1, -0.1])
def test_work_begins_not_after_it_closes(world: World, by_s: float) -> None:
    stricter(world, lambda task, begin_s, _: replace(task, closes_s=begin_s - by_s))

    assert broken(world) == (["out of its window"] if by_s > 0.0 else [])


@pytest.mark.parametrize("by_s", [0.1, -0.1])
def test_work_ends_not_after_it_is_due(world: World, by_s: float) -> None:
    stricter(world, lambda task, _, end_s: replace(task, due_s=end_s - by_s))

    assert broken(world) == (["out of its window"] if by_s > 0.0 else [])


@pytest.mark.parametrize(
    ("slots", "second_s", "is_sound"),
    [(None, 20.0, True), (2, 20.0, True), (1, 20.0, False), (1, 50.0, True)],
)
def test_no_more_stand_at_a_base_than_it_has_slots(
    slots: int | None, second_s: float, is_sound: bool
) -> None:
    world = on_a_way((0.0, 0.0, 0.0), (1.0, 10.0, 0.0))
    world.mission = replace(MISSION, bases=(replace(BASE, slots=slots),))
    world.flight_log.stays += [
        BaseStay("u0", BASE.id, 10.0, ready_s=40.0, end_s=50.0),
        BaseStay("u1", BASE.id, second_s, ready_s=80.0),
    ]

    assert broken(world) == ([] if is_sound else ["no slot"])


@pytest.mark.parametrize(("heard_s", "is_sound"), [((0.0, 10.0), False), ((10.0, 20.0), True)])
def test_who_comes_down_unheard_of_takes_nobodys_slot(
    heard_s: tuple[float, float], is_sound: bool
) -> None:
    """Whether it is unheard of is asked of the time since the first has stood there."""
    world = on_a_way((0.0, 0.0, 0.0), (1.0, 10.0, 0.0))
    world.mission = replace(MISSION, bases=(replace(BASE, slots=1),))
    world.flight_log.stays += [
        BaseStay("u0", BASE.id, 10.0, ready_s=40.0, end_s=50.0),
        BaseStay("u1", BASE.id, 20.0, ready_s=80.0),
    ]

    def unheard(one: str, other: str, since_s: float, until_s: float) -> bool:
        return (one, other) == ("u1", "u0") and (since_s, until_s) == heard_s

    complaints = FieldJudge(world, unheard=unheard).complaints()
    assert [each for each, _ in complaints] == ([] if is_sound else ["no slot"])


def test_nobody_flies_through_a_zone_of_the_scenario(world: World) -> None:
    where_it_works = Zone(ZoneId("z0"), ((55.0, 55.0), (65.0, 55.0), (65.0, 65.0), (55.0, 65.0)))
    world.mission = replace(MISSION, zones=(where_it_works,))
    assert broken(world) == ["in a zone"]

    world.mission = replace(MISSION, zones=(replace(where_it_works, floor_m=50.0),))
    assert broken(world) == []


def on_a_way(*corners: tuple[float, float, float]) -> World:
    """A flight of the first UAV alone, along times [s] and places [m] at 10 m."""
    world = World(MISSION, lambda *_: pytest.fail("planned"), method="greedy", seed=0)
    track = Track()
    (begin_s, east_m, north_m), *_ = corners
    track.lift_off((east_m, north_m, 10.0), begin_s)
    pieces = []
    for one, other in pairwise(corners):
        lasts_s = other[0] - one[0]
        speed = ((other[1] - one[1]) / lasts_s, (other[2] - one[2]) / lasts_s, 0.0)
        pieces.append(MotionPiece(one[0], other[0], (one[1], one[2], 10.0), speed))
    track.fly(pieces, (corners[-1][1], corners[-1][2], 10.0), begin_s)
    world.tracks.clear()
    world.tracks["u0"] = track
    return world


@pytest.mark.parametrize(("up_m", "is_sound"), [(-0.4, True), (-0.6, False)])
def test_nobody_flies_below_what_is_visited(up_m: float, is_sound: bool) -> None:
    world = on_a_way((0.0, 100.0, 0.0), (25.0, 100.0, 0.0))
    track = Track()
    track.lift_off((0.0, 0.0, 10.0), 0.0)
    sinks = MotionPiece(0.0, 10.0, (0.0, 0.0, 10.0), (0.0, 0.0, 0.1 * (up_m - 10.0)))
    track.fly([sinks], (0.0, 0.0, up_m), 0.0)
    world.tracks["u0"] = track

    assert broken(world) == ([] if is_sound else ["underground"])


@pytest.mark.parametrize(
    ("north_m", "margin_m", "is_sound"),
    [(0.0, 0.0, False), (10.0, 0.0, True), (12.0, 0.0, True), (12.0, 5.0, False)],
)
def test_borders_are_outside_and_the_margin_is_inside(
    north_m: float, margin_m: float, is_sound: bool
) -> None:
    world = on_a_way((0.0, 0.0, north_m), (20.0, 200.0, north_m))
    world.mission = replace(MISSION, zones=(ZONE,), zone_margin_m=margin_m)

    assert broken(world) == ([] if is_sound else ["in a zone"])


def test_outside_of_an_inclusive_zone_nobody_flies() -> None:
    world = on_a_way((0.0, 95.0, 0.0), (1.0, 105.0, 0.0))
    world.mission = replace(MISSION, zones=(replace(ZONE, inclusive=True),))
    assert broken(world) == []

    world = on_a_way((0.0, 95.0, 0.0), (2.0, 115.0, 0.0))
    world.mission = replace(MISSION, zones=(replace(ZONE, inclusive=True),))
    assert broken(world) == ["in a zone"]


DRAWN = DrawnZone(ZONE, since_s=20.0, until_s=200.0)


@pytest.mark.parametrize(
    ("corners", "is_sound"),
    [
        pytest.param([(0, 95, 0), (20.1, 95, 0), (24, 85, 0)], True, id="leaves"),
        pytest.param([(0, 95, 0), (27, 95, 0), (30, 85, 0)], False, id="leaves slowly"),
        pytest.param([(0, 95, 0), (20.1, 95, 0)], False, id="stays"),
        pytest.param([(0, 95, 0), (24, 85, 0), (40, 85, 0), (44, 95, 0)], False, id="comes back"),
        pytest.param([(0, 0, 0), (19, 0, 0), (29, 100, 0), (34, 150, 0)], False, id="flies in"),
        pytest.param([(0, 50, 0), (19, 50, 0), (24, 120, 0)], True, id="is through at once"),
        pytest.param([(0, 50, 0), (201, 50, 0), (211, 150, 0)], True, id="is taken away"),
    ],
)
def test_who_is_in_a_zone_when_it_is_drawn_leaves_and_nobody_comes(
    corners: list[tuple[float, float, float]], is_sound: bool
) -> None:
    world = on_a_way(*corners)

    assert broken(world, [DRAWN]) == ([] if is_sound else ["in a zone"])
    assert broken(world, [replace(DRAWN, known_s={})]) == []  # nobody has heard of it


def test_who_hears_of_a_zone_late_has_until_then() -> None:
    world = on_a_way((0.0, 95.0, 0.0), (60.0, 95.0, 0.0), (64.0, 85.0, 0.0))

    assert broken(world, [replace(DRAWN, known_s={"u0": 60.0})]) == []
    assert broken(world, [replace(DRAWN, known_s={"u0": 30.0})]) == ["in a zone"]


def test_who_turns_in_flight_may_be_astray_by_what_its_agent_does_not_know_yet() -> None:
    world = on_a_way((0.0, 0.0, 8.5), (20.0, 200.0, 8.5))  # 1.5 m inside of the border
    world.mission = replace(MISSION, zones=(ZONE,))

    assert [each for each, _ in FieldJudge(world, stale_s=0.2).complaints()] == []
    assert [each for each, _ in FieldJudge(world, stale_s=0.1).complaints()] == ["in a zone"]


@pytest.mark.parametrize("floor_m", [0.0, 9.5])
def test_who_is_astray_may_be_in_a_zone_by_that_much_but_not_more(floor_m: float) -> None:
    inside_m = 1.5 if floor_m == 0.0 else 5.0  # of the border, or half a metre above the floor
    astray_m = 1.5 if floor_m == 0.0 else 0.5
    world = on_a_way((0.0, 0.0, 10.0 - inside_m), (20.0, 200.0, 10.0 - inside_m))
    world.mission = replace(MISSION, zones=(replace(ZONE, floor_m=floor_m),))

    assert [each for each, _ in FieldJudge(world, astray_m=astray_m).complaints()] == []
    less_m = astray_m - 0.1
    assert [each for each, _ in FieldJudge(world, astray_m=less_m).complaints()] == ["in a zone"]


@pytest.mark.parametrize(
    ("out_m", "is_sound"),
    [pytest.param(91.0, True, id="stops before"), pytest.param(80.0, False, id="was outside")],
)
def test_who_is_astray_near_the_border_has_left_a_zone_when_it_is_outside_by_all(
    out_m: float, is_sound: bool
) -> None:
    world = on_a_way((0, 100, 0), (25, 100, 0), (25.5, out_m, 0), (25.7, 95, 0), (25.9, 85, 0))
    complaints = FieldJudge(world, astray_m=3.0).complaints([DRAWN])

    assert [each for each, _ in complaints] == ([] if is_sound else ["in a zone"])


@pytest.mark.parametrize("begins_m", [91.0, 94.0])
def test_who_is_just_inside_when_it_hears_may_come_farther_in_before_it_leaves(
    begins_m: float,
) -> None:
    """Astray by what is forgiven it was outside by no belief of its own."""
    world = on_a_way((0, begins_m, 0), (25, begins_m, 0), (25.05, 94.5, 0), (25.08, 85, 0))
    complaints = FieldJudge(world, astray_m=3.0).complaints([DRAWN])

    assert complaints == []


@pytest.mark.parametrize(
    ("out_s", "uav", "flaws", "is_sound"),
    [
        pytest.param(1.0, {}, (), True, id="at full speed"),
        pytest.param(1.1, {}, (), False, id="lingers"),
        pytest.param(1.1, {}, (VehicleFlaw("u0", 5.0, 0.8),), True, id="is slow"),
        pytest.param(
            1.1, {}, (VehicleFlaw("u1", 5.0, 0.8),), False, id="lingers beside a slow one"
        ),
        pytest.param(1.9, {"airspeed_m_s": 8.0}, (), True, id="against the wind"),
        pytest.param(2.1, {"airspeed_m_s": 8.0}, (), False, id="lingers in the wind"),
        # 10 / 5 s to stop 10 m farther in, then 2 · sqrt(20 / 5) s from rest to rest.
        pytest.param(5.9, {"acceleration_m_s2": 5.0}, (), True, id="stops first"),
        pytest.param(6.1, {"acceleration_m_s2": 5.0}, (), False, id="stops and lingers"),
    ],
)
def test_who_is_in_a_zone_has_as_long_as_its_shortest_way_out_takes(
    out_s: float, uav: dict[str, Any], flaws: tuple[VehicleFlaw, ...], is_sound: bool
) -> None:
    world = on_a_way((0.0, 100.0, 0.0), (25.0, 100.0, 0.0), (25.0 + out_s, 110.01, 0.0))
    me = replace(MISSION.uavs[0], **uav)
    world.mission = replace(MISSION, uavs=(me,), wind_enu_m_s=(0.0, 3.0))
    complaints = FieldJudge(world, flaws=flaws).complaints([DRAWN])

    assert [each for each, _ in complaints] == ([] if is_sound else ["in a zone"])


@pytest.mark.parametrize(("out_s", "is_sound"), [(10.9, True), (11.1, False)])
def test_where_uavs_are_kept_apart_a_way_out_is_granted_first_and_may_climb(
    out_s: float, is_sound: bool
) -> None:
    """5 s until it is granted, 10 m out and 50 m up at 10 m/s."""
    world = on_a_way((0.0, 100.0, 0.0), (25.0, 100.0, 0.0), (25.0 + out_s, 110.01, 0.0))
    uavs = (replace(MISSION.uavs[0], position_enu_m=(0.0, 20.0, 0.0)), *MISSION.uavs[1:])
    apart = replace(MISSION, uavs=uavs, separation_m=8.0, band_m=(30.0, 80.0))
    world.mission = apart
    complaints = FieldJudge(world).complaints([DRAWN])

    assert [each for each, _ in complaints] == ([] if is_sound else ["in a zone"])


SEEN = LastSeen(5.0, (10.0, 0.0, 10.0), 0.9, True)
NEAR = Task(TaskId("near"), (50.0, 0.0, 0.0), 1.0)
CHARGED = replace(MISSION.uavs[0], position_enu_m=(0.0, 0.0, 0.0), charge_frac=1.0)


def could(task: Task, seen: LastSeen = SEEN, uav: Uav = CHARGED, *bases: Base) -> list[str]:
    mission = replace(MISSION, uavs=(uav,), tasks=(task,), bases=bases)
    return Chances(mission, 0.0).could_do({"u0": seen}, [task.id]).get(task.id, [])


def test_a_task_within_reach_is_left_undone_by_who_could_do_it() -> None:
    assert could(NEAR) == ["u0"]


@pytest.mark.parametrize(
    "task",
    [
        pytest.param(replace(NEAR, position_enu_m=(250.0, 0.0, 0.0)), id="beyond its energy"),
        pytest.param(replace(NEAR, closes_s=6.0), id="has closed"),
        pytest.param(replace(NEAR, opens_s=500.0), id="opens after its energy has gone"),
        pytest.param(replace(NEAR, due_s=100.0), id="may be left out"),
        pytest.param(replace(NEAR, service_s=60.0), id="takes too long"),
    ],
)
def test_a_task_that_cannot_be_done_is_nobodys_fault(task: Task) -> None:
    assert could(task) == []


def test_a_swap_makes_room_for_what_is_too_far_or_opens_late() -> None:
    spent = replace(SEEN, battery_frac=0.3)

    assert could(NEAR, spent) == []
    assert could(NEAR, spent, CHARGED, BASE) == ["u0"]
    assert could(replace(NEAR, opens_s=500.0), SEEN, CHARGED, BASE) == ["u0"]


def test_who_cannot_do_it_or_stands_at_its_start_is_not_blamed() -> None:
    assert could(NEAR, SEEN, replace(CHARGED, success={"near": 0.0})) == []
    landed = replace(SEEN, flies=False, place_enu_m=(0.0, 0.0, 0.0))
    assert could(NEAR, landed) == []
    assert could(NEAR, landed, CHARGED, BASE) == ["u0"]


def test_an_endless_battery_could_do_what_opens_late() -> None:
    endless = replace(CHARGED, endurance_s=None)
    seen = replace(SEEN, battery_frac=None)

    assert could(replace(NEAR, opens_s=500.0), seen, endless) == ["u0"]


def test_only_tasks_that_are_asked_about_are_looked_at(monkeypatch: pytest.MonkeyPatch) -> None:
    chances, looked_at = Chances(MISSION, 0.0), list[int]()
    ends_s = Chances._ends_s

    def noted_s(self: Chances, row: int, column: int, seen: LastSeen, visits: int) -> float:
        looked_at.append(column)
        return ends_s(self, row, column, seen, visits)

    monkeypatch.setattr(Chances, "_ends_s", noted_s)
    chances.could_do({"u0": SEEN}, ["t2"])

    assert looked_at == [2]


def test_a_base_on_whose_slots_the_lost_stand_swaps_nothing() -> None:
    mission = replace(MISSION, uavs=(CHARGED,), tasks=(NEAR,), bases=(BASE,))
    spent = {"u0": replace(SEEN, battery_frac=0.3)}

    assert Chances(mission, 0.0).could_do(spent, ["near"]) == {"near": ["u0"]}
    assert Chances(mission, 0.0, blocked=["b0"]).could_do(spent, ["near"]) == {}


@pytest.mark.parametrize(
    ("task", "battery_frac", "may"),
    [
        pytest.param(NEAR, 0.9, True, id="goes on"),
        pytest.param(NEAR, 0.3, False, id="has no energy, and no time for a swap"),
        pytest.param(replace(NEAR, due_s=12.0), 0.9, True, id="before it is due"),
        pytest.param(replace(NEAR, due_s=9.5), 0.9, False, id="not before it is due"),
        pytest.param(replace(NEAR, closes_s=8.5), 0.9, False, id="not before it closes"),
    ],
)
def test_who_can_go_on_has_no_reason_to_leave_its_task(
    task: Task, battery_frac: float, may: bool
) -> None:
    mission = replace(MISSION, uavs=(CHARGED,), tasks=(task,), bases=(BASE,))
    seen = replace(SEEN, battery_frac=battery_frac)

    assert Chances(mission, 0.0).can_go_on(seen, "u0", "near") is may


@pytest.mark.parametrize(
    ("flaw", "may"),
    [
        pytest.param(VehicleFlaw("u0", 1.0, drain_frac=1.5), True, id="drains, and has enough"),
        pytest.param(VehicleFlaw("u0", 1.0, drain_frac=3.0), False, id="drains too fast"),
        pytest.param(VehicleFlaw("u0", 1.0, speed_frac=0.7), True, id="is slow, and has enough"),
        pytest.param(VehicleFlaw("u0", 1.0, speed_frac=0.3), False, id="is too slow"),
        pytest.param(VehicleFlaw("u1", 1.0, 0.3, 3.0), True, id="another one does worse"),
    ],
)
def test_who_flies_worse_than_planned_is_judged_by_how_it_flies(
    flaw: VehicleFlaw, may: bool
) -> None:
    mission = replace(MISSION, uavs=(CHARGED,), tasks=(NEAR,), bases=())
    seen = replace(SEEN, battery_frac=0.7)
    chances = Chances(mission, 0.0, flaws=[flaw])

    assert chances.can_go_on(seen, "u0", "near") is may
    assert chances.could_do({"u0": seen}, ["near"]) == ({"near": ["u0"]} if may else {})
