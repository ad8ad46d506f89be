"""What the doctor hears of a vehicle, and that it never says more than a question."""

from __future__ import annotations

import struct
from typing import Any

import pytest
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from agent.vehicle.config import SerialAddress, UdpInAddress
from agent.vehicle.firmware.ardupilot import ArduCopter
from agent.vehicle.signing import Signing, SigningKey
from sim.fleet.doctor.finding import CheckFinding, CheckState
from sim.fleet.doctor.link import VehicleAddress, parse_vehicle
from sim.fleet.doctor.vehicle import VehicleListener
from swarm.runtime.errors import InputError

NAME = "udpin:0.0.0.0:14550"
UNIX_S = 1.8e9
PREARM = mavlink.MAV_SYS_STATUS_PREARM_CHECK
EKF_READY = mavlink.EKF_POS_HORIZ_ABS | mavlink.EKF_ATTITUDE


class Speaker:
    """A vehicle that says what it is told to."""

    def __init__(self, system_id: int = 1) -> None:
        self._mav = mavlink.MAVLink(None, srcSystem=system_id, srcComponent=1)
        self.said = bytearray()

    def say(self, *messages: mavlink.MAVLink_message) -> Speaker:
        for each in messages:
            self.said += each.pack(self._mav)
            self._mav.seq = (self._mav.seq + 1) % 256
        return self

    def lose(self, count: int) -> Speaker:
        self._mav.seq = (self._mav.seq + count) % 256
        return self


def heartbeat(
    *, armed: bool = False, autopilot: int = 3, state: int = 3, vehicle_type: int = 2
) -> Any:
    mode = mavlink.MAV_MODE_FLAG_SAFETY_ARMED if armed else 0
    return mavlink.MAVLink_heartbeat_message(vehicle_type, autopilot, mode, 0, state, 3)


def sys_status(*, prearm: bool = True, battery: int = 87) -> Any:
    health = PREARM if prearm else 0
    return mavlink.MAVLink_sys_status_message(
        PREARM, PREARM, health, 0, 0, 0, battery, 0, 0, 0, 0, 0, 0
    )


def position() -> Any:
    return mavlink.MAVLink_global_position_int_message(
        5000, 473977420, 85455940, 488000, 0, 0, 0, 0, 0
    )


def ekf() -> Any:
    return mavlink.MAVLink_ekf_status_report_message(EKF_READY, 0.0, 0.0, 0.0, 0.0, 0.0)


def parameters(*, bytewise: bool = False, **values: int) -> list[Any]:
    return [
        mavlink.MAVLink_param_value_message(
            name.encode(),
            struct.unpack("<f", struct.pack("<i", value))[0] if bytewise else float(value),
            mavlink.MAV_PARAM_TYPE_INT32,
            len(values),
            65535,
        )
        for name, value in values.items()
    ]


def asked_for(listening: VehicleListener) -> set[str]:
    """Names of the parameters that it asks for now."""
    parser = mavlink.MAVLink(None)
    said = parser.parse_buffer(b"".join(listening.requests())) or ()
    return {each.param_id for each in said if each.get_type() == "PARAM_REQUEST_READ"}


def system_time(ahead_s: float) -> Any:
    return mavlink.MAVLink_system_time_message(round((UNIX_S + ahead_s) * 1e6), 5000)


def found(speaker: Speaker, listening: VehicleListener | None = None) -> dict[str, CheckFinding]:
    listening = listening or VehicleListener(1)
    listening.receive(bytes(speaker.said), 1.0, UNIX_S)
    return {finding.check: finding for finding in listening.findings(NAME)}


def test_a_ready_vehicle_is_told_with_all_it_says() -> None:
    speaker = Speaker().say(heartbeat(), sys_status(), position(), ekf(), system_time(0.25))
    speaker.say(*parameters(FS_GCS_ENABLE=1, MAV_GCS_SYSID=255, BATT_FS_LOW_ACT=2))

    told = found(speaker)

    assert {finding.state for finding in told.values()} == {CheckState.OK}
    assert told[NAME].text == "system id 1, ArduPilot, mode STABILIZE, not armed"
    assert told[f"{NAME} ready"].text == "pre-arm checks pass, position known, battery 87%"
    assert told[f"{NAME} time"].text == "its clock and this one differ by 0.25 s"
    assert told[f"{NAME} link"].text == "8 frames, 0 lost (0.0%)"
    assert told[f"{NAME} failsafes"].text == "if its agent dies it returns"


