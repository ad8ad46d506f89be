"""A cruise speed that is told and not flown is said, once, until it is flown."""

from __future__ import annotations

import math

from agent.core.interface import GoTo
from agent.vehicle.supervision import CruiseWatch
from tests.support.bridge_flight import BridgeFlight


def remarks(watch: CruiseWatch, told_m_s: float, *speeds_m_s: float) -> list[str]:
    """What is said while those speeds are flown, at ten a second, each thing once; "": no more."""
    said = [""]
    for number, speed in enumerate(speeds_m_s):
        watch.judge((speed, 0.0, 0.0), told_m_s, 0.1 * number)
        if (remark := watch.remark or "") != said[-1]:
            said.append(remark)
    return said[1:]


def test_a_speed_kept_below_the_one_told_is_said_once() -> None:
    flown = [*range(11), *[10.6] * 100, *range(10, -1, -1), *[10.6] * 100]
    assert remarks(CruiseWatch(), 15.0, *flown) == [
        "it flies at 10.6 m/s, asked for 15: its own limits forbid more"
    ]


def test_a_speed_that_is_reached_after_all_is_no_longer_short_and_never_said_to_be_again() -> None:
    flown = [*range(11), *[10.6] * 100, *[14.0] * 10, *[10.6] * 5, *[14.0] * 100, *[10.6] * 100]
    assert remarks(CruiseWatch(), 15.0, *flown) == [
        "it flies at 10.6 m/s, asked for 15: its own limits forbid more",
        "",
    ]


def test_nothing_is_said_of_a_speed_that_is_reached() -> None:
    assert remarks(CruiseWatch(), 8.0, *range(9), *[7.9] * 100) == []


def test_nothing_is_said_of_a_vehicle_that_still_gains_speed() -> None:
    creeping = [8.0 * (1.0 - math.exp(-0.1 * number / 5.0)) for number in range(100)]
    assert remarks(CruiseWatch(), 8.0, *creeping) == []


def test_nothing_is_said_of_a_vehicle_that_hovers_or_climbs() -> None:
    watch = CruiseWatch()
    assert remarks(watch, 8.0, *[0.2] * 100) == []
    for number in range(100):
        watch.judge((3.0, 0.0, 2.5), 8.0, 0.1 * number)
    assert watch.remark is None


def test_people_hear_of_a_vehicle_whose_limits_forbid_the_speed() -> None:
    flight = BridgeFlight().prepared()
    flight.copter.fastest_m_s = 3.0
    flight.order(GoTo(1, (100.0, 0.0, 10.0)))
    flight.run(10.0)
    assert flight.cautions == ["it flies at 3.0 m/s, asked for 4: its own limits forbid more"]

    flight.copter.fastest_m_s = 4.0
    flight.run(8.0)
    assert flight.cautions[1:] == [""]
