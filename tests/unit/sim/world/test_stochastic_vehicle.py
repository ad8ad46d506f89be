"""A vehicle that flies as a realization says."""

from __future__ import annotations

import math
from dataclasses import replace

import pytest

from agent.core.interface import (
    Arrived,
    AttemptFailed,
    GoTo,
    Hold,
    Prepare,
    Telemetry,
    VehicleReady,
    VehicleReport,
)
from sim.world.engine import EventQueue
from sim.world.uncertainty import Realization, Uncertainty
from sim.world.vehicles import IdealVehicle, StochasticVehicle
from swarm.model import Mission
from tests.support.builders import mission, task, uav

FLOWN = mission([uav("u0", speed_m_s=10.0)], [task("t0", 50.0), task("t1", 80.0)])
LAYER_M = 12.0


class Flight:
    """The vehicle of u0 with a record of its reports."""

    def __init__(self, uncertainty: Uncertainty, flown: Mission = FLOWN, seed: int = 1) -> None:
        self.queue = EventQueue()
        self.reports: list[tuple[float, VehicleReport]] = []
        self.fate: Realization = uncertainty.draw(flown, 100.0, seed)
        self.vehicle = StochasticVehicle(self.queue, "u0", self._note, self.fate)
        self.vehicle.order(Prepare((0.0, 0.0, LAYER_M), 10.0), VehicleReady())
        self.queue.run(0.0)

    def _note(self, report: VehicleReport) -> None:
        self.reports.append((self.queue.now_s(), report))

    def fly(self, leg: int, name: str, attempt: int = 1) -> None:
        (target,) = [each for each in self.fate.mission.tasks if each.id == name]
        east_m, north_m, _ = target.position_enu_m
        order = GoTo(leg, (east_m, north_m, LAYER_M), 0.0, task=name, attempt=attempt)
        self.vehicle.order(order, VehicleReady())

    def arrival_s(self, leg: int) -> float:
        self.queue.run(1e6)
        (at_s,) = [at_s for at_s, report in self.reports if report == Arrived(leg)]
        return at_s

    @property
    def telemetry(self) -> Telemetry:
        told = self.vehicle.telemetry()
        assert told is not None
        return told


@pytest.mark.parametrize("acceleration_m_s2", [None, 3.0])
def test_in_a_certain_world_it_flies_as_the_ideal_vehicle_to_the_last_bit(
    acceleration_m_s2: float | None,
) -> None:
    reports: list[tuple[float, VehicleReport]] = []
    queue = EventQueue()
    ideal = IdealVehicle(queue, lambda report: reports.append((queue.now_s(), report)))
    prepare = Prepare((0.0, 0.0, LAYER_M), 10.0, acceleration_m_s2=acceleration_m_s2)
    ideal.order(prepare, VehicleReady())
    (only,) = FLOWN.uavs
    slow = replace(only, acceleration_m_s2=acceleration_m_s2)
    fated = Flight(Uncertainty(), replace(FLOWN, uavs=(slow,)))
    places = [(50.1, 33.3), (80.7, -12.3), (0.1, 0.2)]
    for leg, (east_m, north_m) in enumerate(places):
        order = GoTo(leg, (east_m, north_m, LAYER_M))
        for vehicle, time in ((ideal, queue), (fated.vehicle, fated.queue)):
            time.at(3.7 * leg, lambda v=vehicle, o=order: v.order(o, VehicleReady()))  # type: ignore[misc]
    for time in (queue, fated.queue):
        time.run(5.55)
    assert ideal.telemetry() == fated.vehicle.telemetry()
    for time in (queue, fated.queue):
        time.run(1e3)

    assert reports == fated.reports


def test_its_own_speed_and_that_of_the_leg_decide_when_it_arrives() -> None:
    flight = Flight(Uncertainty(speed_sd_frac=0.3, leg_sd_frac=0.2))
    (who,) = flight.fate.mission.uavs
    there, further = flight.fate.mission.tasks
    flight.fly(1, "t0")
    first_s = flight.arrival_s(1)
    flight.fly(2, "t1")

    start, stop = (0.0, 0.0, LAYER_M), (50.0, 0.0, LAYER_M)
    speed_m_s = flight.fate.speed_m_s(who, there.id, start, stop)
    assert speed_m_s != 10.0
    assert first_s == pytest.approx(50.0 / speed_m_s)
    leg_m_s = flight.fate.speed_m_s(who, further.id, stop, (80.0, 0.0, LAYER_M))
    assert leg_m_s != speed_m_s
    assert flight.arrival_s(2) == pytest.approx(first_s + 30.0 / leg_m_s)