@pytest.mark.parametrize(
    ("vehicle_type", "says"),
    [(10, "a rover: keeps no distance from others"), (22, "a quadplane: passes its targets")],
)
def test_what_a_vehicle_is_not_flown_with_is_one_line(vehicle_type: int, says: str) -> None:
    told = found(Speaker().say(heartbeat(vehicle_type=vehicle_type)))
    assert told[f"{NAME} kind"].text.startswith(says)
    assert "\n" not in told[f"{NAME} kind"].text
    assert f"{NAME} kind" not in found(Speaker().say(heartbeat()))


def test_a_circle_is_told_among_its_limits() -> None:
    speaker = Speaker().say(heartbeat(vehicle_type=22), heartbeat(vehicle_type=22))
    assert found(speaker.say(*parameters(WP_LOITER_RAD=60)))[f"{NAME} legs"].text == (
        "WP_LOITER_RAD 60 m"
    )


def test_a_plane_without_rotors_is_told_to_need_a_runway() -> None:
    told = found(Speaker().say(heartbeat(vehicle_type=1)))
    assert told[NAME].state is CheckState.OK
    assert "lands along a runway at its start alone" in told[f"{NAME} kind"].text


def test_what_it_does_without_its_agent_is_told_with_what_would_bring_it_home() -> None:
    stays = found(Speaker().say(heartbeat(), *parameters(FS_GCS_ENABLE=0, BATT_FS_LOW_ACT=2)))
    unknown = found(Speaker().say(heartbeat()))
    lands = parameters(FS_GCS_ENABLE=5, MAV_GCS_SYSID=255, FS_GCS_TIMEOUT=7)
    warns = found(Speaker().say(heartbeat(), *lands))
    holds = found(Speaker().say(heartbeat(autopilot=12), *parameters(bytewise=True, NAV_DLL_ACT=1)))
    simulated = found(Speaker().say(heartbeat(), *parameters(FS_GCS_ENABLE=0, SWARM_SIMULATED=1)))

    low = "what it does on a low battery is not known"
    findings = [told[f"{NAME} failsafes"] for told in (stays, unknown, warns, holds, simulated)]
    assert [each.state for each in findings] == [CheckState.WARNING] * 4 + [CheckState.OK]
    assert [each.text for each in findings] == [
        "if its agent dies it hovers (FS_GCS_ENABLE is 0)",
        f"if its agent dies it may hover (FS_GCS_ENABLE is not known); {low} (BATT_FS_LOW_ACT)",
        f"if its agent dies it lands after 7 s; {low} (BATT_FS_LOW_ACT)",
        f"if its agent dies it hovers (NAV_DLL_ACT is 1); {low} (COM_LOW_BAT_ACT)",
        "if its agent dies it hovers (FS_GCS_ENABLE is 0); it is simulated, and flown all the same",
    ]
    assert "set FS_GCS_ENABLE 1" in findings[0].remedy
    assert "--command mission" in findings[0].remedy


def test_parameters_are_asked_for_until_they_are_told() -> None:
    listening = VehicleListener(1)
    before = asked_for(listening)
    listening.receive(bytes(Speaker().say(heartbeat()).said), 1.0, UNIX_S)
    first = asked_for(listening)
    said = Speaker().say(*parameters(FS_GCS_ENABLE=1, SYSID_MYGCS=255, BATT_FS_LOW_ACT=2)).said
    listening.receive(bytes(said), 2.0, UNIX_S)

    assert before == set()
    assert {"FS_GCS_ENABLE", "SYSID_MYGCS", "MAV_GCS_SYSID", "BATT_FS_LOW_ACT"} <= first
    limits = {each.name for each in ArduCopter.limit_parameters}
    assert limits <= first
    assert asked_for(listening) == {"MAV_GCS_SYSID_HI", "FS_GCS_TIMEOUT"} | limits
    said = Speaker().say(*parameters(WPNAV_ACCEL=100, PSC_JERK_XY=5, ANGLE_MAX=3000)).said
    listening.receive(bytes(said), 3.0, UNIX_S)
    assert asked_for(listening) == {"MAV_GCS_SYSID_HI", "FS_GCS_TIMEOUT"}


