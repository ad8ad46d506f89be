"""Signed frames, against the definition and against pymavlink's implementation."""

from __future__ import annotations

import hashlib
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from agent.core.interface import Arrived, GoTo
from agent.vehicle.codec import MavlinkCodec
from agent.vehicle.messages import CommandLong, GroundHeartbeat, Heartbeat, MissionReached
from agent.vehicle.signing import LINK_ID, SignatureVerdict, Signing, SigningKey
from tests.support.bridge_flight import ORIGIN, START, BridgeFlight
from tests.support.fake_copter import FakeCopter

SECRET = bytes(range(1, 33))
KEY = SigningKey(SECRET)
EPOCH_UNIX_S = 1_420_070_400.0
NOW_S = EPOCH_UNIX_S + 100_000.0
"""Wall time of these tests; the timestamp of then is 10^10."""
NOW = 10**10
MINUTE = 6_000_000
COMMAND = CommandLong(400, (1.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0))


class WallClock:
    def __init__(self, now_s: float = NOW_S) -> None:
        self.now_s = now_s

    def __call__(self) -> float:
        return self.now_s


def signing(clock: WallClock | None = None) -> Signing:
    return Signing(KEY, clock or WallClock())


def codec(clock: WallClock | None = None) -> MavlinkCodec:
    return MavlinkCodec(1, signing=signing(clock))


def hashed(frame: bytes, secret: bytes = SECRET) -> bytes:
    """sha256_48 of the guide."""
    return hashlib.sha256(secret + frame).digest()[:6]


def stamp_of(frame: bytes) -> int:
    return int.from_bytes(frame[-12:-6], "little")


class Vehicle:
    """Signs as pymavlink does, with any timestamp."""

    def __init__(
        self, *, secret: bytes = SECRET, stamp: int = NOW, system: int = 1, component: int = 1
    ) -> None:
        self.mav = mavlink.MAVLink(None, srcSystem=system, srcComponent=component)
        self.mav.signing.secret_key = secret
        self.mav.signing.timestamp = stamp
        self.mav.signing.sign_outgoing = True

    def say(self, message: Any) -> bytes:
        return bytes(message.pack(self.mav))

    def reached(self, seq: int) -> bytes:
        return self.say(mavlink.MAVLink_mission_item_reached_message(seq))

    def heartbeat(self) -> bytes:
        return self.say(mavlink.MAVLink_heartbeat_message(2, 3, 217, 4, 4, 3))


def unsigned(message: Any) -> bytes:
    return bytes(message.pack(mavlink.MAVLink(None, srcSystem=1, srcComponent=1)))


def test_frames_are_signed_as_the_guide_defines() -> None:
    frame = codec().encode(COMMAND)
    body, signature = frame[:-13], frame[-13:]
    assert frame[0] == 0xFD
    assert frame[2] == 1
    assert len(frame) == 10 + frame[1] + 2 + 13
    assert signature[0] == LINK_ID
    assert stamp_of(frame) == NOW
    assert signature[7:] == hashed(body + signature[:7])


def test_pymavlink_believes_what_the_bridge_signs() -> None:
    bridge, vehicle = codec(), Vehicle()
    stream = b"".join(bridge.encode(m) for m in (GroundHeartbeat(), COMMAND, COMMAND))
    names = [message.get_type() for message in vehicle.mav.parse_buffer(stream)]
    assert names == ["HEARTBEAT", "COMMAND_LONG", "COMMAND_LONG"]
    assert (vehicle.mav.signing.goodsig_count, vehicle.mav.signing.badsig_count) == (3, 0)


def test_the_bridge_believes_what_pymavlink_signs() -> None:
    bridge, vehicle = codec(), Vehicle()
    heard = bridge.decode(vehicle.heartbeat() + vehicle.reached(3))
    assert [type(one.message) for one in heard] == [Heartbeat, MissionReached]
    assert not bridge.distrusted


def test_another_key_is_not_believed_in_either_direction() -> None:
    bridge, vehicle = codec(), Vehicle(secret=bytes(32))
    vehicle.mav.robust_parsing = True
    assert bridge.decode(vehicle.heartbeat()) == []
    assert bridge.distrusted == {"wrongly signed": 1}
    [bad] = vehicle.mav.parse_buffer(bridge.encode(COMMAND))
    assert bad.get_type() == "BAD_DATA"


