"""The ideal vehicle, and the queue that is its time."""

from __future__ import annotations

from dataclasses import replace

from agent.core.interface import (
    Arrived,
    GoTo,
    Home,
    Prepare,
    Return,
    Telemetry,
    VehicleReady,
    VehicleReport,
)
from sim.world.engine import EventQueue
from sim.world.vehicles import IdealVehicle

PREPARE = Prepare((0.0, 0.0, 10.0), 10.0)


class Flight:
    """A vehicle at 10 m/s with a record of its reports."""

    def __init__(self) -> None:
        self.queue = EventQueue()
        self.reports: list[tuple[float, VehicleReport]] = []
        self.vehicle = IdealVehicle(
            self.queue, lambda report: self.reports.append((self.queue.now_s(), report))
        )
        assert self.vehicle.telemetry() is None
        self.vehicle.order(PREPARE, VehicleReady())
        self.queue.run(0.0)

    def fly(self, leg: int, east_m: float) -> None:
        self.vehicle.order(GoTo(leg, (east_m, 0.0, 10.0)), VehicleReady())


def test_it_is_ready_at_once_and_arrives_when_distance_and_speed_say_so() -> None:
    flight = Flight()
    flight.fly(1, 50.0)
    assert flight.queue.run(100.0)

    assert flight.reports == [(0.0, VehicleReady()), (5.0, Arrived(1))]
    telemetry = flight.vehicle.telemetry()
    assert telemetry is not None
    assert telemetry.position_enu_m == (50.0, 0.0, 10.0)


def test_a_new_target_takes_the_place_of_the_old_one_from_where_it_is() -> None:
    flight = Flight()
    flight.fly(1, 50.0)
    flight.queue.at(2.0, lambda: flight.fly(2, 0.0))
    flight.queue.run(100.0)

    assert flight.reports[1:] == [(4.0, Arrived(2))]


def test_with_an_acceleration_it_speeds_up_and_brakes_on_each_leg() -> None:
    flight = Flight()
    flight.vehicle.order(replace(PREPARE, acceleration_m_s2=2.0), VehicleReady())
    flight.queue.at(10.0, lambda: flight.fly(1, 100.0))
    seen: list[Telemetry | None] = []
    flight.queue.at(11.0, lambda: seen.append(flight.vehicle.telemetry()))
    flight.queue.at(30.0, lambda: flight.fly(2, 82.0))
    flight.queue.run(100.0)

    (speeding_up,) = seen
    assert speeding_up == Telemetry((1.0, 0.0, 10.0), (2.0, 0.0, 0.0), None)
    arrivals = [(25.0, Arrived(1)), (36.0, Arrived(2))]  # 10 + 10/1 + 10/2; 2·√(18/2)
    assert [report for report in flight.reports if report[1] != VehicleReady()] == arrivals


def test_sent_home_it_reports_home_and_no_arrival() -> None:
    flight = Flight()
    flight.fly(1, 50.0)
    flight.vehicle.order(Return("over"), VehicleReady())
    flight.queue.run(100.0)

    assert flight.reports[1:] == [(0.0, Home())]


def test_a_target_before_it_is_prepared_is_ignored() -> None:
    queue, reports = EventQueue(), list[VehicleReport]()
    vehicle = IdealVehicle(queue, reports.append)
    vehicle.order(GoTo(1, (1.0, 0.0, 0.0)), VehicleReady())

    assert queue.run(10.0)
    assert reports == []


def test_it_outlives_its_agent_and_is_resumed_where_it_flies() -> None:
    flight = Flight()
    flight.fly(7, 50.0)
    resume = replace(PREPARE, resume=True)
    flight.queue.at(2.0, lambda: flight.vehicle.order(resume, VehicleReady()))
    flight.queue.run(100.0)

    there = Telemetry((20.0, 0.0, 10.0), (10.0, 0.0, 0.0), None)
    assert flight.reports[1:] == [(2.0, there), (2.0, VehicleReady())]
    assert flight.vehicle.telemetry() == Telemetry((50.0, 0.0, 10.0), (0.0, 0.0, 0.0), None)


def test_prepared_anew_in_the_air_it_flies_to_its_start_first() -> None:
    flight = Flight()
    flight.fly(7, 50.0)
    flight.queue.at(2.0, lambda: flight.vehicle.order(PREPARE, VehicleReady()))
    flight.queue.run(100.0)

    assert flight.reports[1:] == [(4.0, VehicleReady())]


def test_once_home_it_begins_at_its_start_again() -> None:
    flight = Flight()
    flight.fly(1, 50.0)
    flight.vehicle.order(Return("over"), VehicleReady())
    assert flight.vehicle.telemetry() is None
    flight.vehicle.order(replace(PREPARE, resume=True), VehicleReady())
    flight.queue.run(100.0)

    assert flight.reports[1:] == [(0.0, VehicleReady())]


def test_the_queue_runs_in_order_of_time_and_then_of_scheduling() -> None:
    queue, ran = EventQueue(), list[tuple[str, float]]()

    def note(name: str) -> None:
        ran.append((name, queue.now_s()))

    queue.at(2.0, lambda: note("late"))
    queue.at(1.0, lambda: note("first"))
    queue.at(1.0, lambda: note("second"))
    queue.at(1.0, lambda: queue.at(0.5, lambda: note("past")))
    assert not queue.run(1.5)
    assert queue.run(2.0)

    assert ran == [("first", 1.0), ("second", 1.0), ("past", 1.0), ("late", 2.0)]