def test_how_it_flies_its_legs_is_told() -> None:
    ready = Speaker().say(heartbeat())
    nothing = found(ready)[f"{NAME} legs"]
    slow = found(Speaker().say(heartbeat(), *parameters(WPNAV_ACCEL=100, PSC_JERK_XY=5)))
    px4 = Speaker().say(heartbeat(autopilot=12))
    for name, value in (("MPC_ACC_HOR", 3.0), ("MPC_JERK_AUTO", 4.0), ("MPC_XY_VEL_MAX", 12.0)):
        kind = mavlink.MAV_PARAM_TYPE_REAL32
        px4.say(mavlink.MAVLink_param_value_message(name.encode(), value, kind, 3, 65535))
    absurd = found(Speaker().say(heartbeat(), *parameters(WP_ACC=-3)))[f"{NAME} legs"]

    assert nothing.text == "it tells no limit of acceleration or speed"
    assert slow[f"{NAME} legs"].text == (
        "WPNAV_ACCEL 1 m/s², with its jerk as long as 0.99 m/s² at 10 m/s"
    )
    assert found(px4)[f"{NAME} legs"].text == (
        "MPC_ACC_HOR 3 m/s², with its jerk as long as 2.5 m/s² at 10 m/s, MPC_XY_VEL_MAX 12 m/s"
    )
    assert (absurd.state, absurd.text) == (CheckState.WARNING, "not believed: WP_ACC -3")


def test_what_keeps_it_from_flying_is_told_in_the_bridges_words() -> None:
    refused = found(Speaker().say(heartbeat(), sys_status(prearm=False), position(), ekf()))
    lost = found(Speaker().say(heartbeat(), sys_status(), position()))
    booting = found(Speaker().say(heartbeat(state=1)))
    empty = found(Speaker().say(heartbeat(), sys_status(battery=9), position(), ekf()))

    assert refused[f"{NAME} ready"].text == "not yet: pre-arm checks do not pass, battery 87%"
    assert "EKF_STATUS_REPORT" in lost[f"{NAME} ready"].text
    assert booting[f"{NAME} ready"].text == "still booting or calibrating"
    assert empty[f"{NAME} ready"].text == "battery 9%"
    assert all(
        told[f"{NAME} ready"].state is CheckState.WARNING for told in (refused, lost, booting)
    )


def test_who_gets_ready_is_worth_waiting_for_and_who_is_or_never_will_be_is_not() -> None:
    nobody, listening = VehicleListener(1), VehicleListener(1)
    steps = [heartbeat(state=1)], [heartbeat(), sys_status(), position()], [ekf()]
    settled = []
    for messages in steps:
        listening.receive(bytes(Speaker().say(*messages).said), 1.0, UNIX_S)
        settled.append(listening.settled)
    plane, flown = VehicleListener(1), VehicleListener(1)
    plane.receive(bytes(Speaker().say(heartbeat(autopilot=4)).said), 1.0, UNIX_S)
    flown.receive(bytes(Speaker().say(heartbeat(armed=True)).said), 1.0, UNIX_S)

    assert settled == [False, False, True]
    assert not nobody.settled
    assert plane.settled
    assert flown.settled


def test_an_armed_vehicle_is_to_be_left_alone() -> None:
    told = found(Speaker().say(heartbeat(armed=True)))[NAME]

    assert told.state is CheckState.WARNING
    assert "ARMED" in told.text


