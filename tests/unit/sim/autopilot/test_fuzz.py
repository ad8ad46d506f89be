"""Whatever arrives, the simulated vehicle drops it or answers it, and flies on."""

from __future__ import annotations

import inspect
import math
import struct
from typing import Any

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from sim.autopilot.codec import ChannelCodec
from sim.autopilot.config import ServedBase
from sim.autopilot.events import MavlinkReceived, Reboot, TimeAdvanced
from sim.autopilot.firmware import FirmwareModelName, firmware_model
from tests.support.ground_station import GroundStation, ground_station, only

UNDERSTOOD = [
    "command_long",
    "command_int",
    "set_mode",
    "set_position_target_global_int",
    "request_data_stream",
    "param_request_read",
    "param_request_list",
    "param_set",
    "mission_count",
    "mission_item",
    "mission_item_int",
    "mission_request_list",
    "mission_request",
    "mission_request_int",
    "mission_clear_all",
    "mission_set_current",
    "mission_ack",
    "timesync",
    "ping",
    "heartbeat",
]
COMMANDS = [16, 20, 21, 22, 176, 178, 179, 183, 192, 224, 246, 300, 400, 410, 510, 511, 512, 520]
COMMANDS += [206, 5001, 5002, 5003, 5004]
FIELD: dict[str, Any] = {
    "endurance_s": 60.0,
    "drains_in_flight": True,
    "bases": (ServedBase((0.0, 0.0, 0.0), 12.0),),
    "acceleration_m_s2": 2.5,
    "rounds_corners": True,
    "descent_m_s": 3.0,
}
"""A mission of the field, whose base is where the vehicle stands."""
NUMBERS: dict[str, st.SearchStrategy[Any]] = {
    "float": st.one_of(
        st.floats(width=32),
        st.sampled_from([0.0, 1.0, 4.0, 3.0, math.nan, math.inf, 21196.0, 20190226.0, 1e30]),
    ),
    **{
        name: st.one_of(st.integers(0, 20), st.integers(low, high))
        for name, low, high in (
            ("uint8_t", 0, 2**8 - 1),
            ("uint16_t", 0, 2**16 - 1),
            ("uint32_t", 0, 2**32 - 1),
            ("uint64_t", 0, 2**64 - 1),
            ("int16_t", -(2**15), 2**15 - 1),
            ("int32_t", -(2**31), 2**31 - 1),
            ("int64_t", -(2**63), 2**63 - 1),
        )
    },
    "char": st.one_of(
        st.sampled_from(
            [b"WP_SPD", b"RTL_ALT_M", b"DISARM_DELAY", b"MPC_XY_CRUISE", b"NAV_DLL_ACT", b"NO_SUCH"]
        ),
        st.binary(max_size=16),
    ),
}


FLAVOURS = st.sampled_from(FirmwareModelName)


@st.composite
def messages(draw: st.DrawFn) -> Any:
    """A message the vehicle understands, with arbitrary contents, mostly for this vehicle."""
    message_type = getattr(mavlink, f"MAVLink_{draw(st.sampled_from(UNDERSTOOD))}_message")
    values: dict[str, Any] = {}
    for field, kind in zip(message_type.fieldnames, message_type.fieldtypes, strict=True):
        if field in ("target_system", "target_component"):
            values[field] = draw(st.sampled_from([1, 1, 1, 0, 7]))
        elif field == "command":
            values[field] = draw(st.one_of(st.sampled_from(COMMANDS), NUMBERS["uint16_t"]))
        else:
            values[field] = draw(NUMBERS[kind])
    return message_type(**values)


def in_the_air(ground: GroundStation) -> None:
    """Bring a vehicle of any flavour to a hover."""
    pilot = ground.vehicle.pilot
    ground.wait(5.0)
    pilot.set_mode(pilot.flavour.modes.for_reposition, ground.now_s)
    pilot.arm(ground.now_s, forced=False)
    assert pilot.take_off(10.0, ground.now_s)
    ground.wait(10.0)
    assert not pilot.flight.on_ground


def all_messages_of_the_vehicle(ground: GroundStation) -> None:
    """Encode every report there is, so that none holds a number that doesn't fit."""
    for message_id in sorted(ground.vehicle._telemetry.known):
        ground.command(mavlink.MAV_CMD_REQUEST_MESSAGE, message_id)


@settings(deadline=None, max_examples=150)
@given(
    steps=st.lists(st.tuples(messages(), st.floats(0.0, 20.0)), max_size=25),
    airborne=st.booleans(),
    flavour=FLAVOURS,
    config=st.sampled_from([{}, FIELD]),
)
def test_arbitrary_messages_are_survived(
    steps: list[tuple[Any, float]],
    airborne: bool,
    flavour: FirmwareModelName,
    config: dict[str, Any],
) -> None:
    ground = ground_station(firmware_model(flavour), **config)
    if airborne:
        in_the_air(ground)
    else:
        ground.wait(5.0)
    for message, pause_s in steps:
        ground.send(message)
        # Called late, as after a pause of the process: streams may be as fast as 1 kHz.
        ground.now_s += pause_s
        ground.step(TimeAdvanced())
        assert ground.vehicle.next_deadline_s() >= ground.now_s
        assert all(math.isfinite(value) for value in ground.position_enu_m)
    while ground.vehicle.is_without_power:
        ground.wait(1.0)
    all_messages_of_the_vehicle(ground)
    ground.step(Reboot())
    ground.now_s += 5.0
    assert only(ground.step(TimeAdvanced()), "HEARTBEAT")


