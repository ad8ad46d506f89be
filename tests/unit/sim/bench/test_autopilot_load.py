"""How much of the telemetry of simulated vehicles is counted as delivered."""

from __future__ import annotations

import io
import json
from collections import Counter

import pytest
from hypothesis import given
from hypothesis import strategies as st
from pymavlink.dialects.v20 import ardupilotmega as mavlink
from rich.console import Console

from sim.bench.autopilot_load import (
    AutopilotLoad,
    FrameCounter,
    rates_asked_hz,
    stream_rates,
)
from sim.bench.machine import this_machine
from swarm.model.frames import DEFAULT_ORIGIN


def frames() -> bytes:
    sender = mavlink.MAVLink(None, srcSystem=1)
    messages = [
        mavlink.MAVLink_heartbeat_message(2, 3, 0, 0, 0, 3),
        mavlink.MAVLink_timesync_message(7, 9),
        mavlink.MAVLink_heartbeat_message(2, 3, 0, 0, 0, 3),
    ]
    return b"".join(message.pack(sender) for message in messages)


@given(cuts=st.lists(st.integers(0, len(frames())), max_size=8), noise=st.binary(max_size=3))
def test_frames_are_counted_however_they_are_cut(cuts: list[int], noise: bytes) -> None:
    counter, stream = FrameCounter(), noise.replace(b"\xfd", b"") + frames()
    answers = []
    at = 0
    for cut in [*sorted(cuts), len(stream)]:
        answers += counter.feed(stream[at:cut])
        at = max(at, cut)

    assert counter.counts == {0: 2, 111: 1}
    assert [int.from_bytes(payload[8:].ljust(8, b"\0"), "little") for payload in answers] == [9]


def test_what_the_bridge_asks_for_is_asked_for() -> None:
    assert rates_asked_hz(DEFAULT_ORIGIN) == {
        33: 10.0,
        1: 2.0,
        193: 2.0,
        245: 2.0,
        42: 2.0,
        147: 2.0,
    }


def test_delivered_share_is_that_of_all_vehicles() -> None:
    position, status = stream_rates(Counter({33: 990, 1: 200}), {33: 10.0, 1: 2.0}, 10, 10.0)

    assert (position.message, position.delivered_frac) == ("GLOBAL_POSITION_INT", 0.99)
    assert (status.message, status.delivered_frac) == ("SYS_STATUS", 1.0)


@pytest.mark.parametrize("latency_s", [None, 0.0042])
def test_report_shows_rates_cores_and_latency(latency_s: float | None) -> None:
    rates = stream_rates(Counter({33: 990}), {33: 10.0}, 10, 10.0)
    load = AutopilotLoad(
        this_machine(), 10, 10.0, rates, 99.0, 0.99, 0.25, latency_s, latency_s, latency_s
    )

    screen = io.StringIO()
    console = Console(file=screen, width=300)
    console.print(load)
    text = screen.getvalue()
    assert "99.00%" in text
    assert "0.25 cores" in text
    assert ("4.2 ms" in text) is (latency_s is not None)
    assert json.loads(json.dumps(load.as_json()))["cores"] == 0.25
