"""Streams, parameters, requests and addressing of the simulated vehicle."""

from __future__ import annotations

import struct

import pytest
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from sim.autopilot.config import VehicleConfig
from sim.autopilot.events import Disconnected, TimeAdvanced
from sim.autopilot.firmware.ardupilot import ArduCopterModel
from sim.autopilot.firmware.model import FirmwareModel
from sim.autopilot.firmware.px4 import Px4Model
from sim.autopilot.parameters import ParameterRole
from sim.autopilot.vehicle import SimulatedAutopilot
from tests.support.ground_station import (
    ACCEPTED,
    DENIED,
    FAILED,
    UNSUPPORTED,
    GroundStation,
    ground_station,
    only,
    the,
)

POSITION = mavlink.MAVLINK_MSG_ID_GLOBAL_POSITION_INT
SET_INTERVAL = mavlink.MAV_CMD_SET_MESSAGE_INTERVAL
REQUEST = mavlink.MAV_CMD_REQUEST_MESSAGE
STREAMED = [
    "SYS_STATUS",
    "SYSTEM_TIME",
    "GPS_RAW_INT",
    "ATTITUDE",
    "LOCAL_POSITION_NED",
    "GLOBAL_POSITION_INT",
    "MISSION_CURRENT",
    "NAV_CONTROLLER_OUTPUT",
    "VFR_HUD",
    "BATTERY_STATUS",
    "AUTOPILOT_VERSION",
    "EKF_STATUS_REPORT",
    "EXTENDED_SYS_STATE",
    "GPS_GLOBAL_ORIGIN",
    "HOME_POSITION",
    "HEARTBEAT",
]


def test_nothing_but_heartbeats_comes_unasked() -> None:
    ground = ground_station()
    ground.wait(5.0)
    said = ground.wait(20.0)

    assert {message.get_type() for message in said} == {"HEARTBEAT"}
    assert len(said) == 20


def test_message_asked_for_comes_at_its_interval_in_vehicle_time() -> None:
    ground = ground_station()
    ground.wait(5.0)
    assert ground.command(SET_INTERVAL, POSITION, 100_000) == ACCEPTED
    said = only(ground.wait(10.0), "GLOBAL_POSITION_INT")

    assert 99 <= len(said) <= 101
    assert ground.command(mavlink.MAV_CMD_GET_MESSAGE_INTERVAL, POSITION) == ACCEPTED
    assert the(ground.heard, "MESSAGE_INTERVAL").interval_us == 100_000


@pytest.mark.parametrize("interval_us", [-1, 0])
def test_stream_can_be_stopped(interval_us: int) -> None:
    ground = ground_station()
    ground.command(SET_INTERVAL, POSITION, 100_000)
    assert ground.command(SET_INTERVAL, POSITION, interval_us) == ACCEPTED

    assert only(ground.wait(5.0), "GLOBAL_POSITION_INT") == []
    ground.command(mavlink.MAV_CMD_GET_MESSAGE_INTERVAL, POSITION)
    assert the(ground.heard, "MESSAGE_INTERVAL").interval_us == -1


def test_late_vehicle_skips_what_it_missed() -> None:
    ground = ground_station()
    ground.wait(5.0)
    ground.command(SET_INTERVAL, POSITION, 10_000)
    ground.now_s += 10.0
    said = ground.step(TimeAdvanced())

    assert len(only(said, "GLOBAL_POSITION_INT")) == len(only(said, "HEARTBEAT")) == 1
    assert ground.vehicle.next_deadline_s() == pytest.approx(ground.now_s + 0.01)


def test_each_ground_station_has_its_own_streams_but_hears_every_text() -> None:
    ground = ground_station()
    other = GroundStation(ground.vehicle, channel=1)
    ground.command(SET_INTERVAL, POSITION, 100_000)
    sends = []
    while (deadline_s := ground.vehicle.next_deadline_s()) < 3.5:
        sends += ground.vehicle.step(TimeAdvanced(), deadline_s)

    to = {(send.message.get_type(), send.channel) for send in sends}
    assert ("GLOBAL_POSITION_INT", 0) in to
    assert ("GLOBAL_POSITION_INT", 1) not in to
    assert {("HEARTBEAT", 0), ("HEARTBEAT", 1), ("STATUSTEXT", None)} <= to
    other.step(Disconnected(1))
    assert {send.channel for send in ground.vehicle.step(TimeAdvanced(), 4.0)} == {0}


