"""What ``--autopilot`` and the options beside it ask for."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import pytest

from agent.vehicle.config import CommandStyle
from sim.autopilot.firmware import FirmwareModelName
from sim.fleet.autopilots import (
    RunningVehicles,
    SimulatedAutopilots,
    VehiclePlace,
    check_commanded,
    parse_autopilots,
)
from sim.fleet.firmware import FirmwareKind, SitlFirmware, firmware_workplace
from sim.fleet.layout import defaults_for
from sim.fleet.passthrough import PassthroughOptions, check_passthrough, parse_command_styles
from swarm.model.vehicles import VehicleKind
from swarm.runtime.errors import InputError
from tests.support import builders

UAVS = ("uav1", "uav2", "uav3")
A, B, C = "tcp:10.0.0.1:5760", "udpin:0.0.0.0:14550", "serial:/dev/ttyUSB0:57600"


def running(text: str) -> tuple[VehiclePlace, ...]:
    made = parse_autopilots(text, UAVS, None, {})
    assert isinstance(made, RunningVehicles)
    return made.places


def test_simulated_autopilots_come_in_two_flavours() -> None:
    assert parse_autopilots("sim", UAVS, None, {}) == SimulatedAutopilots(
        FirmwareModelName.ARDUPILOT
    )
    assert parse_autopilots("sim-px4", UAVS, None, {}) == SimulatedAutopilots(FirmwareModelName.PX4)


def test_firmware_is_looked_for(tmp_path: Path) -> None:
    copter = tmp_path / "arducopter"
    copter.touch(mode=0o755)

    made = parse_autopilots("ardupilot", UAVS, copter, {})

    assert made == SitlFirmware(FirmwareKind.ARDUPILOT, copter, firmware_workplace())


def test_urls_belong_to_the_uavs_in_order() -> None:
    assert running(f"{A},{B},{C}") == (
        VehiclePlace("uav1", A, 1),
        VehiclePlace("uav2", B, 2),
        VehiclePlace("uav3", C, 3),
    )


def test_a_url_may_be_given_to_a_uav_by_name() -> None:
    assert running(f"uav2={A}, {B}, {C}") == (
        VehiclePlace("uav1", B, 1),
        VehiclePlace("uav2", A, 2),
        VehiclePlace("uav3", C, 3),
    )


def test_a_url_may_say_the_system_id_of_its_vehicle() -> None:
    assert [place.system_id for place in running(f"{A}#17,{B},uav3={C}#255")] == [17, 2, 255]


def test_vehicles_behind_one_router_are_told_apart_by_their_ids() -> None:
    assert [place.system_id for place in running(f"{A}#4,{A}#5,{A}#6")] == [4, 5, 6]


@pytest.mark.parametrize(
    ("text", "problem"),
    [
        ("gazebo", "no such autopilot"),
        ("", "no such autopilot"),
        (f"{A},{B}", "no URL for uav3"),
        (f"{A},{B},{C},tcp:h:1", r"more URLs than UAVs \(3\)"),
        (f"{A},,{C}", "a URL is missing"),
        (f"uav9={A},{B},{C}", "no UAV 'uav9'"),
        (f"uav1={A},uav1={B},{C}", "uav1 has a URL already"),
        (f"{B},{B},{C}", "uav1 and uav2 cannot share it"),
        (f"{C},{B},{C}#9", "uav1 and uav3 cannot share it"),
        (f"{A}#0,{B},{C}", r"system id 0 is not within 1\.\.255"),
        (f"{A}#300,{B},{C}", r"system id 300 is not within 1\.\.255"),
        (f"{A}#x,{B},{C}", "'x' is no system id"),
        (f"{A}#,{B},{C}", "'' is no system id"),
        (f"tcp:10.0.0.1,{B},{C}", "a part is missing"),
        (f"tcp:10.0.0.1:99999,{B},{C}", "port 99999 is not within"),
        (f"http:h:1,{B},{C}", "'http' is no kind of link"),
    ],
)
def test_a_wrong_autopilot_is_one_clear_line(text: str, problem: str) -> None:
    with pytest.raises(InputError, match=problem) as caught:
        parse_autopilots(text, UAVS, None, {})

    assert str(caught.value).startswith("--autopilot: ")
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize("text", ["sim", f"{A},{B},{C}"])
def test_firmware_given_to_an_autopilot_that_needs_none_is_refused(text: str) -> None:
    with pytest.raises(InputError, match=r"^--firmware: copter: does not go with --autopilot"):
        parse_autopilots(text, UAVS, Path("copter"), {})


def test_one_style_of_command_is_for_all() -> None:
    assert parse_command_styles("mission", UAVS) == dict.fromkeys(UAVS, CommandStyle.MISSION)
    assert parse_command_styles(None, UAVS) == {}


def test_styles_of_command_may_differ() -> None:
    styles = parse_command_styles("uav1=mission, uav3=reposition", UAVS)

    assert styles == {"uav1": CommandStyle.MISSION, "uav3": CommandStyle.REPOSITION}
    told = PassthroughOptions(command=styles)
    assert told.to_agent("uav1") == ["--command", "mission"]
    assert told.to_agent("uav2") == []


def test_what_is_accepted_of_vehicles_is_told_to_every_agent() -> None:
    assert PassthroughOptions(accept_no_failsafe=True).to_agent("uav2") == ["--accept-no-failsafe"]


@pytest.mark.parametrize(
    ("text", "problem"),
    [
        ("offboard", "no such way to command; choose one of reposition, mission"),
        ("", "no such way to command"),
        ("uav1=offboard", "no such way to command"),
        ("uav9=mission", "no UAV 'uav9'"),
        ("uav1=mission,uav1=mission", "uav1 is named twice"),
        ("uav1=mission,mission", "'mission' names no UAV"),
    ],
)
def test_a_wrong_style_of_command_is_one_clear_line(text: str, problem: str) -> None:
    with pytest.raises(InputError, match=problem):
        parse_command_styles(text, UAVS)


def test_a_fault_reaches_the_process_of_its_vehicle_alone() -> None:
    told = PassthroughOptions(faults=("uav1:pilot@5", "uav3:silent@9+10"))

    assert told.to_autopilot(["uav1", "uav2"]) == ["--fault", "uav1:pilot@5"]
    assert told.to_autopilot(["uav3"]) == ["--fault", "uav3:silent@9+10"]


def test_each_vehicle_and_its_agent_share_a_key_that_no_other_has(tmp_path: Path) -> None:
    for number, uav in enumerate(UAVS):
        (tmp_path / uav).mkdir()
        key = tmp_path / uav / "mavlink.key"
        key.touch(mode=0o600)
        key.write_bytes(bytes([number + 1]) * 32)
    told = PassthroughOptions(signing_key=tmp_path)

    check_passthrough(told, SimulatedAutopilots(), UAVS)
    assert told.to_agent("uav2") == ["--signing-key", str(tmp_path / "uav2" / "mavlink.key")]
    assert told.to_autopilot(["uav1", "uav2"]) == ["--signing-key", str(tmp_path)]
    (tmp_path / "uav3" / "mavlink.key").unlink()
    with pytest.raises(InputError, match=r"uav3/mavlink\.key: cannot be read"):
        check_passthrough(told, SimulatedAutopilots(), UAVS)


def test_a_fault_of_nobody_is_one_clear_line() -> None:
    with pytest.raises(InputError, match="no UAV 'uav9'"):
        check_passthrough(PassthroughOptions(faults=("uav9:pilot@5",)), SimulatedAutopilots(), UAVS)


def test_only_simulated_autopilots_have_faults_at_will() -> None:
    vehicles = parse_autopilots(f"{A},{B},{C}", UAVS, None, {})
    with pytest.raises(InputError, match="only befalls simulated autopilots"):
        check_passthrough(PassthroughOptions(faults=("uav1:pilot@5",)), vehicles, UAVS)


def test_real_vehicles_are_given_more_time_and_room_than_simulated_ones() -> None:
    exact = defaults_for(SimulatedAutopilots(), 3)
    real = defaults_for(parse_autopilots(f"{A},{B},{C}", UAVS, None, {}), 3)

    assert real.start_timeout_s > exact.start_timeout_s
    assert real.acceptance_radius_m > exact.acceptance_radius_m
    assert real.position_rate_hz < exact.position_rate_hz


def test_kinds_that_are_not_simulated_or_commanded_so_are_one_line() -> None:
    kinds = [VehicleKind.COPTER, VehicleKind.ROVER]
    assert parse_autopilots("sim", UAVS, None, {}, kinds) == SimulatedAutopilots()
    with pytest.raises(InputError, match="--autopilot: px4: no rover is simulated with that firm"):
        parse_autopilots("sim-px4", UAVS, None, {}, kinds)
    rover = replace(builders.uav("u1"), vehicle=VehicleKind.ROVER)
    fleet = builders.mission([builders.uav("u0"), rover], [builders.task("t", 1.0)])
    check_commanded(fleet, {"u0": CommandStyle.MISSION, "u1": CommandStyle.REPOSITION})
    with pytest.raises(InputError, match="--command: mission: u1 is a rover, which is not comman"):
        check_commanded(fleet, {"u1": CommandStyle.MISSION})
