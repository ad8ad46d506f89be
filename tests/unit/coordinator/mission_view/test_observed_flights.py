"""Where UAVs went, from what they say of it."""

from __future__ import annotations

import pytest

from coordinator.mission_view.approaches import ObservedApproaches
from coordinator.mission_view.observed_flights import ObservedFlights
from sim.world.simulation import simulate_mission
from sim.world.uncertainty import Uncertainty
from swarm.model import Base, BaseId, Mission, Task, TaskId, Uav, UavId
from swarm.protocol.uav_messages import (
    AttemptResult,
    BaseStage,
    Claim,
    ClaimPhase,
    Outcome,
    Status,
    StatusPhase,
)
from tests.support.observed_mission import shipped

UAVS = tuple(Uav(UavId(f"u{n}"), (0.0, 10.0 * n, 0.0), 10.0) for n in range(2))
LINE = ((20.0, 0.0, 0.0), (40.0, 0.0, 0.0), (40.0, 30.0, 0.0))
TASKS = (
    Task(TaskId("t0"), (50.0, 0.0, 0.0), 1.0, service_s=2.0),
    Task(TaskId("line"), LINE[0], 1.0, path_enu_m=LINE),
)
MISSION = Mission("m", 300.0, UAVS, TASKS, bases=(Base(BaseId("b0"), (5.0, 5.0, 0.0), 10.0),))


def status(phase: StatusPhase, mission_s: float, east_m: float, north_m: float = 0.0) -> Status:
    return Status(phase, None, (east_m, north_m, 0.0), None, None, mission_s, {}, "")


def test_a_plain_flight_is_told_as_its_vehicles_flew_it() -> None:
    mission = Mission("m", 300.0, UAVS, (TASKS[0], Task(TaskId("t1"), (0.0, 60.0, 0.0), 2.0)))
    world = simulate_mission(mission, method="greedy", seed=0, uncertainty=Uncertainty()).world
    told = world.mission_state.flights.executed_schedule(world.mission)
    flown = world.executed_schedule()

    for uav, entries in flown.items():
        work = [entry for entry in entries if entry.go != "start"]
        assert [entry.go for entry in told[uav] if entry.go != "start"] == [e.go for e in work]
        for one, other in zip(told[uav], work, strict=False):
            assert (one.depart_s, one.begin_s) == pytest.approx((other.depart_s, other.begin_s))
            assert one.end_s == pytest.approx(other.end_s)
            assert (one.from_enu_m, one.via_enu_m) == (other.from_enu_m, other.via_enu_m)


def test_a_flight_of_the_field_is_told_with_its_corners_and_lines() -> None:
    mission = shipped("reservoir-inspection")
    world = simulate_mission(mission, method="guided", seed=0, uncertainty=Uncertainty()).world
    told, flown = world.mission_state.executed_schedule(), world.executed_schedule()

    corners = 0
    for uav, entries in flown.items():
        work = [entry for entry in entries if entry.go in mission_tasks(mission)]
        seen = [entry for entry in told[uav] if entry.go in mission_tasks(mission)]
        assert [entry.go for entry in seen] == [entry.go for entry in work]
        for one, other in zip(seen, work, strict=True):
            assert one.end_s == pytest.approx(other.end_s)
            assert one.begin_s == pytest.approx(other.begin_s, abs=0.5)
            assert one.is_reversed == other.is_reversed
            assert one.from_enu_m == pytest.approx(other.from_enu_m, abs=0.1)
            assert len(one.via_enu_m) == len(other.via_enu_m)
            for point, true in zip(one.via_enu_m, other.via_enu_m, strict=True):
                assert point == pytest.approx(true, abs=0.1)
            corners += len(one.via_enu_m) - 1
    assert corners > 0


def mission_tasks(mission: Mission) -> set[str]:
    return {str(task.id) for task in mission.tasks}


