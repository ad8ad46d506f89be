"""Real firmware is started with what its own sources ask for."""

from __future__ import annotations

import math
import re
from dataclasses import replace
from itertools import pairwise
from pathlib import Path

import pytest

from sim.fleet.firmware import FirmwareKind, FirmwareProcess, SitlFirmware, find_firmware
from swarm.model.frames import Origin, wgs84_from_enu
from swarm.model.vehicles import VehicleKind, turning_acceleration_m_s2
from swarm.runtime.errors import InputError
from tests.support.builders import mission, task, uav

ORIGIN = Origin(47.4, 8.5, 480.0)
PLACE_ENU_M = (100.0, -50.0, 3.0)
FLEET = replace(
    mission([uav("u0"), replace(uav("u1"), position_enu_m=PLACE_ENU_M)], [task("t0", 1.0)]),
    origin=ORIGIN,
)


def processes(kind: FirmwareKind, program: str, speedup: float = 4.0) -> list[FirmwareProcess]:
    firmware = SitlFirmware(kind, Path(program), Path("/tmp"))
    return list(firmware.processes(FLEET, speedup).values())


def value(process: FirmwareProcess, option: str) -> str:
    (only,) = [word for name, word in pairwise(process.command) if name == option]
    return only


def test_every_arducopter_has_ports_and_system_id_of_its_own() -> None:
    made = processes(FirmwareKind.ARDUPILOT, "/opt/arducopter")

    assert [each.command[0] for each in made] == ["/opt/arducopter"] * 2
    assert [value(each, "--instance") for each in made] == ["0", "1"]
    assert [value(each, "--sysid") for each in made] == ["1", "2"]
    assert [each.url for each in made] == ["tcp:127.0.0.1:5760", "tcp:127.0.0.1:5770"]
    assert [each.system_id for each in made] == [1, 2]


def test_arducopter_stands_at_its_start_and_runs_as_fast_as_the_mission() -> None:
    _, made = processes(FirmwareKind.ARDUPILOT, "/opt/arducopter")

    lat_deg, lon_deg, alt_m, yaw_deg = map(float, value(made, "--home").split(","))
    assert (lat_deg, lon_deg, alt_m) == pytest.approx(wgs84_from_enu(ORIGIN, PLACE_ENU_M), abs=1e-6)
    assert yaw_deg == 0.0
    assert value(made, "--speedup") == "4"
    assert value(made, "--model") == "+"


def test_arducopter_reads_its_parameters_from_a_file_in_its_folder() -> None:
    made, _ = processes(FirmwareKind.ARDUPILOT, "/opt/arducopter")

    text = made.files[value(made, "--defaults")]
    parameters = dict(line.split() for line in text.splitlines())
    assert parameters["FRAME_CLASS"] == "1"
    assert parameters["FRAME_TYPE"] == "0"
    assert parameters["RC8_TRIM"] == "1500"
    assert parameters["BATT_MONITOR"] == "4"


def test_battery_of_arducopter_lasts_for_a_shipped_mission() -> None:
    made, _ = processes(FirmwareKind.ARDUPILOT, "/opt/arducopter")

    text = made.files[value(made, "--defaults")]
    capacity_mah = float(dict(line.split() for line in text.splitlines())["BATT_CAPACITY"])
    # Recorded: 27 % of 3300 mAh in 110 s.
    assert 0.8 * capacity_mah / (0.27 * 3300.0 / 110.0) > 3000.0


OTHERS = {
    VehicleKind.ROVER: Path("/opt/ardurover"),
    VehicleKind.QUADPLANE: Path("/opt/arduplane"),
}
MIXED = replace(
    mission(
        [
            uav("u0"),
            replace(uav("u1"), vehicle=VehicleKind.ROVER),
            replace(
                uav("u2"),
                vehicle=VehicleKind.QUADPLANE,
                speed_m_s=20.0,
                acceleration_m_s2=turning_acceleration_m_s2(20.0, 80.0),
            ),
        ],
        [task("t0", 1.0)],
    ),
    origin=ORIGIN,
)


def parameters_of(process: FirmwareProcess) -> dict[str, str]:
    text = process.files[value(process, "--defaults")]
    return dict(line.split() for line in text.splitlines())


