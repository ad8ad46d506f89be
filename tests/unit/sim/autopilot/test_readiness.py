"""Power-up, arming and modes of the simulated vehicle."""

from __future__ import annotations

import pytest
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from sim.autopilot.config import Delays, VehicleConfig
from sim.autopilot.events import Reboot
from tests.support.ground_station import (
    ACCEPTED,
    AUTO,
    DENIED,
    FAILED,
    GUIDED,
    LOITER,
    RTL,
    STABILIZE,
    GroundStation,
    ground_station,
    only,
    the,
)

PREARM = mavlink.MAV_SYS_STATUS_PREARM_CHECK


def heartbeat(ground: GroundStation) -> tuple[int, int, int]:
    ground.wait(1.0)
    last = only(ground.heard, "HEARTBEAT")[-1]
    return last.custom_mode, last.base_mode, last.system_status


def prearm_bit(ground: GroundStation) -> bool:
    ground.command(mavlink.MAV_CMD_REQUEST_MESSAGE, mavlink.MAVLINK_MSG_ID_SYS_STATUS)
    return bool(only(ground.heard, "SYS_STATUS")[-1].onboard_control_sensors_health & PREARM)


def ekf_flags(ground: GroundStation) -> int:
    ground.command(mavlink.MAV_CMD_REQUEST_MESSAGE, mavlink.MAVLINK_MSG_ID_EKF_STATUS_REPORT)
    flags: int = only(ground.heard, "EKF_STATUS_REPORT")[-1].flags
    return flags


def test_heartbeats_come_every_second_and_tell_of_booting() -> None:
    ground = ground_station(delays=Delays(2.5, 2.5, 3.0, 4.0))
    ground.wait(5.0)
    statuses = [message.system_status for message in only(ground.heard, "HEARTBEAT")]

    assert statuses == [1, 1, 1, 3, 3, 3, 3]  # one more: booting ends with a change of mode
    first = only(ground.heard, "HEARTBEAT")[0]
    assert (first.type, first.autopilot, first.base_mode) == (2, 3, 89)


def test_mode_set_while_booting_is_acknowledged_and_then_lost() -> None:
    ground = ground_station()

    assert ground.set_mode(GUIDED) == ACCEPTED
    assert only(ground.heard, "HEARTBEAT")[-1].custom_mode == GUIDED
    assert heartbeat(ground) == (STABILIZE, 81, 3)


def test_guided_cannot_be_armed_before_there_is_a_position() -> None:
    ground = ground_station()
    ground.wait(1.5)
    ground.set_mode(GUIDED)

    assert ground.arm() == FAILED
    assert ground.texts()[-1] == "Arm: Need Position Estimate"
    assert not prearm_bit(ground)
    assert ekf_flags(ground) == 167
    ground.wait(2.0)
    assert prearm_bit(ground)
    assert ekf_flags(ground) == 831
    assert ground.arm() == ACCEPTED
    assert heartbeat(ground) == (GUIDED, 217, 3)


def test_manual_mode_is_armed_without_a_position_and_then_cannot_take_off() -> None:
    ground = ground_station(delays=Delays(1.0, 1.0, 50.0, 60.0))
    ground.wait(2.0)

    assert prearm_bit(ground)
    assert ground.arm() == ACCEPTED
    assert ground.command(mavlink.MAV_CMD_NAV_TAKEOFF, 0, 0, 0, 0, 0, 0, 10.0) == FAILED
    assert ground.set_mode(GUIDED) == FAILED
    assert ground.texts()[-1] == "Mode change to GUIDED failed: requires position"


def test_nothing_can_be_armed_before_the_sensors_agree() -> None:
    ground = ground_station(delays=Delays(1.0, 5.0, 6.0, 7.0))

    assert ground.arm() == FAILED
    assert ground.texts()[-1] == "Arm: System not initialised"
    ground.wait(2.0)
    assert ground.arm() == FAILED
    assert ground.texts()[-1] == "Arm: Accels inconsistent"


def test_obstacle_is_told_every_thirty_seconds() -> None:
    ground = ground_station(delays=Delays(1.0, 1.0, 100.0, 100.0))
    ground.wait(2.0)
    ground.set_mode(GUIDED)
    ground.wait(90.0)

    assert ground.texts().count("PreArm: Need Position Estimate") == 3


def test_position_is_told_once_there_is_a_fix() -> None:
    ground = ground_station(start_enu_m=(10.0, 20.0, 5.0))
    request = (mavlink.MAV_CMD_REQUEST_MESSAGE, mavlink.MAVLINK_MSG_ID_GLOBAL_POSITION_INT)
    ground.command(*request)
    before = the(ground.heard, "GLOBAL_POSITION_INT")
    assert (before.lat, before.lon, before.alt) == (0, 0, 0)
    assert ground.command(mavlink.MAV_CMD_GET_HOME_POSITION) == FAILED

    ground.wait(2.0)
    home = the(ground.heard, "HOME_POSITION")
    assert (home.latitude, home.longitude) == ground.place_e7(10.0, 20.0)
    assert home.altitude == 493_000
    assert (home.x, home.y, home.z) == (20.0, 10.0, -5.0)
    assert the(ground.heard, "GPS_GLOBAL_ORIGIN").altitude == 488_000
    ground.command(*request)
    after = only(ground.heard, "GLOBAL_POSITION_INT")[-1]
    assert (after.lat, after.lon) == ground.place_e7(10.0, 20.0)
    assert (after.alt, after.relative_alt, after.time_boot_ms) == (493_000, 0, 2000)
    assert ground.command(mavlink.MAV_CMD_GET_HOME_POSITION) == ACCEPTED