@pytest.mark.parametrize("name", STREAMED)
def test_every_message_can_be_asked_for_once(name: str) -> None:
    ground = ground_station()
    ground.wait(5.0)
    before = len(only(ground.heard, name))

    message_id = getattr(mavlink, f"MAVLINK_MSG_ID_{name}")
    assert ground.command(REQUEST, message_id) == ACCEPTED
    assert len(only(ground.heard, name)) == before + 1
    assert ground.command(SET_INTERVAL, message_id, 50_000) == ACCEPTED


def test_unknown_messages_and_commands_are_refused() -> None:
    ground = ground_station()

    assert ground.command(REQUEST, 9999) == FAILED
    assert ground.command(REQUEST, float("nan")) == DENIED
    assert ground.command(SET_INTERVAL, 9999, 1000) == DENIED
    assert ground.command(SET_INTERVAL, POSITION, float("inf")) == DENIED
    assert ground.command(mavlink.MAV_CMD_DO_SET_SERVO, 1, 1500) == UNSUPPORTED
    ack = only(ground.heard, "COMMAND_ACK")[-1]
    assert (ack.command, ack.target_system, ack.target_component) == (183, 255, 190)


def test_capabilities_name_the_integer_protocols() -> None:
    ground = ground_station()
    assert ground.command(mavlink.MAV_CMD_REQUEST_AUTOPILOT_CAPABILITIES, 1) == ACCEPTED

    version = the(ground.heard, "AUTOPILOT_VERSION")
    assert version.capabilities & mavlink.MAV_PROTOCOL_CAPABILITY_MISSION_INT
    assert version.capabilities & mavlink.MAV_PROTOCOL_CAPABILITY_COMMAND_INT
    assert version.flight_sw_version >> 16 == 0x0408


def test_older_stream_request_is_understood() -> None:
    ground = ground_station()
    ground.wait(5.0)
    stream = mavlink.MAV_DATA_STREAM_POSITION
    ground.send(mavlink.MAVLink_request_data_stream_message(1, 1, stream, 5, 1))
    assert len(only(ground.wait(2.0), "GLOBAL_POSITION_INT")) in (9, 10)
    ground.send(mavlink.MAVLink_request_data_stream_message(1, 1, 0, 5, 0))
    assert only(ground.wait(2.0), "GLOBAL_POSITION_INT") == []


def test_parameters_are_read_by_name_and_by_index_and_written() -> None:
    ground = ground_station(cruise_m_s=4.0)
    [by_name] = ground.send(mavlink.MAVLink_param_request_read_message(1, 1, b"WP_SPD", -1))
    assert (by_name.param_id, by_name.param_value, by_name.param_index) == ("WP_SPD", 4.0, 65535)
    listed = ground.send(mavlink.MAVLink_param_request_list_message(1, 1))
    assert [message.param_index for message in listed] == list(range(by_name.param_count))
    place = next(message for message in listed if message.param_id == "WP_SPD").param_index
    [by_index] = ground.send(mavlink.MAVLink_param_request_read_message(1, 1, b"", place))
    assert (by_index.param_id, by_index.param_index) == ("WP_SPD", place)

    [written] = ground.send(mavlink.MAVLink_param_set_message(1, 1, b"WP_SPD", 7.5, 9))
    assert (written.get_type(), written.param_value) == ("PARAM_VALUE", 7.5)
    assert ground.vehicle.pilot.flight.cruise_m_s == 7.5


@pytest.mark.parametrize(
    ("name", "value", "error"),
    [
        (b"WPNAV_SPEED", 500.0, mavlink.MAV_PARAM_ERROR_DOES_NOT_EXIST),
        (b"WP_SPD", float("nan"), mavlink.MAV_PARAM_ERROR_VALUE_OUT_OF_RANGE),
        (b"WP_SPD", -1.0, mavlink.MAV_PARAM_ERROR_VALUE_OUT_OF_RANGE),
        (b"MAV_SYSID", 9.0, mavlink.MAV_PARAM_ERROR_READ_ONLY),
    ],
)
def test_impossible_parameter_values_are_refused(name: bytes, value: float, error: int) -> None:
    ground = ground_station()
    [answer] = ground.send(mavlink.MAVLink_param_set_message(1, 1, name, value, 9))

    assert (answer.get_type(), answer.error) == ("PARAM_ERROR", error)
    assert answer.param_id == name.decode()


