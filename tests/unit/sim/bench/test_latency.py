"""A tap on MAVLink times new targets by the report before them."""

from __future__ import annotations

from pymavlink.dialects.v20 import ardupilotmega as mavlink

from sim.bench.latency import DecisionLatencies, MavlinkTap


class HandClock:
    def __init__(self) -> None:
        self.at_s = 0.0

    def now_s(self) -> float:
        return self.at_s

    def wall_delay_s(self, delay_s: float) -> float:
        return delay_s


def report() -> bytes:
    sender = mavlink.MAVLink(None, srcSystem=1)
    packed: bytes = sender.global_position_int_encode(0, 0, 0, 0, 0, 0, 0, 0, 0).pack(sender)
    return packed


def command(number: int, east: int) -> bytes:
    sender = mavlink.MAVLink(None, srcSystem=255)
    message = sender.command_int_encode(1, 1, 6, number, 0, 0, -1.0, 1.0, 0.0, 0.0, 7, east, 20.0)
    packed: bytes = message.pack(sender)
    return packed


def go(east: int) -> bytes:
    return command(mavlink.MAV_CMD_DO_REPOSITION, east)


def test_new_targets_after_the_first_task_are_timed_by_the_newest_report() -> None:
    clock = HandClock()
    tap = MavlinkTap(clock)
    said = [
        (0.0, tap.from_vehicle, report()),
        (1.0, tap.from_agent, go(1)),  # to the start
        (2.0, tap.from_agent, go(2)),  # the first task
        (3.0, tap.from_vehicle, report()),
        (3.004, tap.from_agent, command(mavlink.MAV_CMD_DO_CHANGE_SPEED, 9)),
        (3.005, tap.from_agent, go(3)),
        (3.4, tap.from_agent, go(3)),  # said again: nothing was decided
        (4.0, tap.from_vehicle, report()),
        (4.002, tap.from_agent, go(4)),
    ]
    for at_s, tell, data in said:
        clock.at_s = at_s
        tell(data[:5])  # frames come in pieces
        tell(data[5:])

    assert [round(time_s, 6) for time_s in tap.times_s] == [0.005, 0.002]


def test_quantiles_are_times_that_were_measured() -> None:
    measured = DecisionLatencies("greedy", 2, 9, tuple(float(number) for number in range(1, 101)))

    assert [measured.quantile_s(share) for share in (0.5, 0.99, 1.0)] == [50.0, 99.0, 100.0]
    assert DecisionLatencies("greedy", 2, 9, ()).quantile_s(0.5) is None