def test_ardupilot_has_a_program_and_a_model_for_each_kind_of_vehicle() -> None:
    firmware = SitlFirmware(
        FirmwareKind.ARDUPILOT, Path("/opt/arducopter"), Path("/tmp"), others=OTHERS
    )
    made = list(firmware.processes(MIXED, 1.0).values())

    assert [each.command[0] for each in made] == [
        "/opt/arducopter",
        "/opt/ardurover",
        "/opt/arduplane",
    ]
    assert [value(each, "--model") for each in made] == ["+", "rover", "quadplane"]
    assert [each.url for each in made] == [f"tcp:127.0.0.1:{port}" for port in (5760, 5770, 5780)]
    assert "FRAME_CLASS" not in parameters_of(made[1])
    plane = parameters_of(made[2])
    assert (plane["Q_ENABLE"], plane["Q_MAV_TYPE"], plane["WP_LOITER_RAD"]) == ("1", "22", "80")


def test_ardupilots_plane_stands_in_the_direction_of_its_landing_and_returns_to_that() -> None:
    plane = replace(
        uav("u0"),
        vehicle=VehicleKind.PLANE,
        speed_m_s=12.0,
        acceleration_m_s2=turning_acceleration_m_s2(12.0, 80.0),
        landing_heading_rad=math.radians(275.0),
    )
    fleet = replace(mission([plane], [task("t0", 1.0)]), origin=ORIGIN)
    others = {VehicleKind.PLANE: Path("/opt/arduplane")}
    firmware = SitlFirmware(FirmwareKind.ARDUPILOT, Path("/opt/x"), Path("/tmp"), others=others)
    made = firmware.processes(fleet, 1.0)["u0"]

    assert made.command[0] == "/opt/arduplane"
    assert value(made, "--model") == "plane"
    assert value(made, "--home").split(",")[-1] == "275"
    told = parameters_of(made)
    assert (told["RTL_AUTOLAND"], told["WP_LOITER_RAD"]) == ("2", "80")
    assert "Q_ENABLE" not in told


def test_px4_has_a_model_for_each_kind_of_vehicle_and_one_program() -> None:
    plane = replace(
        uav("u1"),
        vehicle=VehicleKind.PLANE,
        speed_m_s=12.0,
        acceleration_m_s2=turning_acceleration_m_s2(12.0, 80.0),
        landing_heading_rad=0.0,
    )
    fleet = replace(mission([uav("u0"), plane], [task("t0", 1.0)]), origin=ORIGIN)
    firmware = SitlFirmware(FirmwareKind.PX4, Path("/opt/px4/bin/px4"), Path("/tmp"))
    copter, flown = (each.environment for each in firmware.processes(fleet, 1.0).values())

    assert [each["PX4_SIM_MODEL"] for each in (copter, flown)] == [
        "sihsim_quadx",
        "sihsim_airplane",
    ]
    assert flown["PX4_PARAM_NAV_LOITER_RAD"] == "80.0"
    assert "PX4_PARAM_SIH_KDV" not in flown
    assert "PX4_PARAM_NAV_LOITER_RAD" not in copter


@pytest.mark.parametrize(
    ("kind", "variables", "said"),
    [
        (FirmwareKind.PX4, {}, "--autopilot: px4: a rover is not flown with PX4; fly it with"),
        (FirmwareKind.ARDUPILOT, {}, "SWARM_SITL_ROVER: a rover: no firmware is known; give"),
        (
            FirmwareKind.ARDUPILOT,
            {"SWARM_SITL_ROVER": "/nowhere/ardurover"},
            "SWARM_SITL_ROVER: /nowhere/ardurover: there is no program /nowhere/ardurover; give",
        ),
    ],
)
def test_a_rover_without_its_program_is_one_line(
    kind: FirmwareKind, variables: dict[str, str], said: str
) -> None:
    with pytest.raises(InputError) as caught:
        find_firmware(kind, 2, None, variables, [VehicleKind.COPTER, VehicleKind.ROVER])
    assert str(caught.value).startswith(said)


def test_a_fleet_of_rovers_needs_no_copters_program(tmp_path: Path) -> None:
    rover = program(tmp_path / "ardurover")
    variables = {"SWARM_SITL_ROVER": str(rover)}
    found = find_firmware(FirmwareKind.ARDUPILOT, 2, None, variables, [VehicleKind.ROVER])
    assert found.others == {VehicleKind.ROVER: rover}


def test_every_px4_has_ports_and_system_id_of_its_own() -> None:
    made = processes(FirmwareKind.PX4, "/opt/px4/bin/px4")

    assert made[0].command == (
        *("/opt/px4/bin/px4", "-i", "0", "-d"),
        *("-s", "etc/init.d-posix/rcS", "/opt/px4/etc"),
    )
    assert [value(each, "-i") for each in made] == ["0", "1"]
    assert [each.url for each in made] == ["udpin:127.0.0.1:14540", "udpin:127.0.0.1:14541"]
    assert [each.system_id for each in made] == [1, 2]
    assert all(each.files == {} for each in made)


