"""Vehicles of the field: paths in the times of their plans, batteries, landings, falls."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace
from itertools import accumulate, islice, pairwise

import pytest

from agent.core.interface import (
    Arrived,
    GoTo,
    Held,
    Hold,
    Home,
    Landed,
    Prepare,
    Refused,
    Return,
    Swap,
    Swapped,
    VehicleReady,
    VehicleReport,
)
from coordinator.planner.plan import make_plan
from sim.world.engine import EventQueue
from sim.world.field_paths import FieldPaths
from sim.world.field_vehicle import FieldVehicle
from sim.world.flight_log import FlightLog
from sim.world.motion import Point
from sim.world.position_errors import position_errors
from sim.world.uncertainty import Uncertainty
from swarm.model import Base, BaseId, Mission, Task, TaskId, Uav, UavId
from swarm.model.layers import FlightLayers
from swarm.model.plan import Schedule, ScheduleEntry
from swarm.protocol.uav_messages import AttemptResult, Outcome
from swarm.runtime.clock import SystemClock
from tests.support.field_missions import mission_of
from tests.support.field_oracle.made_up import made_up

BASE = Base(BaseId("b0"), (50.0, 0.0, 0.0), swap_s=20.0)
UAV = Uav(UavId("u0"), (0.0, 0.0, 0.0), 10.0, endurance_s=40.0)
MISSION = Mission("field", 300.0, (UAV,), (), bases=(BASE,))
LAYER_M = 10.0


class Flight:
    """The only UAV of a mission, with a record of its reports."""

    def __init__(self, mission: Mission = MISSION, uav: str = "u0") -> None:
        self.queue = EventQueue()
        self.reports: list[tuple[float, VehicleReport]] = []
        self.fell_s: list[float] = []
        self.heed: Callable[[VehicleReport], None] = lambda _: None
        self.vehicle = FieldVehicle(self.queue, uav, self._note, FieldPaths(mission))
        self.log = FlightLog(mission, {uav: self.vehicle.track})
        self.vehicle.when_empty = lambda: self.fell_s.append(self.queue.now_s())
        self.uav = uav
        layer_m = FlightLayers().layer_m([each.id for each in mission.uavs].index(UavId(uav)))
        me = next(each for each in mission.uavs if each.id == uav)
        east_m, north_m, up_m = me.position_enu_m
        start = (east_m, north_m, up_m + layer_m)
        self.vehicle.order(Prepare(start, 10.0), VehicleReady())
        self.vehicle.begin_mission()
        self.queue.run(0.0)

    def _note(self, report: VehicleReport) -> None:
        self.reports.append((self.queue.now_s(), report))
        self.log.reported(self.uav, report, self.queue.now_s())
        self.heed(report)

    def order(self, order: GoTo | Swap | Hold | Return) -> None:
        telemetry = self.vehicle.telemetry()
        assert telemetry is not None
        self.log.ordered(self.uav, order, telemetry, self.queue.now_s())
        self.vehicle.order(order, VehicleReady())

    def at(self, time_s: float, order: GoTo | Swap | Hold | Return) -> None:
        self.queue.at(time_s, lambda: self.order(order))

    def wait(self, until_s: float) -> None:
        """Let it become so late."""
        self.queue.at(until_s, lambda: None)
        self.queue.run(until_s)

    def told(self, report: VehicleReport) -> float:
        """When it said that, once [s]."""
        (time_s,) = (time_s for time_s, each in self.reports if each == report)
        return time_s

    @property
    def charge_frac(self) -> float | None:
        telemetry = self.vehicle.telemetry()
        assert telemetry is not None
        return telemetry.battery_frac


def above(east_m: float, north_m: float = 0.0) -> Point:
    return east_m, north_m, LAYER_M


def test_corners_are_flown_through_without_stopping() -> None:
    flight = Flight()
    flight.order(GoTo(1, above(30.0, 40.0), via_enu_m=(above(30.0),)))
    flight.wait(5.0)
    telemetry = flight.vehicle.telemetry()
    assert telemetry is not None
    assert telemetry.velocity_enu_m_s == pytest.approx((0.0, 10.0, 0.0))
    flight.queue.run(30.0)

    assert flight.reports[1:] == [(7.0, Arrived(1))]


def test_between_its_layer_and_the_height_of_a_task_it_stops_in_no_time() -> None:
    """Where it stops is not in its layer, and it does not fly as if it had to get there."""
    high = Task(TaskId("t0"), (30.0, 0.0, 0.0), 1.0, height_m=70.0)
    flight = Flight(replace(MISSION, tasks=(high,)))
    flight.order(GoTo(1, (30.0, 0.0, 70.0), task="t0"))
    flight.wait(4.0)
    telemetry = flight.vehicle.telemetry()
    assert telemetry is not None
    assert LAYER_M + 10.0 < telemetry.position_enu_m[2] < 60.0
    flight.order(GoTo(2, telemetry.position_enu_m))
    flight.wait(4.0 + 1e-6)

    assert flight.told(Arrived(2)) == pytest.approx(4.0)


def test_a_layer_that_is_climbed_to_upright_takes_as_long_as_the_way_is() -> None:
    """From a task's height down to a layer below the own one, and along it."""
    apart = FieldPaths(replace(MISSION, separation_m=5.0, band_m=(20.0, 60.0)))
    corners = [(0.0, 0.0, 24.0), (0.0, 0.0, 20.0), (8.0, 0.0, 20.0)]
    assert apart.path("u0", corners, (0.0, 50.0)).duration_s == pytest.approx(1.2)
    assert apart.path("u0", corners[1:], (30.0, 50.0)).duration_s == pytest.approx(0.8)