@pytest.mark.parametrize("force_mavlink1", [False, True])
def test_unsigned_frames_are_dropped_but_those_of_telemetry_radios(force_mavlink1: bool) -> None:
    bridge = codec()
    bridge.keep_frames = True
    mav = mavlink.MAVLink(None, srcSystem=1, srcComponent=1)
    beat = mavlink.MAVLink_heartbeat_message(2, 3, 217, 4, 4, 3)
    radio = mavlink.MAVLink_radio_status_message(1, 2, 3, 4, 5, 6, 7)
    for message in (beat, radio):
        assert bridge.decode(bytes(message.pack(mav, force_mavlink1=force_mavlink1))) == []
    assert bridge.distrusted == {"unsigned": 1}
    assert len(bridge.take_frames()) == 1


def test_without_a_key_signed_frames_are_heard_like_others() -> None:
    vehicle, bridge = Vehicle(secret=bytes(32), stamp=0), MavlinkCodec(1)
    frame = vehicle.reached(3)
    assert len(bridge.decode(frame + frame)) == 2
    assert not bridge.distrusted


def test_an_unknown_message_is_believed_by_its_signature() -> None:
    header = bytes([3, 1, 0, 0, 1, 1]) + (60_000).to_bytes(3, "little")
    frame = b"\xfd" + header + b"abc" + b"\0\0" + bytes([0]) + NOW.to_bytes(6, "little")
    bridge = codec()
    bridge.keep_frames = True
    bridge.decode(frame + hashed(frame))
    bridge.decode(frame + bytes(6))
    assert bridge.take_frames() == [frame + hashed(frame)]
    assert bridge.unknown_frames == 1
    assert bridge.distrusted == {"wrongly signed": 1}


# -- timestamps ------------------------------------------------------------------------


def test_own_timestamps_follow_the_clock_and_always_grow() -> None:
    clock = WallClock()
    bridge = codec(clock)
    stamps = [stamp_of(bridge.encode(COMMAND)) for _ in range(3)]
    assert stamps == [NOW, NOW + 1, NOW + 2]
    clock.now_s += 1.0
    assert stamp_of(bridge.encode(COMMAND)) == NOW + 100_000
    clock.now_s -= 3600.0
    assert stamp_of(bridge.encode(COMMAND)) == NOW + 100_001


def test_own_timestamps_are_newer_than_the_vehicles_after_a_start_without_a_clock() -> None:
    bridge = codec(WallClock(0.0))
    assert stamp_of(bridge.encode(COMMAND)) == 1
    assert bridge.decode(Vehicle(stamp=NOW).heartbeat())
    assert stamp_of(bridge.encode(COMMAND)) == NOW + 1


def test_a_forged_timestamp_moves_nothing() -> None:
    bridge, forger, vehicle = codec(), Vehicle(secret=bytes(32), stamp=2**47), Vehicle()
    bridge.decode(forger.heartbeat())
    assert stamp_of(bridge.encode(COMMAND)) == NOW
    assert bridge.decode(vehicle.heartbeat())


def test_the_last_timestamp_there_is_does_not_end_in_an_error() -> None:
    bridge = codec()
    assert bridge.decode(Vehicle(stamp=2**48 - 1).heartbeat())
    for _ in range(2):
        assert stamp_of(bridge.encode(COMMAND)) == 2**48 - 1


@pytest.mark.parametrize(("behind", "believed"), [(MINUTE, True), (MINUTE + 1, False)])
def test_first_frame_of_a_stream_may_be_a_minute_old(behind: int, believed: bool) -> None:
    bridge = codec()
    assert bool(bridge.decode(Vehicle(stamp=NOW - behind).heartbeat())) is believed
    assert bridge.distrusted == ({} if believed else {"signed long ago": 1})


def test_a_stream_that_falls_behind_the_clock_stays_believed() -> None:
    clock = WallClock()
    bridge, vehicle = codec(clock), Vehicle()
    assert bridge.decode(vehicle.heartbeat())
    clock.now_s += 3600.0
    assert bridge.decode(vehicle.heartbeat())


def test_replays_are_dropped_stream_by_stream() -> None:
    bridge = codec()
    first, other = Vehicle(), Vehicle(component=154)
    frames = [first.heartbeat(), first.reached(1), other.heartbeat()]
    assert len(bridge.decode(b"".join(frames))) == 3
    assert bridge.decode(b"".join(frames)) == []
    assert bridge.distrusted == {"replayed": 3}


