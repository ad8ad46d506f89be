"""Ways with their corners: home, to tasks and bases, and out of zones."""

from __future__ import annotations

import math

import pytest

from swarm.allocation.field import FieldProblem
from swarm.allocation.field.ways import base_node, home_base, task_nodes, way_home, way_to
from swarm.model import Base, BaseId, Mission, Task, TaskId, Uav, UavId, Zone, ZoneId

SQUARE = Zone(ZoneId("z"), ((100.0, -50.0), (200.0, -50.0), (200.0, 50.0), (100.0, 50.0)))
MISSION = Mission(
    "ways",
    1000.0,
    (Uav(UavId("u0"), (0.0, 0.0, 0.0), 10.0), Uav(UavId("u1"), (0.0, 300.0, 0.0), 10.0)),
    (
        Task(TaskId("behind"), (300.0, 0.0, 0.0), 1.0),
        Task(TaskId("low"), (0.0, 100.0, 0.0), 1.0, height_m=5.0),
        Task(
            TaskId("line"),
            (0.0, 200.0, 0.0),
            1.0,
            path_enu_m=((0.0, 200.0, 0.0), (50.0, 200.0, 0.0)),
        ),
    ),
    bases=(Base(BaseId("b0"), (300.0, 10.0, 0.0)),),
    zones=(SQUARE,),
)
PROBLEM = FieldProblem.from_mission(MISSION, layers_m=(30.0, 40.0))


def test_the_way_round_a_zone_has_its_corners_at_the_height_flown() -> None:
    way = way_to(PROBLEM, 0, (0.0, 0.0, 0.0), task_nodes(PROBLEM, 0)[0])

    assert way is not None
    assert way.base is None
    assert way.end_enu_m == (300.0, 0.0, 30.0)
    assert {(x, abs(y), z) for x, y, z in way.via_enu_m} == {
        (100.0, 50.0, 30.0),
        (200.0, 50.0, 30.0),
    }
    assert way.duration_s == pytest.approx((2 * math.hypot(100, 50) + 100) / 10)
    assert way.duration_s == PROBLEM.leg_s[0, 0, way.node]


def test_home_is_the_nearest_base_or_the_own_start() -> None:
    from_afar = way_home(PROBLEM, 0, (260.0, 0.0, 0.0))
    from_near = way_home(PROBLEM, 0, (20.0, 0.0, 0.0))

    assert from_afar is not None
    assert (from_afar.base, from_afar.node) == ("b0", base_node(PROBLEM, "b0"))
    assert from_near is not None
    assert (from_near.base, from_near.end_enu_m) == (None, (0.0, 0.0, 30.0))
    assert home_base(PROBLEM, 0, task_nodes(PROBLEM, 0)[1]) == "b0"
    assert home_base(PROBLEM, 1, task_nodes(PROBLEM, 2)[1]) is None


def test_who_is_in_a_zone_leaves_by_the_shortest_way_first() -> None:
    way = way_to(PROBLEM, 0, (110.0, 0.0, 0.0), base_node(PROBLEM, "b0"))

    assert way is not None
    east_m, north_m, up_m = way.via_enu_m[0]
    assert (east_m, north_m, up_m) == pytest.approx((100.0, 0.0, 30.0), abs=0.01)
    assert way.duration_s > (10.0 + 50.0 + 100.0) / 10.0


def test_a_task_with_its_own_height_is_flown_to_at_that_height() -> None:
    way = way_to(PROBLEM, 1, (0.0, 300.0, 0.0), task_nodes(PROBLEM, 1)[0])

    assert way is not None
    assert way.end_enu_m == (0.0, 100.0, 5.0)
    assert way.via_enu_m == ()


def test_lines_begin_where_they_are_flown_from() -> None:
    there, back = task_nodes(PROBLEM, 2), task_nodes(PROBLEM, 2, backwards=True)

    assert there == back[::-1]
    assert there[0] != there[1]
    way = way_to(PROBLEM, 1, (0.0, 300.0, 0.0), back[0])
    assert way is not None
    assert way.end_enu_m == (50.0, 200.0, 40.0)


def test_a_zone_is_left_through_no_other_where_that_can_be() -> None:
    around = Zone(ZoneId("around"), ((0.0, 500.0), (20.0, 500.0), (20.0, 520.0), (0.0, 520.0)))
    beside = Zone(ZoneId("beside"), ((-1.0, 505.0), (2.0, 505.0), (2.0, 515.0), (-1.0, 515.0)))
    mission = Mission("left", 1000.0, MISSION.uavs, MISSION.tasks, zones=(around, beside))
    problem = FieldProblem.from_mission(mission)
    network = problem.network

    assert network is not None
    out_m = network.way_out_m(1, (3.0, 510.0, 0.0))  # 4 m to the west through the other one
    assert out_m is not None
    assert abs(out_m[1] - 510.0) == pytest.approx(10.0, abs=0.05)
    assert out_m[0] == pytest.approx(3.0, abs=0.5)


def test_there_is_no_way_out_of_a_closed_ring() -> None:
    ring = Zone(
        ZoneId("ring"),
        ((-60.0, 240.0), (60.0, 240.0), (60.0, 360.0), (-60.0, 360.0)),
        (((-40.0, 260.0), (40.0, 260.0), (40.0, 340.0), (-40.0, 340.0)),),
    )
    mission = Mission("ring", 1000.0, MISSION.uavs, MISSION.tasks, zones=(ring,))
    problem = FieldProblem.from_mission(mission)

    assert way_to(problem, 1, (0.0, 300.0, 0.0), task_nodes(problem, 0)[0]) is None
    home = way_home(problem, 1, (0.0, 310.0, 0.0))
    assert home is not None
    assert home.duration_s == pytest.approx(1.0)
