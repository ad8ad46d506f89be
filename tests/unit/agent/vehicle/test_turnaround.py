"""A turnaround ends with the first frame of the next target, and begins when a stay is over."""

from __future__ import annotations

import pytest
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from agent.core.interface import Arrived, GoTo, Hold, Return, Telemetry
from agent.vehicle.turnaround import Turnaround, TurnaroundMeter

PLACE = (1.0, 2.0, 3.0)
SECRET = bytes(range(32))


def frame(message: mavlink.MAVLink_message, *, signed: bool = False) -> bytes:
    writer = mavlink.MAVLink(None, 255, 190)
    if signed:
        writer.signing.secret_key = SECRET
        writer.signing.sign_outgoing = True
    return bytes(message.pack(writer))


def command(number: int) -> mavlink.MAVLink_message:
    return mavlink.MAVLink_command_int_message(1, 1, 6, number, 0, 0, -1, 1, 0, 0, 470, 80, 10)


REPOSITION = command(mavlink.MAV_CMD_DO_REPOSITION)
HEARTBEAT = mavlink.MAVLink_heartbeat_message(6, 8, 0, 0, 0, 3)
COUNT = mavlink.MAVLink_mission_count_message(1, 1, 3, 0)
ITEM = mavlink.MAVLink_mission_item_int_message(1, 1, 0, 6, 16, 0, 1, 0, 0, 0, 0, 470, 80, 10)
ACCEPTED = mavlink.MAVLink_mission_ack_message(1, 1, 0)
CANCELLED = mavlink.MAVLink_mission_ack_message(1, 1, 15)


def arrived(stay_s: float = 0.0) -> TurnaroundMeter:
    """A vehicle that has arrived with the bytes that came at 10 s."""
    meter = TurnaroundMeter()
    meter.ordered(GoTo(1, PLACE, stay_s))
    meter.sent(frame(REPOSITION), 1.0)
    meter.received(10.0)
    meter.reported(Telemetry(PLACE, (0.0, 0.0, 0.0), None))
    meter.reported(Arrived(1))
    return meter


@pytest.mark.parametrize("signed", [False, True])
def test_counts_from_the_bytes_of_the_arrival_to_the_command(signed: bool) -> None:
    meter = arrived()
    meter.ordered(GoTo(2, PLACE))
    frames = [HEARTBEAT, command(mavlink.MAV_CMD_SET_MESSAGE_INTERVAL), REPOSITION]
    meter.sent(b"".join(frame(each, signed=signed) for each in frames), 10.25)
    meter.sent(frame(REPOSITION), 11.0)

    assert meter.turnarounds == [Turnaround(0.25)]


def test_frames_of_other_commands_do_not_end_it() -> None:
    meter = arrived()
    meter.ordered(GoTo(2, PLACE))
    meter.sent(frame(HEARTBEAT) + frame(command(mavlink.MAV_CMD_DO_CHANGE_SPEED)), 10.25)

    assert meter.turnarounds == []


def test_time_at_the_target_does_not_count() -> None:
    meter = arrived(stay_s=5.0)
    meter.received(12.0)
    meter.received(15.4)
    meter.ordered(GoTo(2, PLACE))
    meter.sent(frame(REPOSITION), 15.5)

    assert meter.turnarounds == [Turnaround(0.5)]


def test_a_vehicle_without_a_task_at_first_is_counted_apart() -> None:
    meter = arrived()
    meter.ordered(GoTo(2, PLACE, idled=True))
    meter.sent(frame(REPOSITION), 17.0)

    assert (meter.turnarounds, meter.idled) == ([], 1)


def test_a_vehicle_sent_elsewhere_during_its_stay_has_not_waited() -> None:
    meter = arrived(stay_s=5.0)
    meter.ordered(GoTo(2, PLACE))
    meter.sent(frame(REPOSITION), 12.0)

    assert meter.turnarounds == []


def test_the_first_target_of_all_follows_no_arrival() -> None:
    meter = TurnaroundMeter()
    meter.received(10.0)
    meter.ordered(GoTo(1, PLACE))
    meter.sent(frame(REPOSITION), 11.0)

    assert meter.turnarounds == []


def test_news_of_an_earlier_leg_is_no_arrival() -> None:
    meter = TurnaroundMeter()
    meter.ordered(GoTo(2, PLACE))
    meter.received(10.0)
    meter.reported(Arrived(1))
    meter.ordered(GoTo(3, PLACE))
    meter.sent(frame(REPOSITION), 11.0)

    assert meter.turnarounds == []


@pytest.mark.parametrize("order", [Hold("stop"), Return("done")])
def test_what_follows_something_else_than_a_stay_does_not_count(order: Hold | Return) -> None:
    meter = arrived()
    meter.ordered(order)
    meter.sent(frame(REPOSITION), 10.1)
    meter.ordered(GoTo(2, PLACE))
    meter.sent(frame(REPOSITION), 20.0)

    assert meter.turnarounds == []


def test_a_mission_counts_until_its_first_frame_and_until_it_is_verified() -> None:
    meter = arrived()
    meter.ordered(GoTo(2, PLACE))
    meter.sent(frame(COUNT), 10.25)
    meter.sent(frame(ITEM), 10.5)
    meter.sent(frame(ACCEPTED), 11.0)
    meter.sent(frame(ACCEPTED), 12.0)

    assert meter.turnarounds == [Turnaround(0.25, 1.0)]


def test_a_mission_given_up_is_never_in_force() -> None:
    meter = arrived()
    meter.ordered(GoTo(2, PLACE))
    meter.sent(frame(COUNT), 10.25)
    meter.sent(frame(CANCELLED), 11.0)

    assert meter.turnarounds == [Turnaround(0.25)]