def test_a_frame_recorded_over_one_link_is_replayed_over_another() -> None:
    bridge, vehicle = codec(), Vehicle()
    frame = vehicle.heartbeat()
    assert bridge.decode(frame)
    bridge.reset_link()
    assert bridge.decode(frame) == []


def test_late_frames_are_dropped_and_newer_ones_heard() -> None:
    bridge, vehicle = codec(), Vehicle()
    frames = [vehicle.reached(seq) for seq in range(4)]
    heard = [seq for seq in (1, 0, 3, 2) if bridge.decode(frames[seq])]
    assert heard == [1, 3]


def test_no_more_streams_are_remembered_than_a_limit() -> None:
    judge = signing()
    verdicts = [
        judge.judge(Vehicle(system=1 + n // 200, component=1 + n % 200).heartbeat())
        for n in range(300)
    ]
    assert verdicts == [SignatureVerdict.BELIEVED] * 256 + [SignatureVerdict.CROWD] * 44


# -- properties ------------------------------------------------------------------------


@given(place=st.integers(0, 8 * 33 - 1))
def test_any_flipped_bit_is_dropped_and_counted(place: int) -> None:
    bridge = codec()
    damaged = bytearray(Vehicle().heartbeat())
    assert len(damaged) == 34
    damaged[place // 8] ^= 1 << (place % 8)
    assert bridge.decode(bytes(damaged) + bytes(300)) == []
    assert bridge.bad_bytes + sum(bridge.distrusted.values()) > 0


@given(
    sent=st.lists(st.integers(0, 9), max_size=40),
    noise=st.lists(st.binary(max_size=20), max_size=5),
)
def test_a_stream_is_heard_in_order_and_nothing_twice(sent: list[int], noise: list[bytes]) -> None:
    bridge, vehicle = codec(), Vehicle()
    frames = [vehicle.reached(seq) for seq in range(10)]
    heard: list[int] = []
    for place, seq in enumerate(sent):
        if place < len(noise):
            bridge.decode(noise[place])
            bridge.reset_link()
        heard += [
            one.message.seq
            for one in bridge.decode(frames[seq])
            if isinstance(one.message, MissionReached)
        ]
    newest = -1
    expected = []
    for seq in sent:
        if seq > newest:
            newest = seq
            expected.append(seq)
    assert heard == expected


@given(st.binary(max_size=400))
def test_garbage_is_never_an_error(garbage: bytes) -> None:
    bridge, vehicle = codec(), Vehicle()
    bridge.decode(garbage)
    bridge.reset_link()
    assert bridge.decode(vehicle.heartbeat())


# -- in flight -------------------------------------------------------------------------


def test_the_key_is_not_shown() -> None:
    assert SECRET.hex() not in repr(KEY)
    assert repr(SECRET) not in repr(KEY)


@pytest.mark.parametrize("secret", [b"", bytes(31), bytes(32), bytes(range(33))])
def test_a_wrong_key_is_an_error(secret: bytes) -> None:
    with pytest.raises(ValueError, match="signing key"):
        SigningKey(secret)


class SignedCopter(FakeCopter):
    """The fake vehicle with a key and without a clock, from pymavlink's signing."""

    def __init__(self) -> None:
        super().__init__(ORIGIN)
        self._sender.signing = self._parser.signing
        self._parser.signing.secret_key = SECRET
        self._parser.signing.sign_outgoing = True


def test_a_vehicle_without_a_clock_takes_the_bridges_and_is_prepared() -> None:
    flight = BridgeFlight(SignedCopter(), key=KEY).prepared()
    flight.order(GoTo(1, (5.0, 10.0, 10.0)))
    flight.run_until(Arrived(1))


def test_an_unsigned_vehicle_is_not_prepared_and_the_reason_is_told() -> None:
    flight = BridgeFlight(key=KEY)
    flight.order(START)
    flight.run(20.0)
    assert flight.reasons()[-1] == "heard only frames that are not to be believed: unsigned"
    assert not flight.copter.armed


def test_unsigned_orders_of_a_pilot_do_not_hand_the_vehicle_over() -> None:
    flight = BridgeFlight(SignedCopter(), key=KEY).flying()
    forged = mavlink.MAVLink_heartbeat_message(2, 3, 217, 5, 4, 3)
    flight.spoken(unsigned(forged))
    flight.run(1.0)
    assert flight.reports == []
    assert flight.bridge.codec.distrusted["unsigned"] == 1