def test_px4_learns_everything_else_from_its_environment() -> None:
    _, made = processes(FirmwareKind.PX4, "/opt/px4/bin/px4", speedup=2.5)

    said = dict(made.environment)
    place = tuple(float(said.pop(f"PX4_HOME_{name}")) for name in ("LAT", "LON", "ALT"))
    assert place == pytest.approx(wgs84_from_enu(ORIGIN, PLACE_ENU_M), abs=1e-6)
    assert said == {
        "PX4_SIM_MODEL": "sihsim_quadx",
        "PX4_SIMULATOR": "sihsim",
        "PX4_SIM_SPEED_FACTOR": "2.5",
        "PX4_PARAM_SIH_KDV": "0.3",
        "PX4_PARAM_SIM_BAT_DRAIN": "86400",
    }


@pytest.mark.parametrize("kind", FirmwareKind)
def test_every_instance_has_a_folder_that_a_shell_takes_as_it_is(kind: FirmwareKind) -> None:
    folders = [each.folder for each in processes(kind, "/opt/firmware")]

    assert len(set(folders)) == len(folders)
    assert all(re.fullmatch(r"[a-z0-9-]+", folder) for folder in folders)


def build_of_px4(folder: Path) -> Path:
    (folder / "etc" / "init.d-posix").mkdir(parents=True)
    (folder / "etc" / "init.d-posix" / "rcS").touch()
    return program(folder / "bin" / "px4").parent.parent


def program(path: Path) -> Path:
    path.parent.mkdir(parents=True, exist_ok=True)
    path.touch(mode=0o755)
    return path


def test_firmware_is_found_where_the_variable_says(tmp_path: Path) -> None:
    copter, build = program(tmp_path / "arducopter"), build_of_px4(tmp_path / "build")
    variables = {"SWARM_SITL_ARDUCOPTER": str(copter), "SWARM_SITL_PX4": str(build)}

    assert find_firmware(FirmwareKind.ARDUPILOT, 3, None, variables).program == copter
    assert find_firmware(FirmwareKind.PX4, 3, None, variables).program == build / "bin" / "px4"


def test_a_path_that_is_given_beats_the_variable(tmp_path: Path) -> None:
    copter = program(tmp_path / "arducopter")
    variables = {"SWARM_SITL_ARDUCOPTER": "/nowhere/arducopter"}

    assert find_firmware(FirmwareKind.ARDUPILOT, 3, copter, variables).program == copter


@pytest.mark.parametrize("kind", FirmwareKind)
def test_firmware_that_nobody_has_named_is_one_clear_line(kind: FirmwareKind) -> None:
    with pytest.raises(InputError) as caught:
        find_firmware(kind, 3, None, {})

    assert str(caught.value).startswith(f"--autopilot: {kind}: no firmware is known; give the path")
    assert kind.variable in str(caught.value)


def test_firmware_that_is_not_there_is_one_clear_line(tmp_path: Path) -> None:
    variables = {"SWARM_SITL_PX4": str(tmp_path)}
    with pytest.raises(InputError, match=r"^SWARM_SITL_PX4: .*: there is no file .*/bin/px4; give"):
        find_firmware(FirmwareKind.PX4, 3, None, variables)
    with pytest.raises(InputError, match=r"^--firmware: .*: there is no file .*/no/copter; give"):
        find_firmware(FirmwareKind.ARDUPILOT, 3, tmp_path / "no" / "copter", variables)


def test_a_file_that_is_no_program_is_one_clear_line(tmp_path: Path) -> None:
    (tmp_path / "arducopter").touch(mode=0o644)
    with pytest.raises(InputError, match="cannot be executed"):
        find_firmware(FirmwareKind.ARDUPILOT, 3, tmp_path / "arducopter", {})


def test_px4_without_its_startup_script_is_one_clear_line(tmp_path: Path) -> None:
    build = build_of_px4(tmp_path)
    (build / "etc" / "init.d-posix" / "rcS").unlink()
    with pytest.raises(InputError, match="no startup script"):
        find_firmware(FirmwareKind.PX4, 3, build, {})


def test_a_build_folder_that_no_path_can_name_is_one_clear_line(tmp_path: Path) -> None:
    with pytest.raises(InputError, match=r"^--firmware: .*: PX4 finds its programs along PATH"):
        find_firmware(FirmwareKind.PX4, 3, build_of_px4(tmp_path / "a:b"), {})


def test_more_px4s_than_have_ports_are_refused(tmp_path: Path) -> None:
    build = build_of_px4(tmp_path)

    find_firmware(FirmwareKind.PX4, 10, build, {})
    with pytest.raises(InputError, match="11 UAVs, but at most 10"):
        find_firmware(FirmwareKind.PX4, 11, build, {})
