"""Bytes, units and garbage."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import pytest
from hypothesis import example, given
from hypothesis import strategies as st
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from agent.vehicle.codec import MavlinkCodec
from agent.vehicle.messages import (
    AltitudeFrame,
    BatteryStatus,
    CommandAck,
    CommandInt,
    CommandLong,
    DecodedMessage,
    EkfStatus,
    ExtendedState,
    GroundHeartbeat,
    Heartbeat,
    LandedState,
    MissionAck,
    MissionCount,
    MissionItem,
    MissionRequest,
    MissionRequestList,
    MissionSetCurrent,
    Outbound,
    ParameterMissing,
    ParameterRead,
    ParameterSet,
    ParameterValue,
    Position,
    StatusText,
    SystemStatus,
)
from tests.support.mavlink_frames import MESSAGES, crafted, frame, rebuilt, recorded

FIRMWARES = sorted(Path("tests/data/recordings").glob("*.jsonl"))
RECORDINGS = sorted(Path("tests/data/recordings").glob("arducopter-*.jsonl"))


def heartbeat(system: int = 1) -> bytes:
    return frame(mavlink.MAVLink_heartbeat_message(2, 3, 217, 4, 4, 3), system)


@pytest.mark.parametrize("path", FIRMWARES, ids=lambda path: path.stem)
def test_everything_recorded_is_read(path: Path) -> None:
    rows = recorded(path, "vehicle")
    [component_id] = {row["comp"] for row in recorded(path, "ground")}
    codec = MavlinkCodec(rows[0]["sys"], source_component_id=component_id)
    stream = b"".join(frame(rebuilt(row), row["sys"], row["comp"]) for row in rows)
    heard = codec.decode(stream)

    assert codec.bad_bytes == codec.unknown_frames == codec.not_for_us == 0
    kinds = {type(one.message) for one in heard}
    assert {Heartbeat, Position, SystemStatus, ExtendedState, CommandAck} <= kinds
    tells_of_estimator = any(
        row["msg"] in ("EKF_STATUS_REPORT", "ESTIMATOR_STATUS") for row in rows
    )
    assert (EkfStatus in kinds) == tells_of_estimator
    used = {"HEARTBEAT", "COMMAND_ACK", "MISSION_ACK", "MISSION_REQUEST", "STATUSTEXT"}
    told = [row for row in rows if not row.get("chunk_seq")]  # a text in two chunks is one
    for name in used:
        wanted = sum(row["msg"].removesuffix("_INT") == name for row in told)
        found = sum(_NAMES.get(type(one.message)) == name for one in heard)
        assert found == wanted, name


_NAMES: dict[type, str] = {
    Heartbeat: "HEARTBEAT",
    CommandAck: "COMMAND_ACK",
    MissionAck: "MISSION_ACK",
    MissionRequest: "MISSION_REQUEST",
    StatusText: "STATUSTEXT",
}


def test_recorded_flight_shows_readiness_as_the_bridge_reads_it() -> None:
    path = next(p for p in RECORDINGS if "retarget" in p.name)
    codec = MavlinkCodec(1, source_component_id=190)
    heard = [
        one.message
        for row in recorded(path, "vehicle")
        for one in codec.decode(frame(rebuilt(row), row["sys"], row["comp"]))
    ]
    first_flags = next(m.flags for m in heard if isinstance(m, EkfStatus))
    last_flags = [m.flags for m in heard if isinstance(m, EkfStatus)][-1]
    assert (first_flags & 16, last_flags & 16) == (0, 16)
    prearm = [m.prearm_ok for m in heard if isinstance(m, SystemStatus)]
    assert (prearm[0], prearm[-1]) == (False, True)
    first = next(m for m in heard if isinstance(m, Position))
    assert not first.known
    assert [m.armed for m in heard if isinstance(m, Heartbeat)][-1] is False


def test_what_the_ground_said_in_a_recording_is_what_we_would_say() -> None:
    path = next(p for p in RECORDINGS if "retarget" in p.name)
    [first, *_] = [r for r in recorded(path, "ground") if r.get("command") == 192]
    sent = MavlinkCodec(1, source_component_id=190).encode(
        CommandInt(
            192,
            AltitudeFrame.HOME,
            (-1.0, 1.0, 0.0, math.nan),
            first["x"] / 1e7,
            first["y"] / 1e7,
            first["z"],
        )
    )
    assert sent[:4] + sent[5:] == (was := frame(rebuilt(first), 255, 190))[:4] + was[5:]


@pytest.mark.parametrize(
    ("raw", "meaning"),
    [
        (
            mavlink.MAVLink_global_position_int_message(
                12_676, 473977000, 85456000, 488100, -8, 100, -50, 25, 0
            ),
            Position(12.676, 47.3977, 8.5456, 488.1, -0.008, (-0.5, 1.0, -0.25), True),
        ),
        (
            mavlink.MAVLink_battery_status_message(0, 0, 0, 0, [0] * 10, 0, 0, 0, 73),
            BatteryStatus(0.73),
        ),
        (
            mavlink.MAVLink_battery_status_message(0, 0, 0, 0, [0] * 10, 0, 0, 0, -1),
            BatteryStatus(None),
        ),
        (
            mavlink.MAVLink_battery_status_message(2, 2, 0, 0, [0] * 10, 0, 0, 0, 40),
            BatteryStatus(0.4, 2),
        ),
        *(
            (
                mavlink.MAVLink_battery_status_message(1, kind, 0, 0, [0] * 10, 0, 0, 0, 9),
                BatteryStatus(0.09, 1, lifts=False),
            )
            for kind in (
                mavlink.MAV_BATTERY_FUNCTION_AVIONICS,
                mavlink.MAV_BATTERY_FUNCTION_PAYLOAD,
            )
        ),
        (mavlink.MAVLink_extended_sys_state_message(3, 4), ExtendedState(LandedState.LANDING)),
        (mavlink.MAVLink_command_ack_message(400, 4, 0, 0, 255, 191), CommandAck(400, 4)),
        (mavlink.MAVLink_command_ack_message(400, 4), CommandAck(400, 4)),
        (mavlink.MAVLink_statustext_message(2, b"Arm:\x07 no"), StatusText(2, "Arm:? no")),
        (
            mavlink.MAVLink_param_value_message(b"WP_SPD", 10.0, 9, 1, 0),
            ParameterValue("WP_SPD", 10.0),
        ),
        (
            mavlink.MAVLink_param_error_message(255, 191, b"WPNAV_SPEED", -1, 1),
            ParameterMissing("WPNAV_SPEED"),
        ),
    ],
)
def test_wire_units_become_si(raw: Any, meaning: object) -> None:
    [heard] = MavlinkCodec(1).decode(frame(raw))
    assert heard == DecodedMessage(1, 1, meaning)  # type: ignore[arg-type] # parametrised


@pytest.mark.parametrize(
    "raw",
    [
        mavlink.MAVLink_global_position_int_message(0, 1_000_000_000, 0, 0, 0, 0, 0, 0, 0),
        mavlink.MAVLink_global_position_int_message(0, 0, 2_000_000_000, 0, 0, 0, 0, 0, 0),
        mavlink.MAVLink_extended_sys_state_message(3, 77),
        mavlink.MAVLink_param_value_message(b"WP_SPD", math.nan, 9, 1, 0),
        mavlink.MAVLink_mission_count_message(255, 191, 3, mavlink.MAV_MISSION_TYPE_RALLY),
        mavlink.MAVLink_heartbeat_message(6, 8, 0, 0, 0, 3),
    ],
)
def test_implausible_contents_are_dropped_and_counted(raw: Any) -> None:
    codec = MavlinkCodec(1)
    assert codec.decode(frame(raw)) == []
    assert codec.implausible == 1


@pytest.mark.parametrize("other", [(254, 191), (255, 190)])
def test_messages_to_another_ground_station_are_not_ours(other: tuple[int, int]) -> None:
    codec = MavlinkCodec(1)
    assert codec.decode(frame(mavlink.MAVLink_command_ack_message(400, 0, 0, 0, *other))) == []
    assert codec.not_for_us == 1


@pytest.mark.parametrize(
    ("message", "name"),
    [
        (GroundHeartbeat(), "HEARTBEAT"),
        (CommandLong(400, (1.0, 0, 0, 0, 0, 0, 0), 3), "COMMAND_LONG"),
        (ParameterRead("WP_SPD"), "PARAM_REQUEST_READ"),
        (ParameterSet("WP_SPD", 4.5), "PARAM_SET"),
        (MissionCount(4), "MISSION_COUNT"),
        (MissionRequest(2), "MISSION_REQUEST_INT"),
        (MissionRequestList(), "MISSION_REQUEST_LIST"),
        (MissionAck(0), "MISSION_ACK"),
        (MissionSetCurrent(1), "MISSION_SET_CURRENT"),
        (MissionItem(1, 16, AltitudeFrame.HOME, 47.0, 8.0, 12.0), "MISSION_ITEM_INT"),
    ],
)
def test_every_message_reaches_its_vehicle_by_name(message: Outbound, name: str) -> None:
    codec = MavlinkCodec(9)
    [raw] = mavlink.MAVLink(None).parse_buffer(codec.encode(message))
    assert raw.get_type() == name
    assert getattr(raw, "target_system", 9) == 9
    assert (raw.get_srcSystem(), raw.get_srcComponent()) == (255, 191)


def test_mission_items_survive_the_wire() -> None:
    item = MissionItem(3, 16, AltitudeFrame.HOME, 47.123, -8.5, 12.5, (1.0, 2.0, 3.0, 4.0), True)
    vehicle = MavlinkCodec(255, source_system_id=1, source_component_id=1)
    data = bytearray(vehicle.encode(item))
    [heard] = MavlinkCodec(1, source_system_id=255, source_component_id=1).decode(bytes(data))
    assert heard.message == item


def test_longitudes_are_wrapped_at_the_antimeridian() -> None:
    sent = MavlinkCodec(1).encode(
        CommandInt(192, AltitudeFrame.MEAN_SEA_LEVEL, (0, 0, 0, 0), 0.0, 180.001, 5.0)
    )
    [raw] = mavlink.MAVLink(None).parse_buffer(sent)
    assert raw.y == pytest.approx(-1_799_990_000, abs=1)


def test_sequence_numbers_count_up_and_begin_anew() -> None:
    codec = MavlinkCodec(1)
    numbers = [codec.encode(GroundHeartbeat())[4] for _ in range(300)]
    assert numbers == [i % 256 for i in range(300)]


def test_frames_may_come_in_any_pieces() -> None:
    stream = b"".join(heartbeat() for _ in range(20))
    codec = MavlinkCodec(1)
    heard = [one for byte in stream for one in codec.decode(bytes([byte]))]
    assert len(heard) == 20


def test_mavlink_1_is_understood() -> None:
    raw = mavlink.MAVLink_heartbeat_message(2, 3, 217, 4, 4, 3)
    data = raw.pack(mavlink.MAVLink(None, srcSystem=1, srcComponent=1), force_mavlink1=True)
    assert len(MavlinkCodec(1).decode(bytes(data))) == 1


def test_a_stray_start_byte_costs_no_good_frame() -> None:
    codec = MavlinkCodec(1)
    stream = b"\xfd\xff\x00" + b"".join(heartbeat() for _ in range(40))
    assert len(codec.decode(stream)) == 40
    assert codec.bad_bytes == 3


def test_an_unknown_message_is_skipped_whole() -> None:
    codec = MavlinkCodec(1)
    unknown = b"\xfd\x03\x00\x00\x00\x01\x01\xff\xff\xff" + b"abc" + b"\x00\x00"
    assert len(codec.decode(unknown + heartbeat())) == 1
    assert (codec.unknown_frames, codec.bad_bytes) == (1, 0)


def test_a_flipped_bit_costs_one_frame() -> None:
    codec = MavlinkCodec(1)
    frames = [bytearray(heartbeat()) for _ in range(3)]
    frames[1][12] ^= 0x10
    # A frame that never ends must not hold back what follows for long either.
    heard = codec.decode(b"".join(bytes(f) for f in frames) + heartbeat() * 15)
    assert len(heard) == 17


@given(st.lists(st.binary(max_size=80), max_size=20))
@example([b"\xfd", b"\x00\x01", b"\xfe\x00"])
def test_garbage_never_raises(pieces: list[bytes]) -> None:
    codec = MavlinkCodec(1)
    for piece in pieces:
        codec.decode(piece)
    codec.reset_link()
    assert len(codec.decode(heartbeat())) == 1


@given(
    message_id=st.sampled_from(sorted(MESSAGES)),
    payload=st.binary(min_size=1, max_size=255),
    system=st.integers(0, 255),
)
def test_any_contents_under_a_valid_checksum_never_raise(
    message_id: int, payload: bytes, system: int
) -> None:
    data = crafted(message_id, payload, system)
    MavlinkCodec(1).decode(data + heartbeat())