def test_another_system_id_another_autopilot_and_silence_each_have_their_remedy() -> None:
    other = found(Speaker(system_id=7).say(heartbeat()))[NAME]
    plane = found(Speaker().say(heartbeat(autopilot=4)))[NAME]
    noise, silence = VehicleListener(1), VehicleListener(1)
    noise.receive(b"garbage" * 9, 0.0, UNIX_S)

    assert (other.state, plane.state) == (CheckState.FAILS, CheckState.FAILS)
    assert other.text == "heard system id 7, not 1"
    assert "URL#7" in other.remedy
    assert "MAV_AUTOPILOT" in plane.text
    assert noise.findings(NAME)[0].text == "63 bytes and no heartbeat among them"
    assert silence.findings(NAME)[0].text == "nothing heard"


@pytest.mark.parametrize(
    ("lost", "state"), [(0, CheckState.OK), (2, CheckState.WARNING), (30, CheckState.FAILS)]
)
def test_gaps_in_the_numbers_of_its_frames_are_losses(lost: int, state: CheckState) -> None:
    speaker = Speaker().say(heartbeat(), *[position()] * 20).lose(lost).say(*[position()] * 20)

    told = found(speaker)[f"{NAME} link"]

    assert told.state is state
    assert told.text.startswith(f"41 frames, {lost} lost")


def test_a_clock_that_is_wrong_or_unknown_is_told() -> None:
    behind = found(Speaker().say(heartbeat(), system_time(-86_400.0 * 690)))[f"{NAME} time"]
    unset = mavlink.MAVLink_system_time_message(0, 5000)
    unknown = found(Speaker().say(heartbeat(), unset))[f"{NAME} time"]

    assert behind.state is CheckState.WARNING
    assert "690 days behind" in behind.text
    assert unknown.state is CheckState.OK
    assert "does not know the time" in unknown.text


def test_signatures_are_told_whichever_side_has_the_key() -> None:
    key = SigningKey(bytes(range(32)))
    plain, signed = Speaker().say(heartbeat()), bytearray()
    raw = heartbeat()
    frame = raw.pack(mavlink.MAVLink(None, srcSystem=1, srcComponent=1))
    signed += Signing(key, lambda: UNIX_S).sign(bytes(frame), raw.crc_extra)

    with_key = VehicleListener(1, Signing(key, lambda: UNIX_S))
    assert "not to be believed: unsigned" in found(plain, with_key)[NAME].text
    without = VehicleListener(1)
    without.receive(bytes(signed), 1.0, UNIX_S)
    (told,) = (each for each in without.findings(NAME) if each.check.endswith("signing"))
    assert told.state is CheckState.WARNING
    assert "--signing-key" in told.remedy
    both = VehicleListener(1, Signing(key, lambda: UNIX_S))
    both.receive(bytes(signed), 1.0, UNIX_S)
    assert both.heard


def test_it_only_ever_asks_for_messages_and_as_no_ground_station() -> None:
    parser = mavlink.MAVLink(None)
    said = [each for frame in VehicleListener(1).requests() for each in parser.parse_buffer(frame)]

    assert {message.get_type() for message in said} == {"COMMAND_LONG"}
    assert {message.command for message in said} == {mavlink.MAV_CMD_REQUEST_MESSAGE}
    assert {message.get_srcSystem() for message in said} == {254}
    assert {message.target_system for message in said} == {1}


def test_urls_may_name_the_system_id() -> None:
    device = SerialAddress("/dev/ttyUSB0", 57600)
    assert parse_vehicle("serial:/dev/ttyUSB0:57600#7") == VehicleAddress(device, 7)
    assert parse_vehicle("serial:/dev/ttyUSB0:57600=7") == VehicleAddress(device, 7)
    assert parse_vehicle("udpin:0.0.0.0:14550") == VehicleAddress(UdpInAddress("0.0.0.0", 14550), 1)
    for wrong in ("udpin:0.0.0.0:14550#0", "udpin:0.0.0.0:14550#", "nonsense", "tcp:h:1#256"):
        with pytest.raises(InputError):
            parse_vehicle(wrong)