def test_who_turned_aside_in_flight_set_off_from_there() -> None:
    flights = ObservedFlights(ObservedApproaches(5.0))
    flights.hear("u0", Claim(ClaimPhase.HELD, "t0", 0.0, 0, 7.0))
    for at_s in (1.0, 2.0, 3.0):
        flights.hear_status("u0", status(StatusPhase.FLYING, at_s, 10.0 * at_s), 10.0, (), at_s)
    for _ in range(2):  # said again when it is held, from farther on
        flights.hear("u0", Claim(ClaimPhase.HELD, "line", 3.1, 0, 40.0))
        flights.hear_status("u0", status(StatusPhase.FLYING, 4.0, 25.0), 10.0, (), 4.0)
    flights.hear("u0", Outcome("line", AttemptResult.DONE, 1, 40.0))

    (entry,) = flights.executed_schedule(MISSION)[UavId("u0")]

    assert (entry.go, entry.depart_s, entry.from_enu_m) == ("line", 3.1, (30.0, 0.0))


def test_who_had_nothing_to_do_for_a_while_sets_off_when_it_says_so() -> None:
    flights = ObservedFlights(ObservedApproaches(5.0))
    for mission_s, phase in ((30.0, ClaimPhase.PROPOSED), (30.4, ClaimPhase.HELD)):
        flights.hear("u0", Claim(phase, "t0", 10.0, 0, 37.0), mission_s)
    flights.hear("u0", Outcome("t0", AttemptResult.DONE, 1, 37.0), 37.0)

    (entry,) = flights.executed_schedule(MISSION)[UavId("u0")]

    assert (entry.depart_s, entry.begin_s, entry.end_s) == (30.0, 35.0, 37.0)


def test_swaps_lines_and_the_way_home_are_told() -> None:
    flights = ObservedFlights(ObservedApproaches(5.0))
    approach = Claim(
        ClaimPhase.HELD, None, 0.0, 0, 20.0, base="b0", stage=BaseStage.APPROACHING, arrives_s=9.0
    )
    landed = Claim(
        ClaimPhase.HELD, None, 0.0, 0, 19.5, base="b0", stage=BaseStage.LANDED, arrives_s=9.5
    )
    line = Claim(ClaimPhase.HELD, "line", 19.5, 0, 40.0, reversed=True)
    out = Claim(ClaimPhase.OUT, None, 41.0, 0, 41.0)
    for claim in (approach, landed, landed, line, out):
        flights.hear("u0", claim)
        if claim is out:
            flights.hear("u0", Outcome("line", AttemptResult.DONE, 1, 40.0))
    flights.hear_status("u0", status(StatusPhase.HOME, 50.0, 0.0), 10.0, (), 50.0)
    entries = flights.executed_schedule(MISSION)[UavId("u0")]

    assert [entry.go for entry in entries] == ["base:b0", "line", "start"]
    assert (entries[0].begin_s, entries[0].end_s) == (9.5, 19.5)
    assert (entries[1].is_reversed, entries[1].via_enu_m) == (True, ((40.0, 30.0),))
    assert entries[2].from_enu_m == (20.0, 0.0)
    assert (entries[2].depart_s, entries[2].arrive_s) == (41.0, 50.0)


def test_of_a_fleet_that_said_nothing_nothing_is_told() -> None:
    flights = ObservedFlights(ObservedApproaches(5.0))

    assert flights.executed_schedule(MISSION) == {UavId("u0"): (), UavId("u1"): ()}
    assert flights.approaches.nearest is None


def test_a_list_that_ends_at_a_base_has_no_other_way_home() -> None:
    flights = ObservedFlights(ObservedApproaches(5.0))
    landed = Claim(
        ClaimPhase.HELD, None, 0.0, 0, 19.5, base="b0", stage=BaseStage.LANDED, arrives_s=9.5
    )
    parked = Claim(ClaimPhase.IDLE, None, 19.5, 0, 19.5, base="b0", stage=BaseStage.PARKED)
    for claim in (landed, parked, Claim(ClaimPhase.OUT, None, 41.0, 0, 41.0)):
        flights.hear("u0", claim)
    flights.hear_status("u0", status(StatusPhase.HOME, 41.0, 5.0, 5.0), 10.0, (), 41.0)

    assert [entry.go for entry in flights.executed_schedule(MISSION)["u0"]] == ["base:b0"]  # type: ignore[index]