def test_a_strong_head_wind_makes_it_late_and_a_tail_wind_not_early() -> None:
    flights = [Flight(Uncertainty(wind_m_s=9.0), seed=seed) for seed in range(20)]
    for flight in flights:
        flight.fly(1, "t0")
    arrivals_s = [flight.arrival_s(1) for flight in flights]

    assert min(arrivals_s) == 5.0
    assert max(arrivals_s) > 7.0


def test_it_believes_to_be_at_the_task_when_it_stands_beside_it() -> None:
    flight = Flight(Uncertainty(position_error_m=5.0))
    (who,) = flight.fate.mission.uavs
    there, further = flight.fate.mission.tasks
    flight.fly(1, "t0")
    first_s = flight.arrival_s(1)
    assert flight.telemetry.position_enu_m == (50.0, 0.0, LAYER_M)
    stop = flight.fate.stop_enu_m(who.id, there)
    assert first_s == pytest.approx(math.dist((0.0, 0.0, 0.0), stop) / 10.0)

    flight.fly(2, "t1")
    way_m = math.dist(stop, flight.fate.stop_enu_m(who.id, further))
    assert flight.arrival_s(2) - first_s == pytest.approx(way_m / 10.0)


def test_on_its_way_it_believes_in_an_even_share_of_the_way() -> None:
    flight = Flight(Uncertainty(position_error_m=20.0, speed_sd_frac=0.4))
    flight.fly(1, "t0")
    half_s = 0.5 * Flight.arrival_s(_same(flight), 1)
    flight.queue.at(half_s, lambda: None)
    flight.queue.run(half_s)

    assert flight.telemetry.position_enu_m == pytest.approx((25.0, 0.0, LAYER_M))


def test_held_on_its_way_it_stays_as_far_astray_as_it_is() -> None:
    flight = Flight(Uncertainty(position_error_m=20.0))
    flight.fly(1, "t0")
    flight.queue.at(2.0, lambda: flight.vehicle.order(Hold("test"), VehicleReady()))
    flight.queue.at(4.0, lambda: flight.fly(2, "t0"))
    held_s = flight.arrival_s(2)
    straight = Flight(Uncertainty(position_error_m=20.0))
    straight.fly(1, "t0")

    assert held_s == pytest.approx(straight.arrival_s(1) + 2.0)


def test_attempts_that_fail_are_told_with_the_arrival_and_each_is_drawn_anew() -> None:
    flown = replace(FLOWN, success_default=0.5)
    flight = Flight(Uncertainty(outcomes=True), flown)
    (who,) = flight.fate.mission.uavs
    there = flight.fate.mission.tasks[0]
    for attempt in range(1, 21):
        flight.fly(attempt, "t0", attempt)
        flight.arrival_s(attempt)
    failed = {r.leg for _, r in flight.reports if isinstance(r, AttemptFailed)}

    assert failed == {n for n in range(1, 21) if not flight.fate.succeeds(who, there, n)}
    assert 0 < len(failed) < 20


def _same(flight: Flight) -> Flight:
    """The same realization, flown from the start."""
    other = Flight(flight.fate.uncertainty)
    other.fly(1, "t0")
    return other


def test_with_an_acceleration_it_believes_to_arrive_when_it_really_does() -> None:
    slow = replace(FLOWN.uavs[0], acceleration_m_s2=2.0)
    flight = Flight(Uncertainty(position_error_m=3.0), replace(FLOWN, uavs=(slow,)))
    flight.fly(1, "t1")
    stop = flight.fate.stop_enu_m(slow.id, flight.fate.mission.tasks[1])
    true_m = math.dist((0.0, 0.0, 0.0), stop)

    assert flight.arrival_s(1) == pytest.approx(true_m / 10.0 + 10.0 / 2.0)
    assert flight.telemetry.position_enu_m == (80.0, 0.0, LAYER_M)
