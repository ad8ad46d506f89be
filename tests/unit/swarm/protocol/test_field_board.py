"""What the registers say about a mission in the field: its zones, its problem, who may start."""

from __future__ import annotations

import itertools
from dataclasses import replace

import numpy as np

from swarm.model import Mission, Zone, ZoneId
from swarm.model.ids import COORDINATOR, OPERATOR
from swarm.protocol.board import TaskBoard
from swarm.protocol.field_messages import UavReady, ZoneEdit, ZoneSpec
from swarm.protocol.messages import Message, Stamp
from swarm.protocol.operator_commands import readiness, zones_in_force
from swarm.protocol.registers import MOST_ZONES, Replica
from tests.support.builders import MISSION, brief, entry, message, order, uav

FLEET = [uav("u0", lift=0.5), uav("u1", east_m=50.0)]


def zone(name: str, east_m: float = 20.0) -> ZoneSpec:
    """A square of 10 m on a side, its middle ``east_m`` east of the origin."""
    west_m, far_m = east_m - 5.0, east_m + 5.0
    corners = ((west_m, -5.0), (far_m, -5.0), (far_m, 5.0), (west_m, 5.0))
    return ZoneSpec(name, corners, (), None, None, False)


def edit(spec: ZoneSpec, *, withdrawn: bool = False, run: int = 1) -> ZoneEdit:
    return ZoneEdit(spec, withdrawn, run, "")


def told(*bodies: ZoneEdit | UavReady, zones: tuple[ZoneSpec, ...] = ()) -> Replica:
    """A replica that knows a brief, and then words of the operator, each later than the other."""
    replica = Replica()
    replica.join(message(COORDINATOR, replace(brief(*FLEET), zones=zones)))
    for counter, body in enumerate(bodies, 1):
        replica.join(message(OPERATOR, body, counter))
    return replica


def names(replica: Replica) -> list[str]:
    return [spec.id for spec in zones_in_force(replica)]


# -- zones --------------------------------------------------------------------------------


def test_the_operators_word_about_a_zone_comes_before_the_briefs() -> None:
    moved, drawn = zone("village", 90.0), zone("helipad")
    replica = told(edit(moved), edit(drawn), zones=(zone("village"), zone("school", 70.0)))
    assert zones_in_force(replica) == (moved, zone("school", 70.0), drawn)

    replica.join(message(OPERATOR, edit(moved, withdrawn=True), 9))
    assert names(replica) == ["school", "helipad"]


def test_zones_are_equal_whatever_order_the_words_come_in() -> None:
    said = [
        message(OPERATOR, edit(zone("b")), 1),
        message(OPERATOR, edit(zone("a")), 2),
        message(OPERATOR, edit(zone("a"), withdrawn=True), 3),
        message(OPERATOR, edit(zone("c")), 4),
        message(COORDINATOR, brief(*FLEET)),
    ]
    found = set()
    for order_heard in itertools.permutations(said):
        replica = Replica()
        replica.join_all(order_heard)
        found.add(tuple(names(replica)))
    assert found == {("b", "c")}


def test_zones_of_another_flight_count_nothing() -> None:
    replica = told(edit(zone("old"), run=7))
    version = replica.board_version
    assert names(replica) == []

    replica.join(message(OPERATOR, edit(zone("old"), withdrawn=True, run=7), 9))
    assert replica.board_version == version
    replica.join(message(COORDINATOR, replace(brief(*FLEET), run=7), 2))
    replica.join(message(OPERATOR, edit(zone("old"), run=7), 10))
    assert names(replica) == ["old"]


def test_of_zones_no_more_are_kept_than_there_is_room_for() -> None:
    replica = told(*(edit(zone(f"z{number}")) for number in range(MOST_ZONES + 5)))

    assert (len(replica.zone_edits), replica.overfull) == (MOST_ZONES, 5)
    assert replica.join(message(OPERATOR, edit(zone("z0"), withdrawn=True), MOST_ZONES + 9))


# -- the problem --------------------------------------------------------------------------


def test_a_plain_mission_has_no_problem_of_the_field() -> None:
    replica = told()
    replica.join(message(COORDINATOR, entry("t0", 40.0), 2))
    board = TaskBoard(replica, MISSION)

    assert board.field_problem is None
    assert board.problem is not None
    assert board.mission is not None
    assert [task.id for task in board.mission.tasks] == ["t0"]