def test_older_firmware_has_older_names_and_keeps_silent_about_unknown_ones() -> None:
    vehicle = SimulatedAutopilot(
        VehicleConfig(3, cruise_m_s=5.0), ArduCopterModel(old_names=True), 0.0
    )
    ground = GroundStation(vehicle)
    read = mavlink.MAVLink_param_request_read_message

    assert ground.send(read(3, 1, b"WP_SPD", -1)) == []
    [speed] = ground.send(read(3, 1, b"WPNAV_SPEED", -1))
    assert speed.param_value == 500.0
    assert vehicle.pilot.parameters.value_si(ParameterRole.CRUISE_M_S) == 5.0
    [system_id] = ground.send(read(3, 1, b"SYSID_THISMAV", -1))
    assert system_id.param_value == 3.0


@pytest.mark.parametrize(
    ("flavour", "told"),
    [
        (
            ArduCopterModel(),
            {
                "FS_GCS_ENABLE": 0,
                "FS_GCS_TIMEOUT": 5,
                "MAV_GCS_SYSID": 255,
                "MAV_GCS_SYSID_HI": 0,
                "BATT_FS_LOW_ACT": 0,
            },
        ),
        (
            ArduCopterModel(old_names=True),
            {"FS_GCS_ENABLE": 0, "FS_GCS_TIMEOUT": 5, "SYSID_MYGCS": 255, "BATT_FS_LOW_ACT": 0},
        ),
        (
            Px4Model(),
            {"NAV_DLL_ACT": 0, "COM_DLL_EXCEPT": 0, "COM_DL_LOSS_T": 30, "COM_LOW_BAT_ACT": 3},
        ),
    ],
)
def test_failsafes_are_told_with_the_defaults_of_the_firmware(
    flavour: FirmwareModel, told: dict[str, int]
) -> None:
    ground = ground_station(flavour)

    def value(name: str) -> float:
        read = mavlink.MAVLink_param_request_read_message(1, 1, name.encode(), -1)
        [answer] = ground.send(read)
        if flavour.parameter_habits.integers_bytewise:
            [whole] = struct.unpack("<i", struct.pack("<f", answer.param_value))
            return float(whole)
        return float(answer.param_value)

    assert {name: value(name) for name in told} == told


@pytest.mark.parametrize("flavour", [ArduCopterModel(), Px4Model()])
def test_a_simulated_vehicle_says_that_it_is(flavour: FirmwareModel) -> None:
    ground = ground_station(flavour)
    read = mavlink.MAVLink_param_request_read_message(1, 1, b"SWARM_SIMULATED", -1)

    [answer] = ground.send(read)
    assert answer.param_value == 1.0


def test_messages_for_somebody_else_are_counted_and_dropped() -> None:
    ground = ground_station(system_id=2)
    ground.wait(5.0)
    for system, component in ((1, 1), (2, 191), (255, 0)):
        message = mavlink.MAVLink_command_long_message(
            system, component, 400, 0, 1, 0, 0, 0, 0, 0, 0
        )
        assert ground.send(message) == []
    assert ground.vehicle.foreign == 3
    broadcast = mavlink.MAVLink_command_long_message(0, 0, 400, 0, 1, 0, 0, 0, 0, 0, 0)
    assert the(ground.send(broadcast), "COMMAND_ACK").result == ACCEPTED
    ground.send(mavlink.MAVLink_rc_channels_override_message(2, 1, *[1500] * 8))
    assert ground.vehicle.unknown == 1


def test_time_is_synchronised_and_pings_are_answered() -> None:
    ground = ground_station()
    ground.wait(5.0)
    [sync] = ground.send(mavlink.MAVLink_timesync_message(0, 123))
    assert (sync.tc1, sync.ts1) == (5_000_000_000, 123)
    assert ground.send(mavlink.MAVLink_timesync_message(5, 123)) == []
    [ping] = ground.send(mavlink.MAVLink_ping_message(77, 3, 0, 0))
    assert (ping.time_usec, ping.seq, ping.target_system) == (77, 3, 255)
    assert ground.send(mavlink.MAVLink_ping_message(77, 3, 1, 1)) == []
