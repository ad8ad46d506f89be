"""The trigger of a camera: on at the beginning of a line, off at its end or wherever it is left."""

from __future__ import annotations

import pytest
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from agent.core.interface import Arrived, GoTo, Held, Hold, Home, Return
from tests.support.bridge_flight import BridgeFlight

TRIGGER = mavlink.MAV_CMD_DO_SET_CAM_TRIGG_DIST
BEGIN, CORNER, END = (5.0, 20.0, 10.0), (25.0, 40.0, 10.0), (50.0, 40.0, 10.0)
TO_LINE = GoTo(1, BEGIN, trigger_m=0.0)
LINE = GoTo(2, END, via_enu_m=(CORNER,), trigger_m=15.0)


@pytest.fixture
def flight(flight: BridgeFlight) -> BridgeFlight:
    """Of a vehicle whose camera takes what it is told."""
    flight.prepared()
    flight.copter.verdicts[TRIGGER] = [mavlink.MAV_RESULT_ACCEPTED] * 9
    return flight


def told(flight: BridgeFlight) -> list[float]:
    """The distances that the camera was told [m]."""
    return [float(command.param1) for command in flight.copter.commands(TRIGGER)]


def on_the_line(flight: BridgeFlight) -> BridgeFlight:
    flight.order(TO_LINE)
    flight.run_until(Arrived(1), limit_s=60.0)
    flight.order(LINE)
    flight.run(4.0)
    assert told(flight) == [0.0, 15.0]
    return flight


def test_pictures_are_taken_from_one_end_of_a_line_to_the_other(flight: BridgeFlight) -> None:
    on_the_line(flight).run_until(Arrived(2), limit_s=90.0)
    flight.run(1.0)

    assert told(flight) == [0.0, 15.0, 0.0]
    flight.order(GoTo(3, BEGIN))
    flight.run_until(Arrived(3), limit_s=90.0)
    assert told(flight) == [0.0, 15.0, 0.0]


@pytest.mark.parametrize("leg", [GoTo(3, BEGIN), GoTo(3, BEGIN, trigger_m=0.0)])
def test_who_turns_aside_takes_no_more(flight: BridgeFlight, leg: GoTo) -> None:
    on_the_line(flight).order(leg)
    flight.run(1.0)

    assert told(flight) == [0.0, 15.0, 0.0]


def test_another_line_has_its_own_distance(flight: BridgeFlight) -> None:
    on_the_line(flight).order(GoTo(3, BEGIN, trigger_m=20.0))
    flight.run(1.0)

    assert told(flight)[:2] == [0.0, 15.0]
    assert told(flight)[-1] == 20.0


def test_who_is_stopped_takes_no_more(flight: BridgeFlight) -> None:
    on_the_line(flight).order(Hold("look"))
    flight.run(10.0)

    assert flight.seen == [Held()]
    assert told(flight) == [0.0, 15.0, 0.0]


def test_who_goes_home_takes_no_more(flight: BridgeFlight) -> None:
    on_the_line(flight).order(Return("over"))
    flight.run_until(Home, limit_s=120.0)

    assert told(flight) == [0.0, 15.0, 0.0]


def test_who_takes_no_pictures_is_told_nothing(flight: BridgeFlight) -> None:
    flight.order(GoTo(1, END))
    flight.run_until(Arrived(1), limit_s=90.0)

    assert told(flight) == []


@pytest.mark.parametrize(
    ("answer", "caution"),
    [
        (mavlink.MAV_RESULT_UNSUPPORTED, "it does not take the trigger of its camera"),
        (None, "the trigger of its camera does not answer"),
    ],
)
def test_a_vehicle_that_does_not_take_it_flies_all_the_same(
    flight: BridgeFlight, answer: int | None, caution: str
) -> None:
    flight.copter.verdicts[TRIGGER] = [answer] * 99
    flight.order(LINE)
    flight.run_until(Arrived(2), limit_s=120.0)
    flight.run(10.0)

    assert {*told(flight)} == {15.0, 0.0}
    assert caution in flight.cautions


def test_a_camera_that_takes_its_trigger_after_all_is_no_worry_any_more(
    flight: BridgeFlight,
) -> None:
    accepted = [mavlink.MAV_RESULT_ACCEPTED] * 9
    flight.copter.verdicts[TRIGGER] = [mavlink.MAV_RESULT_UNSUPPORTED, *accepted]
    flight.order(LINE)
    flight.run_until(Arrived(2), limit_s=120.0)
    flight.run(10.0)

    assert flight.cautions == ["it does not take the trigger of its camera", ""]