def test_who_lands_from_another_layer_takes_off_into_its_own() -> None:
    flight = Flight()
    flight.order(Return("no slot", via_enu_m=(50.0, 0.0, 30.0), land=True))
    flight.wait(10.0)
    assert flight.told(Home()) < 10.0
    flight.order(GoTo(1, above(50.0)))
    telemetry = flight.vehicle.telemetry()
    assert telemetry is not None
    assert telemetry.position_enu_m == pytest.approx(above(50.0))


def test_with_an_acceleration_the_whole_path_is_flown_from_rest_to_rest() -> None:
    flight = Flight(replace(MISSION, uavs=(replace(UAV, acceleration_m_s2=2.0),)))
    flight.order(GoTo(1, above(30.0, 40.0), via_enu_m=(above(30.0),)))
    flight.queue.run(30.0)

    assert flight.told(Arrived(1)) == pytest.approx(70.0 / 10.0 + 10.0 / 2.0)


RETURN = Return(
    "it is over", path_enu_m=(above(30.0, 40.0),), via_enu_m=above(0.0, 40.0), land=True
)


@pytest.mark.parametrize(
    ("again", "arrives_s"),
    [
        pytest.param(GoTo(2, above(0.0, 40.0), via_enu_m=(above(30.0, 40.0),)), 15.0, id="there"),
        pytest.param(RETURN, 15.0, id="home that way"),
        pytest.param(GoTo(2, above(30.0, 40.0)), 8.0 + 2.0 * 7.5**0.5, id="not as far"),
        pytest.param(
            replace(RETURN, path_enu_m=()),
            8.0 + 2.0 * (math.hypot(30.0, 15.0) / 2.0) ** 0.5,
            id="home another way",
        ),
    ],
)
def test_who_is_told_to_fly_what_is_left_of_its_way_does_not_stop_for_that(
    again: GoTo | Return, arrives_s: float
) -> None:
    """As autopilots do; to fly elsewhere begins at rest."""
    flight = Flight(replace(MISSION, uavs=(replace(UAV, acceleration_m_s2=2.0),)))
    corners = above(30.0), above(30.0, 40.0), above(0.0, 40.0)
    flight.order(GoTo(1, corners[-1], via_enu_m=corners[:-1]))
    flight.at(8.0, again)  # 25 m behind the first corner, at 10 m/s
    flight.queue.run(60.0)

    assert flight.told(Home() if isinstance(again, Return) else Arrived(2)) == pytest.approx(
        arrives_s
    )
    assert Arrived(1) not in [report for _, report in flight.reports]


def test_position_and_track_agree_at_every_instant() -> None:
    flight = Flight(replace(MISSION, uavs=(replace(UAV, acceleration_m_s2=2.0),)))
    flight.order(GoTo(1, above(30.0, 40.0), via_enu_m=(above(30.0), above(30.0, 20.0))))
    flight.at(4.0, GoTo(2, above(0.0, 0.0), via_enu_m=(above(-5.0, 9.0),)))
    for step in range(1, 200):
        flight.wait(0.1 * step)
        telemetry = flight.vehicle.telemetry()
        true = flight.vehicle.track.position_enu_m(flight.queue.now_s())
        assert telemetry is not None
        assert true == pytest.approx(telemetry.position_enu_m, abs=1e-9)
    pieces = flight.vehicle.track.pieces()
    for one, other in pairwise(pieces):
        assert one.end_s == other.begin_s
        assert one.position_enu_m(one.end_s) == pytest.approx(other.place_enu_m, abs=1e-9)


