"""One mission flown in virtual time, timed."""

from __future__ import annotations

from dataclasses import replace

import pytest

from sim.bench.flight import FlightBench, measure_flight
from sim.world.uncertainty import Uncertainty
from swarm.runtime.clock import SystemClock


def flown(*, loss: float = 0.3, coordinator: bool = True) -> FlightBench:
    uncertainty = Uncertainty(loss=loss, popup=loss)
    interval_s = 5.0 if coordinator else None
    return measure_flight(4, 24, 1, uncertainty, SystemClock(), replan_interval_s=interval_s)


def test_without_losses_and_pop_ups_the_plan_is_flown_and_nothing_is_planned_anew() -> None:
    found = flown(loss=0.0)

    assert found.of_undisturbed == pytest.approx(1.0, rel=1e-9)
    assert (found.done, found.missed, found.lost_uavs, found.epochs) == (24, 0, 0, 1)
    decides, hears, led, replans = found.work
    assert decides.count >= 24
    assert hears.count > led.count > 0
    assert replans.count == 0
    assert replans.median_s is None


def test_all_but_times_and_memory_follows_from_the_seed() -> None:
    found, again = flown(), flown()

    assert 0.0 < found.of_undisturbed < 1.0
    assert found.work[3].count > 0

    def told(each: FlightBench) -> FlightBench:
        return replace(each, machine=found.machine, work=(), cpu_s=0.0, wall_s=0.0, peak_bytes=0)

    assert told(found) == told(again)
    assert [each.count for each in found.work] == [each.count for each in again.work]


def test_a_dead_coordinator_plans_nothing_anew() -> None:
    found = flown(coordinator=False)

    assert found.epochs == 1
    assert found.work[3].count == 0