def test_a_zone_drawn_in_flight_makes_way_longer_and_is_forgotten_when_taken_away() -> None:
    replica = told()
    replica.join(message(COORDINATOR, entry("t0", 40.0), 2))
    board = TaskBoard(replica, MISSION)
    assert board.field_problem is None

    replica.join(message(OPERATOR, edit(zone("z")), 1))
    problem = board.field_problem
    assert problem is not None
    assert problem.task_ids == ("t0",)
    first = int(problem.enter[0, 0])
    assert 40.0 < problem.leg_s[problem.kind[0], 0, first] < 45.0
    assert problem.leg_s[problem.kind[1], 1, first] == 10.0
    assert board.field_problem is problem, "made once"

    replica.join(message(OPERATOR, edit(zone("z"), withdrawn=True), 2))
    assert board.field_problem is None


def test_columns_and_rows_are_those_of_the_plain_problem() -> None:
    replica = told(edit(zone("z")))
    line = ((90.0, 0.0, 0.0), (90.0, 30.0, 0.0))
    replica.join(message(COORDINATOR, entry("t1", 40.0, number=1, value=3.0), 2))
    replica.join(message(COORDINATOR, entry("t0", 60.0, number=2, withdrawn=True), 3))
    replica.join(
        message(OPERATOR, order("op1", 90.0, path_enu_m=line, due_s=200.0, opens_s=5.0), 9)
    )
    board = TaskBoard(replica, MISSION)
    plain, problem = board.problem, board.field_problem

    assert plain is not None
    assert problem is not None
    assert (problem.uav_ids, problem.task_ids) == (plain.uav_ids, plain.task_ids)
    np.testing.assert_array_equal(problem.weight, plain.weight)
    np.testing.assert_array_equal(problem.capable, plain.capable)
    assert problem.due_s.tolist() == [np.inf, np.inf, 200.0]
    assert problem.opens_s.tolist() == [0.0, 0.0, 5.0]
    assert problem.is_line.tolist() == [False, False, True]


def test_one_task_with_a_limit_makes_a_mission_one_of_the_field_as_long_as_it_is_so() -> None:
    replica = told()
    board = TaskBoard(replica, MISSION)
    replica.join(message(OPERATOR, order("op1", due_s=30.0), 1))
    assert board.field_problem is not None

    replica.join(message(OPERATOR, order("op1"), 2))
    assert board.field_problem is None


def test_uavs_fly_in_the_layers_of_the_brief() -> None:
    """A zone above them is none of theirs."""
    high = replace(zone("z"), floor_m=15.0)
    replica = told(edit(high))
    told_layers = [
        replace(spec, layer_m=h) for spec, h in zip(brief(*FLEET).uavs, (10.0, 20.0), strict=True)
    ]
    replica.join(message(COORDINATOR, replace(brief(*FLEET), uavs=tuple(told_layers)), 2))
    replica.join(message(COORDINATOR, entry("t0", 40.0), 3))
    problem = TaskBoard(replica, MISSION).field_problem

    assert problem is not None
    first = int(problem.enter[0, 0])
    assert problem.leg_s[problem.kind[0], 0, first] == 40.0
    assert problem.leg_s[problem.kind[1], 0, first] > 40.0


def test_the_mission_on_the_board_has_the_zones_in_force() -> None:
    replica = told(edit(zone("z")), zones=(zone("village", 90.0),))
    mission = TaskBoard(replica, MISSION).mission

    assert isinstance(mission, Mission)
    corners = zone("z").polygon_enu_m
    assert mission.zones == (zone("village", 90.0).zone(), Zone(ZoneId("z"), corners))


# -- who may start again --------------------------------------------------------------------


def test_each_word_that_a_uav_may_start_has_a_stamp_of_its_own() -> None:
    replica = told(UavReady("u0", 1, ""), UavReady("u1", 7, ""))
    assert readiness(replica) == {"u0": Stamp(1, 1)}

    replica.join(message(OPERATOR, UavReady("u0", 1, ""), 5))
    assert readiness(replica) == {"u0": Stamp(1, 5)}
    replica.demote_revoked({OPERATOR})
    assert readiness(replica)["u0"] < Stamp(1, 1), "no further word"


def test_words_about_uavs_that_the_brief_does_not_name_are_forgotten_first() -> None:
    replica = Replica()
    said = [message(OPERATOR, UavReady(f"x{n:05}", 1, ""), n + 1) for n in range(2000)]
    replica.join_all([*said, message(OPERATOR, UavReady("u0", 1, ""), 5000)])
    replica.join(message(COORDINATOR, brief(*FLEET)))

    assert len(replica.readies) == 1001
    assert "u0" in replica.readies
    kept = [known for known in replica.messages({OPERATOR}) if isinstance(known, Message)]
    assert len(kept) == 1001