def test_a_battery_drains_in_the_air_alone_and_is_full_after_a_swap() -> None:
    flight = Flight()
    flight.order(GoTo(1, above(50.0)))
    flight.at(10.0, Swap(2, BASE.position_enu_m))
    flight.wait(10.0)
    assert flight.charge_frac == pytest.approx(0.75)
    flight.wait(29.0)
    assert flight.charge_frac == pytest.approx(0.75)
    flight.wait(35.0)

    assert flight.reports[1:] == [(5.0, Arrived(1)), (10.0, Landed(2)), (30.0, Swapped(2))]
    assert flight.charge_frac == 1.0
    flight.order(GoTo(3, above(0.0)))
    flight.queue.run(60.0)
    assert flight.reports[4:] == [(40.0, Arrived(3))]
    assert flight.vehicle.track.flights_s == [(0.0, 10.0), (35.0, math.inf)]


def test_who_flies_longer_than_its_battery_lasts_falls_and_says_nothing_more() -> None:
    flight = Flight()
    flight.order(GoTo(1, above(500.0)))
    flight.queue.run(100.0)

    assert flight.fell_s == [pytest.approx(40.0, abs=1e-5)]
    assert flight.reports[1:] == []
    assert flight.vehicle.track.flights_s == [(0.0, flight.fell_s[0])]


def test_a_battery_that_drains_faster_is_empty_earlier() -> None:
    flight = Flight()
    flight.queue.at(10.0, lambda: flight.vehicle.drain_by(3.0))
    flight.queue.run(100.0)

    assert flight.fell_s == [pytest.approx(20.0)]


def test_who_has_landed_in_time_does_not_fall() -> None:
    flight = Flight()
    flight.order(GoTo(1, above(50.0)))
    flight.at(34.9, Return("over"))
    flight.queue.run(300.0)

    assert flight.fell_s == []


def test_no_target_is_taken_while_the_battery_is_being_changed() -> None:
    flight = Flight()
    flight.order(GoTo(1, above(50.0)))
    flight.at(5.0, Swap(2, BASE.position_enu_m))
    order = GoTo(3, above(0.0))
    flight.at(7.0, order)
    flight.queue.run(100.0)

    refused = Refused(order, "its battery is being changed")
    assert (7.0, refused) in flight.reports
    assert (25.0, Swapped(2)) in flight.reports


def test_a_swap_that_was_begun_ends_whoever_asks_for_it_again() -> None:
    flight = Flight()
    flight.order(GoTo(1, above(50.0)))
    flight.at(5.0, Swap(2, BASE.position_enu_m))
    flight.at(7.0, Hold("operator"))
    flight.at(9.0, Swap(4, BASE.position_enu_m))
    flight.queue.run(100.0)

    assert flight.reports[3:] == [(7.0, Held()), (9.0, Landed(4)), (25.0, Swapped(4))]


def test_where_there_is_no_base_no_battery_is_changed() -> None:
    flight = Flight()
    order = Swap(1, (7.0, 7.0, 0.0))
    flight.order(order)
    flight.queue.run(10.0)

    assert flight.reports[1:] == [(0.0, Refused(order, "there is no base"))]


def test_the_way_home_goes_round_corners_and_lands_where_it_is_told_to() -> None:
    flight = Flight()
    flight.order(Return("over", via_enu_m=above(50.0), path_enu_m=(above(0.0, 30.0),), land=True))
    flight.queue.run(100.0)

    flown_s = (30.0 + math.hypot(50.0, 30.0)) / 10.0
    assert flight.told(Home()) == pytest.approx(flown_s)
    assert flight.vehicle.track.flights_s[-1] == pytest.approx((0.0, flown_s))
    telemetry = flight.vehicle.telemetry()
    assert telemetry is not None
    assert telemetry.position_enu_m == pytest.approx((50.0, 0.0, 0.0))


