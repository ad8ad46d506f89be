"""What the coordinator makes of a mission that asks for what the field does."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from coordinator.core.lifecycle import PlanMade, Replan, Replanned
from coordinator.core.publication import (
    exit_status,
    mission_config_of,
    task_entry_of,
    unsayable,
)
from sim.world.settings import planned_anew
from swarm.allocation.field import FieldProblem
from swarm.model import Base, BaseId, Mission, TaskId, Zone, ZoneId
from swarm.model.ids import COORDINATOR, OPERATOR
from swarm.model.plan import LeftOut
from swarm.protocol.board import TaskBoard, is_of_field, mission_of
from swarm.protocol.calibration import FlightRates
from swarm.protocol.codec import Codec
from swarm.protocol.encoding import encode
from swarm.protocol.field_messages import UavReady, ZoneEdit, ZoneSpec
from swarm.protocol.messages import Body, MissionConfig, MissionPhase, TaskEntry
from swarm.protocol.registers import Replica
from swarm.protocol.uav_messages import BaseStage, Calibration
from swarm.scenario import load_scenario, resolve_scenario
from tests.support.builders import (
    IDLE,
    brief_of,
    done,
    entries_of,
    failed,
    held,
    message,
    mission,
    random_mission,
    task,
    uav,
)
from tests.support.field_missions import mission_of as mission_of_draft
from tests.support.field_oracle.made_up import made_up
from tests.support.lone_coordinator import (
    LAYERS,
    TIMING,
    LoneCoordinator,
    finishes,
    notes,
    plan_of,
    plans_wanted,
    said,
)

CORNERS = ((20.0, -5.0), (30.0, -5.0), (30.0, 5.0), (20.0, 5.0))
ZONE = ZoneSpec("z", CORNERS, (), None, None, False)
U0, U1 = uav("u0"), uav("u1")
WINDOWED = replace(task("t0", 5.0), closes_s=40.0)


def told(flown: Mission) -> Replica:
    """A replica that has heard all that the coordinator says of ``flown``, from its bytes."""
    replica, codec = Replica(), Codec(flown.name)
    bodies: list[Body] = [mission_config_of(flown, LAYERS, 1)]
    bodies += [task_entry_of(each, n) for n, each in enumerate(flown.tasks)]
    for counter, body in enumerate(bodies, 1):
        message_ = replace(message(COORDINATOR, body, counter), mission=flown.name)
        heard = codec.decode(message_.key, encode(message_))
        assert heard is not None, codec.dropped
        replica.join(heard)
    return replica


def as_told(flown: Mission) -> Mission:
    """``flown`` without what no register tells: when tasks appear, and shares of endless ones."""
    tasks = tuple(replace(each, appears_s=0.0) for each in flown.tasks)
    uavs = tuple(
        each if each.endurance_s is not None else replace(each, reserve_frac=0.2, charge_frac=1.0)
        for each in flown.uavs
    )
    return replace(flown, tasks=tasks, uavs=uavs)


def test_the_shipped_mission_is_read_back_from_the_board_as_it_was_given() -> None:
    flown = load_scenario(resolve_scenario("reservoir-inspection"))
    replica = told(flown)

    assert replica.brief is not None
    assert mission_of(replica, flown.name, replica.brief) == as_told(flown)
    assert TaskBoard(replica, flown.name).mission == as_told(flown)


@pytest.mark.parametrize("seed", range(12))
def test_any_mission_of_the_field_is_read_back_from_the_board(seed: int) -> None:
    flown = mission_of_draft(made_up(seed, n_uavs=3, n_tasks=6))
    board = TaskBoard(told(flown), flown.name)

    found = board.mission
    assert found is not None
    assert replace(found, origin=None) == replace(as_told(flown), origin=None)
    assert (board.field_problem is not None) == is_of_field(flown)


def test_a_plain_mission_says_not_a_byte_more_than_before() -> None:
    flown = random_mission(np.random.default_rng(3))
    bodies: list[Body] = [mission_config_of(flown, LAYERS, 1), *entries_of(flown)]
    for body in bodies:
        assert encode(message(COORDINATOR, body))[:2] == b"\x97\x01"
    assert brief_of(flown).bases == ()


def test_who_flies_is_planned_for_in_the_layers_of_the_brief_though_others_are_missing() -> None:
    """A zone that ends between both layers: the second UAV flies over it, whoever is there."""
    low = replace(ZONE.zone(), ceiling_m=11.0)
    flown = replace(mission((U0, U1), (task("t0", 50.0),)), zones=(low,), schema=2)
    fleet = LoneCoordinator(flown)
    fleet.see("u0", "u1")
    fleet.leave("u0")

    wanted = plans_wanted(fleet.ready("u1"))[-1].mission
    flies = TaskBoard(fleet.core.replica, flown.name).field_problem
    assert flies is not None
    assert [uav.id for uav in wanted.uavs] == ["u1"]
    planned = FieldProblem.from_mission(wanted)
    assert planned.leg_s[0, 0, -1] == flies.leg_s[flies.kind[1], 1, -1]


def test_what_no_message_has_room_for_is_named_before_anybody_waits_for_it() -> None:
    def line(points: int) -> Mission:
        path = tuple((0.1 + n, 0.2, 0.3) for n in range(points))
        return mission([U0], [replace(task("t0", 0.0), position_enu_m=path[0], path_enu_m=path)])

    (complaint,) = unsayable(line(400), LAYERS)
    assert complaint.startswith("the line of task t0 has 400 points, and a message has room for ")
    room = int(complaint.rpartition(" ")[2])
    assert unsayable(line(room), LAYERS) == []
    assert unsayable(line(room + 1), LAYERS) != []
    assert told(line(room)).board["t0"].path_enu_m == line(room).tasks[0].path_enu_m

    corners = tuple((0.1 + n, 0.001 * n * n) for n in range(60_000))
    (complaint,) = unsayable(
        replace(mission([U0], []), zones=(Zone(ZoneId("z"), corners),)), LAYERS
    )
    assert "a message has room for 1048576" in complaint


def replans(coordinator: LoneCoordinator) -> list[Replan]:
    return [action for action in coordinator.log if isinstance(action, Replan)]


# -- the epoch ----------------------------------------------------------------------------


def test_a_zone_drawn_or_taken_away_in_flight_is_a_reason_to_plan_the_rest_anew() -> None:
    timing = replace(TIMING, replan_interval_s=5.0)
    flown = mission([U0, U1], [task("t0", 5.0), task("t1", 50.0)])
    coordinator = LoneCoordinator(flown, timing=timing).started()
    coordinator.hear("u0", held("t0", 0.0), 101.0)
    coordinator.run_until(120.0)
    assert replans(coordinator) == []

    coordinator.hear(OPERATOR, ZoneEdit(ZONE, False, 1, "crane"), 123.0)
    coordinator.run_until(140.0)
    (line,) = (line for line in notes(coordinator.log) if line.text == "zone by the operator")
    assert line.fields == {"zone": "z", "reason": "crane"}
    (wanted,) = replans(coordinator)
    assert wanted.reason == "the operator has changed zones"
    assert wanted.situation.field is not None

    coordinator.happen(Replanned(wanted.request, planned_anew(wanted)), 141.0)
    coordinator.run_until(160.0)
    assert len(replans(coordinator)) == 1, "nothing has happened since"
    coordinator.hear(OPERATOR, ZoneEdit(ZONE, True, 1, ""), 161.0)
    coordinator.run_until(180.0)
    assert [each.situation.field is None for each in replans(coordinator)] == [False, True]


def test_before_the_start_it_plans_anew_round_a_zone() -> None:
    coordinator = LoneCoordinator(mission([U0, U1], [task("t0", 50.0)]))
    coordinator.answer_plan("u0", "u1")
    coordinator.hear(OPERATOR, ZoneEdit(ZONE, False, 1, ""))
    coordinator.ready("u0", "u1")
    assert coordinator.phase is None
    assert plans_wanted(coordinator.log)[-1].mission.zones == (ZONE.zone(),)

    coordinator.answer_plan("u1", "u0")
    assert coordinator.phase is MissionPhase.RUNNING


def test_the_first_plan_reckons_with_what_vehicles_tell_of_landing_and_climbing() -> None:
    battery = replace(U0, endurance_s=300.0)
    coordinator = LoneCoordinator(mission([battery, U1], [task("t0", 50.0)]))
    coordinator.hear("u0", Calibration(1.0, 1.0, 0, 23.0, 12.0))
    first, *_ = plans_wanted(coordinator.log)
    coordinator.answer_plan("u0", "u1")
    *_, wanted = plans_wanted(coordinator.log)
    assert first.rates == {}
    assert wanted.rates == {"u0": FlightRates(1.0, 1.0, 23.0, 12.0)}
    assert [uav.id for uav in wanted.mission.uavs] == ["u0", "u1"]

    coordinator.answer_plan("u1", "u0")
    coordinator.hear("u0", Calibration(1.0, 1.0, 0, 24.0, 13.0))
    assert plans_wanted(coordinator.log)[-1] == wanted, "hardly otherwise"
    coordinator.ready("u0", "u1")
    assert coordinator.phase is MissionPhase.RUNNING
    coordinator.run_until(120.0)
    assert replans(coordinator) == [], "the plan knows it already"


def test_the_first_plan_counts_on_the_acceleration_that_vehicles_tell() -> None:
    battery = replace(U0, endurance_s=300.0)
    coordinator = LoneCoordinator(mission([battery, U1], [task("t0", 50.0)]))
    coordinator.answer_plan("u0", "u1")
    limits = Calibration(1.0, 1.0, 0, acceleration_m_s2=2.0, speed_m_s=0.5 * U0.speed_m_s)
    coordinator.hear("u0", limits)
    first, wanted = plans_wanted(coordinator.log)
    assert first.rates == {}
    assert wanted.rates == {"u0": FlightRates(acceleration_m_s2=2.0, speed_m_s=0.5 * U0.speed_m_s)}

    coordinator.answer_plan("u1", "u0")
    coordinator.ready("u0", "u1")
    assert coordinator.phase is MissionPhase.RUNNING
    coordinator.run_until(120.0)
    assert replans(coordinator) == [], "the plan knows it already"


def test_the_scenarios_acceleration_goes_before_the_vehicles() -> None:
    briefed = replace(U0, acceleration_m_s2=3.0)
    coordinator = LoneCoordinator(mission([briefed, U1], [task("t0", 50.0)]))
    coordinator.answer_plan("u0", "u1")
    coordinator.hear("u0", Calibration(1.0, 1.0, 0, acceleration_m_s2=1.0))
    assert len(plans_wanted(coordinator.log)) == 1
    coordinator.hear("u1", Calibration(1.0, 1.0, 0, acceleration_m_s2=1.0))
    *_, wanted = plans_wanted(coordinator.log)
    assert wanted.rates == {"u1": FlightRates(acceleration_m_s2=1.0)}


def test_a_plan_without_the_fields_keys_stays_as_it_was_whatever_vehicles_tell() -> None:
    coordinator = LoneCoordinator(mission([U0, U1], [task("t0", 50.0)]))
    coordinator.answer_plan("u0", "u1")
    coordinator.hear("u0", Calibration(1.0, 1.0, 0, acceleration_m_s2=1.0, speed_m_s=0.1))
    coordinator.ready("u0", "u1")
    assert len(plans_wanted(coordinator.log)) == 1
    assert coordinator.phase is MissionPhase.RUNNING


def test_a_plan_without_constraints_is_of_the_schema_of_the_file() -> None:
    """It tells a schedule, also while what asks for one has not appeared."""
    window = replace(task("t1", 50.0), appears_s=30.0, closes_s=90.0)
    for flown in (
        replace(mission([U0], [task("t0", 5.0)]), schema=2),
        mission([U0], [task("t0", 5.0), window]),
    ):
        (wanted,) = plans_wanted(LoneCoordinator(flown).log)
        assert [each.id for each in wanted.mission.tasks] == ["t0"]
        assert wanted.mission.schema == 2
    (wanted,) = plans_wanted(LoneCoordinator(mission([U0], [task("t0", 5.0)])).log)
    assert wanted.mission.schema == 1


def test_an_epoch_tells_what_its_plan_leaves_out_and_then_what_nobody_can_do_any_more() -> None:
    flown = mission([U0], [WINDOWED, replace(task("t1", 900.0), due_s=50.0)])
    timing = replace(TIMING, replan_interval_s=5.0)
    coordinator = LoneCoordinator(flown, timing=timing)
    plan = replace(plan_of(flown, "u0"), left_out={TaskId("t1"): LeftOut.DUE})
    (wanted,) = plans_wanted(coordinator.log)
    coordinator.happen(PlanMade(wanted.request, plan))
    coordinator.ready("u0")
    assert coordinator.epoch is not None
    assert coordinator.epoch.left_out == {"due": ("t1",)}

    coordinator.hear("u0", held("t0", 0.0), 101.0)
    coordinator.run_until(120.0)

    epoch = coordinator.epoch
    assert (epoch.number, epoch.phase) == (1, MissionPhase.RUNNING)
    assert epoch.left_out == {"nobody can": ("t1",)}
    (line,) = (line for line in notes(coordinator.log) if line.text == "leaves out other tasks")
    assert line.fields == {"tasks": "t1 (nobody can)"}

    coordinator.hear("u0", done("t0", 25.0), 125.0)
    coordinator.hear("u0", IDLE, 125.0)
    coordinator.run_until(300.0)
    assert coordinator.phase is MissionPhase.ENDED
    assert coordinator.epoch.left_out == {"nobody can": ("t1",)}


def test_that_a_uav_may_start_again_is_logged_and_kept() -> None:
    coordinator = LoneCoordinator(mission([U0], [WINDOWED])).started()
    coordinator.hear(OPERATOR, UavReady("u0", 1, "battery 7"))

    (line,) = (line for line in notes(coordinator.log) if "start again" in line.text)
    assert line.fields == {"uav": "u0", "reason": "battery 7"}
    kept = coordinator.core.memory(coordinator.now_s).messages
    assert UavReady("u0", 1, "battery 7") in [each.body for each in kept]


# -- the end ------------------------------------------------------------------------------


def test_a_mission_ends_when_nobody_can_do_what_is_left_in_time() -> None:
    flown = mission([U0], [WINDOWED, replace(task("t1", 900.0), due_s=50.0)])
    coordinator = LoneCoordinator(flown).started()
    coordinator.hear("u0", held("t0", 0.0), 101.0)
    coordinator.hear("u0", done("t0"), 105.0)
    coordinator.hear("u0", IDLE, 105.0)
    coordinator.run_until(400.0)

    assert coordinator.phase is MissionPhase.ENDED
    coordinator.leave("u0")
    assert finishes(coordinator.run_until(500.0)) == [0], "it was due, and may be left out"


def test_who_hovers_nobody_knows_where_has_the_time_to_claim_what_it_can_do() -> None:
    """It may be near the task, as one that the operator has held on its way."""
    flown = mission([U0], [task("t0", 5.0), replace(task("t1", 900.0), closes_s=50.0)])
    coordinator = LoneCoordinator(flown).started()
    coordinator.hear("u0", held("t0", 0.0), 101.0)
    coordinator.hear("u0", done("t0"), 105.0)
    coordinator.hear("u0", IDLE, 105.0)
    coordinator.run_until(105.5)
    assert coordinator.phase is MissionPhase.RUNNING

    coordinator.hear("u0", held("t1", 5.0, completion_s=20.0), 105.6)
    coordinator.run_until(140.0)
    assert coordinator.phase is MissionPhase.RUNNING


@pytest.mark.parametrize(("left_m", "waits"), [(40.0, True), (900.0, False)])
def test_who_hovers_nobody_knows_where_has_all_of_its_sortie_to_fly_to_a_base_for_what_is_left(
    left_m: float, waits: bool
) -> None:
    """From its last task it could not reach that base any more; it may have left its next way."""
    battery = replace(U0, endurance_s=100.0, reserve_frac=0.0)
    base = Base(BaseId("b0"), (0.0, 0.0, 0.0), swap_s=30.0)
    flown = replace(mission([battery], [task("t0", 45.0), task("t1", left_m)]), bases=(base,))
    coordinator = LoneCoordinator(flown).started()
    coordinator.hear("u0", replace(held("t0", 0.0, completion_s=60.0), sortie_end_s=75.0), 101.0)
    coordinator.hear("u0", done("t0", 60.0), 160.0)
    coordinator.hear("u0", replace(IDLE, sortie_end_s=75.0), 160.0)
    coordinator.run_until(174.0)
    assert (coordinator.phase is MissionPhase.RUNNING) == waits

    coordinator.run_until(180.0)
    assert coordinator.phase is MissionPhase.ENDED


def test_a_mission_goes_on_as_long_as_a_uav_can_swap_for_what_is_left() -> None:
    battery = replace(U0, endurance_s=100.0, reserve_frac=0.0)
    base = Base(BaseId("b0"), (0.0, 0.0, 0.0), swap_s=30.0)
    flown = replace(mission([battery], [task("t0", 5.0), task("t1", 45.0)]), bases=(base,))
    flies = replace(held("t0", 0.0, completion_s=30.0), sortie_end_s=100.0)
    coordinator = LoneCoordinator(flown).started()
    coordinator.hear("u0", flies, 101.0)
    coordinator.hear("u0", done("t0", 30.0), 130.0)
    at_base = replace(held("t9", 30.0), task=None, base="b0", stage=BaseStage.LANDED)
    coordinator.hear("u0", replace(at_base, completion_s=65.0), 131.0)
    coordinator.run_until(600.0)
    assert coordinator.phase is MissionPhase.RUNNING

    without = LoneCoordinator(replace(flown, bases=())).started()
    without.hear("u0", flies, 101.0)
    without.hear("u0", done("t0", 30.0), 130.0)
    without.hear("u0", replace(IDLE, sortie_end_s=100.0), 131.0)
    without.run_until(600.0)
    assert without.phase is MissionPhase.ENDED


@pytest.mark.parametrize(
    ("ended", "status"),
    [
        ({"near": "done", "due": None, "never": None}, 0),
        ({"near": None, "due": "done", "never": None}, 1),
        ({"near": "failed", "due": None, "never": None}, 1),
        ({"near": "done", "due": "failed", "never": None}, 0),
        ({"near": "withdrawn", "due": None, "never": None}, 0),
    ],
)
def test_what_is_left_makes_a_mission_fail_only_if_it_was_to_be_done_and_could_be(
    ended: dict[str, str | None], status: int
) -> None:
    flown = mission(
        [U0],
        [
            task("near", 5.0),
            replace(task("due", 6.0), due_s=60.0),
            replace(task("never", 900.0), closes_s=10.0),
        ],
    )
    replica = told(flown)
    for counter, (name, how) in enumerate(ended.items(), 10):
        entry = replica.board[name]
        if how == "withdrawn":
            replica.join(message(COORDINATOR, replace(entry, withdrawn=True), counter))
        elif how is not None:
            replica.join(message("u0", done(name) if how == "done" else failed(name), counter))

    assert exit_status(TaskBoard(replica, flown.name), flown) == status


def test_what_is_published_of_the_field_is_understood() -> None:
    coordinator = LoneCoordinator(
        replace(mission([U0], [WINDOWED]), zones=(ZONE.zone(),), wind_enu_m_s=(1.0, 0.0))
    )
    (brief,) = said(coordinator.log, MissionConfig)
    (entry,) = said(coordinator.log, TaskEntry)

    assert (brief.zones, brief.wind_enu_m_s) == ((ZONE,), (1.0, 0.0))
    assert entry.closes_s == 40.0
