"""Whatever comes from the link, the bridge neither raises nor commands anything wrong."""

from __future__ import annotations

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from agent.core.interface import Arrived, GoTo, HandedOver
from agent.vehicle.codec import _CONVERTERS
from agent.vehicle.session import BytesReceived
from swarm.model.frames import enu_from_wgs84
from tests.support.bridge_flight import ORIGIN, START, BridgeFlight
from tests.support.fake_copter import (
    ARM,
    INTERVAL,
    REPOSITION,
    SET_MODE,
    SPEED,
    TAKEOFF,
    FakeCopter,
)
from tests.support.fake_px4 import FakePx4
from tests.support.mavlink_frames import MESSAGES, crafted

FAKES = (FakeCopter, FakePx4)
TARGET = (5.0, 30.0, 10.0)

known_frames = st.builds(
    crafted,
    message_id=st.sampled_from(sorted(_CONVERTERS)),
    payload=st.binary(min_size=1, max_size=60),
    system=st.sampled_from([1, 1, 1, 2, 0, 255]),
)
any_frames = st.builds(
    crafted,
    message_id=st.sampled_from(sorted(MESSAGES)),
    payload=st.binary(min_size=1, max_size=255),
    system=st.sampled_from([1, 2]),
)
noise = st.lists(st.one_of(known_frames, any_frames, st.binary(max_size=40)), max_size=30)


@pytest.mark.parametrize("fake", FAKES)
@settings(max_examples=20, deadline=None)
@given(pieces=noise)
def test_noise_in_flight_never_raises_and_sends_no_new_target(
    fake: type[FakeCopter], pieces: list[bytes]
) -> None:
    flight = BridgeFlight(fake(ORIGIN)).prepared()
    flight.order(GoTo(1, TARGET))
    flight.copter.heard.clear()
    for piece in pieces:
        flight.happen(BytesReceived(piece))
        flight.step()
    flight.run(3.0)
    for sent in flight.copter.commands(REPOSITION):
        place_m = enu_from_wgs84(ORIGIN, sent.x / 1e7, sent.y / 1e7, sent.z)
        assert place_m == pytest.approx(TARGET, abs=0.02)
    assert not {ARM, TAKEOFF, SET_MODE} & set(flight.copter.count())
    arrivals = [r for r in flight.reports if isinstance(r, Arrived)]
    assert len(arrivals) <= 1


@pytest.mark.parametrize("fake", FAKES)
@settings(max_examples=20, deadline=None)
@given(pieces=noise)
def test_noise_in_preparation_never_raises(fake: type[FakeCopter], pieces: list[bytes]) -> None:
    flight = BridgeFlight(fake(ORIGIN))
    flight.order(START)
    for piece in pieces:
        flight.happen(BytesReceived(piece))
        flight.run(0.3)
    wanted = {ARM, TAKEOFF, SET_MODE, REPOSITION, SPEED, INTERVAL}
    assert set(flight.copter.count()) <= wanted


@pytest.mark.parametrize("fake", FAKES)
@settings(max_examples=10, deadline=None)
@given(garbage=st.binary(min_size=1, max_size=200))
def test_bit_errors_on_the_link_are_survived(fake: type[FakeCopter], garbage: bytes) -> None:
    flips = list(garbage)

    def spoil(data: bytes) -> list[bytes]:
        if not flips:
            return [data]
        damaged = bytearray(data)
        flip = flips.pop()
        damaged[flip % len(damaged)] ^= 1 << (flip % 8)
        return [bytes(damaged)]

    flight = BridgeFlight(fake(ORIGIN), to_bridge=spoil).prepared()
    flight.order(GoTo(1, TARGET))
    flight.run_until(Arrived, HandedOver)