def test_in_a_realization_it_flies_at_its_own_pace() -> None:
    task = Task(TaskId("t0"), (50.0, 0.0, 0.0), 1.0)
    mission = replace(MISSION, tasks=(task,))
    fate = Uncertainty(speed_sd_frac=0.3, position_error_m=2.0).draw(mission, 100.0, seed=4)
    reports: list[tuple[float, VehicleReport]] = []
    queue = EventQueue()
    vehicle = FieldVehicle(
        queue,
        "u0",
        lambda report: reports.append((queue.now_s(), report)),
        FieldPaths(mission),
        fate=fate,
    )
    vehicle.order(Prepare(above(0.0), 10.0), VehicleReady())
    vehicle.order(GoTo(1, above(50.0), task="t0"), VehicleReady())
    queue.run(100.0)

    assert [report for _, report in reports] == [Arrived(1)]
    assert reports[-1][0] == pytest.approx(5.0 / fate.speed_frac[UavId("u0")])
    stop = fate.stop_enu_m(UavId("u0"), task)
    true = vehicle.track.position_enu_m(50.0)
    assert true == pytest.approx((stop[0], stop[1], LAYER_M))


def test_with_errors_it_is_beside_its_way_by_what_changes_from_one_to_the_next() -> None:
    queue, errors = EventQueue(), [(1.0, 0.0, 0.5), (0.0, -1.0, 0.0), (0.0, 0.0, 1.0)]
    paths = FieldPaths(MISSION)
    vehicle = FieldVehicle(queue, "u0", lambda _: None, paths, errors=iter(errors))
    vehicle.order(Prepare(above(0.0), 10.0), VehicleReady())
    vehicle.order(GoTo(1, above(50.0)), VehicleReady())
    queue.at(2.5, lambda: None)
    queue.run(2.5)
    told = vehicle.telemetry()
    assert told is not None
    assert told.position_enu_m == pytest.approx(above(25.0))
    assert vehicle.track.position_enu_m(0.0) == pytest.approx((1.0, 0.0, LAYER_M + 0.5))
    assert vehicle.track.position_enu_m(2.5) == pytest.approx((25.5, -0.5, LAYER_M + 0.25))

    vehicle.order(Hold("a test"), VehicleReady())  # where it stops nothing has changed
    assert vehicle.track.position_enu_m(10.0) == pytest.approx((25.5, -0.5, LAYER_M + 0.25))
    vehicle.order(GoTo(2, above(25.0)), VehicleReady())  # nor where it stays
    assert vehicle.track.position_enu_m(10.0) == pytest.approx((25.5, -0.5, LAYER_M + 0.25))
    vehicle.order(GoTo(3, above(0.0)), VehicleReady())
    queue.run(10.0)
    assert vehicle.track.position_enu_m(10.0) == pytest.approx((0.0, 0.0, LAYER_M + 1.0))


def test_errors_are_anywhere_in_their_ball_and_each_uav_has_its_own() -> None:
    drawn = {uav: list(islice(position_errors(7, uav, 2.0), 500)) for uav in ("u0", "u1")}
    off_m = [math.hypot(*error) for error in drawn["u0"]]

    assert drawn["u0"] == list(islice(position_errors(7, "u0", 2.0), 500))
    assert drawn["u0"] != drawn["u1"]
    assert max(off_m) <= 2.0
    assert 0.4 < sum(each > 2.0 * 0.5 ** (1.0 / 3.0) for each in off_m) / 500 < 0.6
    assert all(abs(sum(axis)) / 500 < 0.2 for axis in zip(*drawn["u0"], strict=True))