@settings(deadline=None, max_examples=200)
@given(pieces=st.lists(st.binary(max_size=300), max_size=10), datagrams=st.booleans())
def test_random_bytes_are_dropped(pieces: list[bytes], datagrams: bool) -> None:
    codec = ChannelCodec(1, 1, datagrams=datagrams)
    ground = ground_station()
    for piece in pieces:
        for message in codec.decode(piece):
            ground.step(MavlinkReceived(0, message))
    frame = ground._outgoing.encode(mavlink.MAVLink_heartbeat_message(6, 8, 0, 0, 0, 3))
    # A stream may first have to get over a length it was lied to about.
    heard = [message for _ in range(40) for message in codec.decode(frame)]
    assert heard


@settings(deadline=None, max_examples=200)
@given(
    message=messages(),
    changes=st.lists(st.tuples(st.integers(0, 400), st.integers(0, 255))),
    flavour=FLAVOURS,
)
def test_mutated_frames_are_survived(
    message: Any, changes: list[tuple[int, int]], flavour: FirmwareModelName
) -> None:
    ground = ground_station(firmware_model(flavour))
    frame = bytearray(ground._outgoing.encode(message))
    for place, value in changes:
        frame[place % len(frame)] = value
    for each in ChannelCodec(1, 1, datagrams=True).decode(bytes(frame)):
        ground.step(MavlinkReceived(0, each))
    ground.wait(5.0)
    all_messages_of_the_vehicle(ground)


def test_broken_and_foreign_frames_are_counted() -> None:
    codec = ChannelCodec(1, 1, datagrams=True)
    good = ChannelCodec(255, 190, datagrams=True).encode(
        mavlink.MAVLink_heartbeat_message(6, 8, 0, 0, 0, 3)
    )
    broken = good[:-1] + bytes([good[-1] ^ 1])

    assert [message.get_type() for message in codec.decode(good + broken + good)] == [
        "HEARTBEAT",
        "HEARTBEAT",
    ]
    assert codec.garbage == 1
    assert codec.decode(good[:10]) == []
    assert len(codec.decode(good)) == 1
    assert codec.garbage == 2


def test_frames_in_pieces_are_put_together_on_a_stream() -> None:
    codec = ChannelCodec(1, 1, datagrams=False)
    frame = ChannelCodec(255, 190, datagrams=False).encode(
        mavlink.MAVLink_heartbeat_message(6, 8, 0, 0, 0, 3)
    )

    heard = [message for byte in frame for message in codec.decode(bytes([byte]))]
    assert [message.get_type() for message in heard] == ["HEARTBEAT"]
    assert codec.garbage == 0


def test_sequence_numbers_count_every_frame_of_a_channel() -> None:
    codec = ChannelCodec(7, 1, datagrams=False)
    message = mavlink.MAVLink_heartbeat_message(2, 3, 0, 0, 0, 3)
    frames = [codec.encode(message) for _ in range(300)]

    assert [frame[4] for frame in frames[:3]] == [0, 1, 2]
    assert frames[256][4] == 0
    assert {frame[5] for frame in frames} == {7}


def test_every_message_understood_is_fuzzed() -> None:
    vehicle = ground_station().vehicle
    understood = set()
    for number, message_type in mavlink.mavlink_map.items():
        before = vehicle.unknown
        message = empty(message_type)
        message._header.srcSystem = 255
        vehicle.step(MavlinkReceived(0, message), 0.0)
        if vehicle.unknown == before:
            understood.add(number)

    fuzzed = {
        inspect.getattr_static(getattr(mavlink, f"MAVLink_{name}_message"), "id")
        for name in UNDERSTOOD
    }
    assert understood == fuzzed


def empty(message_type: Any) -> Any:
    """A message of zeros."""
    lengths = dict(zip(message_type.ordered_fieldnames, message_type.array_lengths, strict=True))
    kinds = dict(zip(message_type.fieldnames, message_type.fieldtypes, strict=True))
    return message_type(
        *(
            b"" if kinds[name] == "char" else [0] * lengths[name] if lengths[name] else 0
            for name in message_type.fieldnames
        )
    )


def test_speed_beyond_the_wire_is_reported_as_the_most_the_wire_can_say() -> None:
    ground = ground_station()
    ground.take_off(10.0)
    ground.reposition(0.0, 5000.0, 10.0)
    ground.command(mavlink.MAV_CMD_DO_CHANGE_SPEED, 1, 1000.0)
    ground.command(mavlink.MAV_CMD_REQUEST_MESSAGE, mavlink.MAVLINK_MSG_ID_GLOBAL_POSITION_INT)

    assert only(ground.heard, "GLOBAL_POSITION_INT")[-1].vx == 32767
    with pytest.raises(struct.error):
        mavlink.MAVLink_global_position_int_message(0, 0, 0, 0, 0, 100_000, 0, 0, 0).pack(
            mavlink.MAVLink(None)
        )