def test_vehicle_left_armed_on_the_ground_disarms_after_ten_seconds() -> None:
    ground = ground_station()
    ground.wait(5.0)
    ground.set_mode(GUIDED)
    ground.arm()

    ground.wait(9.9)
    assert "Disarming motors" not in ground.texts()
    ground.wait(0.2)
    assert ground.texts()[-1] == "Disarming motors"
    assert heartbeat(ground) == (GUIDED, 89, 3)


def test_arming_twice_is_fine_and_disarming_on_the_ground_too() -> None:
    ground = ground_station()
    ground.wait(5.0)

    assert ground.arm() == ground.arm() == ACCEPTED
    assert ground.texts().count("Arming motors") == 1
    assert ground.command(mavlink.MAV_CMD_COMPONENT_ARM_DISARM, 0) == ACCEPTED
    assert ground.command(mavlink.MAV_CMD_COMPONENT_ARM_DISARM, 0) == ACCEPTED
    assert ground.command(mavlink.MAV_CMD_COMPONENT_ARM_DISARM, 0.5) == 3


@pytest.mark.parametrize("mode", [RTL, 9])
def test_modes_that_only_come_down_cannot_be_armed(mode: int) -> None:
    ground = ground_station()
    ground.wait(5.0)
    assert ground.set_mode(mode) == ACCEPTED

    assert ground.arm() == FAILED
    assert ground.texts()[-1].endswith("mode not armable")


def test_unknown_mode_and_auto_without_a_mission_are_refused() -> None:
    ground = ground_station()
    ground.wait(5.0)

    assert ground.set_mode(99) == FAILED
    assert ground.set_mode(AUTO) == FAILED
    assert ground.texts()[-1] == "Mode change to AUTO failed: init failed"
    assert ground.command(mavlink.MAV_CMD_DO_SET_MODE, 0, GUIDED) == DENIED
    assert heartbeat(ground)[0] == STABILIZE


def test_older_message_sets_the_mode_too() -> None:
    ground = ground_station()
    ground.wait(5.0)
    answer = ground.send(mavlink.MAVLink_set_mode_message(1, 1, LOITER))

    assert [message.get_type() for message in answer] == ["COMMAND_ACK", "HEARTBEAT"]
    assert (answer[0].command, answer[0].result) == (11, ACCEPTED)
    assert answer[1].custom_mode == LOITER


def test_acknowledgement_goes_ahead_of_what_the_command_causes() -> None:
    ground = ground_station()
    ground.wait(5.0)
    answer = ground.send(mavlink.MAVLink_command_long_message(1, 1, 400, 0, 1, 0, 0, 0, 0, 0, 0))

    assert [message.get_type() for message in answer] == [
        "COMMAND_ACK",
        "GPS_GLOBAL_ORIGIN",
        "STATUSTEXT",
    ]


def test_reboot_begins_again_with_boot_time_mode_and_streams_but_keeps_the_mission() -> None:
    ground = ground_station()
    ground.take_off()
    ground.upload(ground.item(0), ground.item(1, 5.0, 5.0))
    ground.command(mavlink.MAV_CMD_SET_MESSAGE_INTERVAL, mavlink.MAVLINK_MSG_ID_ATTITUDE, 1e5)
    ground.step(Reboot())

    ground.wait(0.5)
    assert only(ground.heard, "HEARTBEAT")[-1].system_status == 1
    assert ground.position_enu_m == (0.0, 0.0, 0.0)
    heard_before = len(only(ground.heard, "ATTITUDE"))
    ground.wait(5.0)
    assert len(only(ground.heard, "ATTITUDE")) == heard_before
    ground.command(mavlink.MAV_CMD_REQUEST_MESSAGE, mavlink.MAVLINK_MSG_ID_SYSTEM_TIME)
    assert only(ground.heard, "SYSTEM_TIME")[-1].time_boot_ms == 5500
    assert ground.set_mode(AUTO) == ACCEPTED


def test_reboot_by_command_needs_disarmed_motors() -> None:
    ground = ground_station()
    ground.wait(5.0)
    ground.arm()

    assert ground.command(mavlink.MAV_CMD_PREFLIGHT_REBOOT_SHUTDOWN, 1) == FAILED
    ground.command(mavlink.MAV_CMD_COMPONENT_ARM_DISARM, 0)
    assert ground.command(mavlink.MAV_CMD_PREFLIGHT_REBOOT_SHUTDOWN, 1) == ACCEPTED
    assert ground.vehicle.pilot.readiness.boot_s == 5.0


@pytest.mark.parametrize("stages_s", [(2.0, 1.0, 3.0, 4.0), (-1.0, 1.0, 2.0, 3.0)])
def test_delays_must_be_in_order(stages_s: tuple[float, float, float, float]) -> None:
    with pytest.raises(ValueError, match="in order"):
        Delays(*stages_s)


@pytest.mark.parametrize(
    "config",
    [{"system_id": 0}, {"system_id": 255}, {"system_id": 1, "cruise_m_s": 0.0}],
)
def test_vehicle_configuration_is_checked(config: dict[str, float]) -> None:
    with pytest.raises(ValueError, match="must be"):
        VehicleConfig(**config)  # type: ignore[arg-type]  # wrong on purpose