class ScriptedPilot:
    """Orders what a plan's schedule says, entry by entry, as an agent would."""

    def __init__(self, mission: Mission, schedule: Schedule, uav: str) -> None:
        self.flight = Flight(mission, uav)
        self.mission, self.uav = mission, uav
        self.entries = schedule[UavId(uav)]
        self.tasks = {str(task.id): task for task in mission.tasks}
        self.bases = {str(base.id): base for base in mission.bases}
        self.number = -1
        place = [each.id for each in mission.uavs].index(UavId(uav))
        self.layer_m = FlightLayers().layer_m(place)
        self.start_up_m = mission.uavs[place].position_enu_m[2]

    def run(self) -> tuple[ScheduleEntry, ...]:
        self.flight.heed = self.heed
        if self.entries:
            self.depart()
        self.flight.queue.run(1e5)
        return self.flight.log.executed_schedule(0.0)[UavId(self.uav)]

    def heed(self, report: VehicleReport) -> None:
        entry, flight = self.entries[self.number], self.flight
        task, base = self.tasks.get(entry.go), self.bases.get(entry.base or "")
        match report:
            case Arrived(leg) if base is not None:
                self.at(entry.begin_s, lambda: flight.order(Swap(leg + 1, base.position_enu_m)))
            case Arrived(leg) if task is not None and task.path_enu_m and leg % 10 == 0:
                line = [
                    (e, n, u + self.layer_m if task.height_m is None else task.height_m)
                    for e, n, u in task.path_enu_m[:: -1 if entry.is_reversed else 1]
                ]
                on = GoTo(leg + 1, line[-1], task=entry.go, via_enu_m=tuple(line[1:-1]))
                self.at(entry.begin_s, lambda: flight.order(on))
            case Arrived():
                self.at(entry.end_s, self.end_attempt)
            case Swapped():
                self.at(self.entries[self.number + 1].depart_s, self.depart)
            case _:
                pass

    def at(self, time_s: float, do: Callable[[], None]) -> None:
        self.flight.queue.at(time_s, do)

    def end_attempt(self) -> None:
        now_s = self.flight.queue.now_s()
        ended = Outcome(self.entries[self.number].go, AttemptResult.DONE, 1, now_s)
        self.depart()  # agents order first, too
        self.flight.log.attempt_ended(self.uav, ended, now_s, 0.0)

    def depart(self) -> None:
        self.number += 1
        flight, entry = self.flight, self.entries[self.number]
        here = flight.vehicle.telemetry()
        assert here is not None
        up_m = here.position_enu_m[2] + (0.0 if flight.vehicle.track.airborne else self.layer_m)
        stop_up_m = self.stop_up_m(entry)
        flat = [entry.from_enu_m, *entry.via_enu_m]
        flown_m = [0.0, *accumulate(math.dist(one, other) for one, other in pairwise(flat))]
        way = [
            (east_m, north_m, up_m + (stop_up_m - up_m) * length_m / (flown_m[-1] or 1.0))
            for (east_m, north_m), length_m in zip(flat, flown_m, strict=True)
        ]
        stop = (*flat[-1], stop_up_m)
        corners = tuple(way[1:-1])
        if self.number == len(self.entries) - 1:
            flight.order(Return("over", via_enu_m=stop, path_enu_m=corners, land=True))
        else:
            task = entry.go if entry.go in self.tasks else None
            flight.order(GoTo(10 * self.number, stop, task=task, via_enu_m=corners))

    def stop_up_m(self, entry: ScheduleEntry) -> float:
        """Height at which it arrives."""
        if (task := self.tasks.get(entry.go)) is not None:
            ends = task.path_enu_m or (task.position_enu_m,)
            flown_m = ends[-1 if entry.is_reversed else 0][2] + self.layer_m
            return flown_m if task.height_m is None else task.height_m
        base = self.bases.get(entry.base or "")
        return self.layer_m + (self.start_up_m if base is None else base.position_enu_m[2])


@pytest.mark.parametrize("kind", ["all", "energy", "zones", "wind", "lines"])
def test_plans_of_all_kinds_are_flown_in_their_times(kind: str) -> None:
    flown = 0
    for seed in range(12):
        mission = mission_of(made_up(seed, kind, n_uavs=2, n_tasks=4)).known_at_start()
        schedule = make_plan(mission, "greedy", clock=SystemClock(), seed=0).schedule
        assert schedule is not None
        for uav in mission.uavs:
            pilot = ScriptedPilot(mission, schedule, uav.id)
            told, planned = pilot.run(), schedule[uav.id]
            assert [entry.go for entry in told] == [entry.go for entry in planned]
            for one, other in zip(told, planned, strict=True):
                flown += 1
                assert one.is_reversed == other.is_reversed
                times_s = (one.depart_s, one.arrive_s, one.begin_s, one.end_s)
                wanted_s = (other.depart_s, other.arrive_s, other.begin_s, other.end_s)
                assert times_s == pytest.approx(wanted_s, abs=1e-6), (seed, uav.id, one.go)
                assert one.from_enu_m == pytest.approx(other.from_enu_m, abs=1e-9)
                for at, planned_at in zip(one.via_enu_m, other.via_enu_m, strict=True):
                    assert at == pytest.approx(planned_at, abs=1e-9)
            assert pilot.flight.fell_s == [] or not planned  # nobody calls it home
    assert flown > 20
