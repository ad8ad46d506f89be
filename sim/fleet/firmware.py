"""How real firmware is started in software-in-the-loop: a pure description, one process a UAV.

ArduPilot has a binary for each kind of vehicle: its options name model, instance, home place,
speed-up and system id, its parameters come from a file, and instance n waits for its agent at TCP
port 5760 + 10 n; a ground station may connect to the port two above. It goes on booting once the
agent is there (ArduPilot, ``libraries/AP_HAL_SITL/SITL_cmdline.cpp``;
https://ardupilot.org/dev/docs/sitl-serial-mapping.html). PX4 is a build folder with ``bin/px4``
and ``etc``: everything but the instance is said by environment variables, the vehicle is the
quadrotor or the airplane of its own simulator, which needs no other program, instance n has system
id n + 1 and speaks to UDP port 14540 + n; a ground station is spoken to at 14550 (PX4-Autopilot,
``Tools/simulation/sitl_multiple_run.sh``,
``ROMFS/px4fmu_common/init.d-posix/{rcS,px4-rc.mavlink,px4-rc.simulator}`` and
``src/modules/simulation/simulator_sih/sih.cpp``; https://docs.px4.io/main/en/sim_sih/).

They work below a folder of their own, in whatever shell scripts they bring along: PX4's startup
script names files below its working folder without quotes, and looks some up along PATH, so a
space, a star or a colon in that name ends it.
"""

from __future__ import annotations

import math
import os
import re
import tempfile
from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, field
from enum import StrEnum
from pathlib import Path
from typing import Final

from sim.fleet.ardupilot_vehicles import ARDUPILOT_VEHICLES
from sim.fleet.px4_vehicles import PX4_VEHICLES
from swarm.model import Mission, Uav
from swarm.model.frames import DEFAULT_ORIGIN, wgs84_from_enu
from swarm.model.vehicles import VehicleKind
from swarm.runtime.errors import Fault, InputError

_ARDUCOPTER_PORT: Final = 5760

_ARDUCOPTER_PORTS_EACH: Final = 10

_ARDUCOPTER_MOST: Final = 250
"""System ids end at 255, which is customary for ground stations."""

_PX4_PORT: Final = 14540

_PX4_MOST: Final = 10
"""From its eleventh instance on PX4 speaks to one and the same UDP port."""

_HEADING_DEG: Final = 0.0
"""In which they stand unless it matters; the models of PX4's simulator know no other."""


_PARAMETER_FILE: Final = "vehicle.parm"


class FirmwareKind(StrEnum):
    """Firmware that `swarm run` can start."""

    ARDUPILOT = "ardupilot"
    PX4 = "px4"

    @property
    def variable(self) -> str:
        """Environment variable that says where it is."""
        return _VARIABLES[self]

    @property
    def most(self) -> int:
        """Instances that can run side by side on one machine."""
        return _ARDUCOPTER_MOST if self is FirmwareKind.ARDUPILOT else _PX4_MOST


_VARIABLES: Final = {
    FirmwareKind.ARDUPILOT: "SWARM_SITL_ARDUCOPTER",
    FirmwareKind.PX4: "SWARM_SITL_PX4",
}


@dataclass(frozen=True, slots=True)
class FirmwareProcess:
    """One instance: how to start it, and where its agent finds it."""

    command: tuple[str, ...]
    """Program and arguments; to be run in a folder of its own."""
    folder: str
    """Name of that folder: nothing in it that a shell would not take as it is."""
    environment: Mapping[str, str]
    """Variables beside those of this process."""
    files: Mapping[str, str]
    """Name and text of the files it needs in its folder."""
    url: str
    system_id: int


@dataclass(frozen=True, slots=True)
class SitlFirmware:
    """Real firmware in software-in-the-loop, one instance for each UAV."""

    kind: FirmwareKind
    program: Path
    """Absolute path of the binary; of ArduPilot's that of copters, where there are any."""
    workplace: Path
    """Where its instances get folders of their own."""
    others: Mapping[VehicleKind, Path] = field(default_factory=dict)
    """Binaries of ArduPilot's other vehicles."""

    def processes(self, mission: Mission, speedup: float) -> dict[str, FirmwareProcess]:
        """Processes by UAV, each vehicle standing at its UAV's start."""
        origin = mission.origin or DEFAULT_ORIGIN
        made: dict[str, FirmwareProcess] = {}
        for number, uav in enumerate(mission.uavs):
            home = wgs84_from_enu(origin, uav.position_enu_m)
            if self.kind is FirmwareKind.ARDUPILOT:
                made[uav.id] = self._ardupilot(number, home, speedup, uav)
            else:
                made[uav.id] = self._px4(number, home, speedup, uav)
        return made

    def _ardupilot(
        self, number: int, home: tuple[float, float, float], speedup: float, uav: Uav
    ) -> FirmwareProcess:
        vehicle = ARDUPILOT_VEHICLES[uav.vehicle]
        program = self.others.get(uav.vehicle, self.program)
        lat_deg, lon_deg, alt_m = home
        port = _ARDUCOPTER_PORT + _ARDUCOPTER_PORTS_EACH * number
        command = (
            *(str(program), "--model", vehicle.model),
            *("--speedup", f"{speedup:g}"),
            *("--home", f"{lat_deg:.7f},{lon_deg:.7f},{alt_m:.2f},{_heading_deg(uav):g}"),
            *("--defaults", _PARAMETER_FILE),
            *("--instance", str(number)),
            *("--sysid", str(number + 1)),
        )
        values: dict[str, float] = {**vehicle.parameters}
        if uav.turn_radius_m is not None:
            values["WP_LOITER_RAD"] = round(uav.turn_radius_m)
        parameters = "".join(f"{name} {value}\n" for name, value in values.items())
        url = f"tcp:127.0.0.1:{port}"
        files = {_PARAMETER_FILE: parameters}
        return FirmwareProcess(command, self._folder(number), {}, files, url, number + 1)

    def _px4(
        self, number: int, home: tuple[float, float, float], speedup: float, uav: Uav
    ) -> FirmwareProcess:
        vehicle = PX4_VEHICLES[uav.vehicle]
        lat_deg, lon_deg, alt_m = home
        etc = self.program.parent.parent / "etc"
        startup = "etc/init.d-posix/rcS"  # found through a link that px4 makes in its folder
        environment = {
            "PX4_SIM_MODEL": vehicle.model,
            "PX4_SIMULATOR": "sihsim",
            "PX4_SIM_SPEED_FACTOR": f"{speedup:g}",
            "PX4_HOME_LAT": f"{lat_deg:.7f}",
            "PX4_HOME_LON": f"{lon_deg:.7f}",
            "PX4_HOME_ALT": f"{alt_m:.2f}",
            **{f"PX4_PARAM_{name}": f"{value:g}" for name, value in vehicle.parameters.items()},
        }
        if uav.turn_radius_m is not None:
            environment["PX4_PARAM_NAV_LOITER_RAD"] = f"{uav.turn_radius_m:.1f}"
        command = (str(self.program), "-i", str(number), "-d", "-s", startup, str(etc))
        url = f"udpin:127.0.0.1:{_PX4_PORT + number}"
        return FirmwareProcess(command, self._folder(number), environment, {}, url, number + 1)

    def _folder(self, number: int) -> str:
        return f"{self.kind}-{number + 1}"


def _heading_deg(uav: Uav) -> float:
    """In which it stands: on a runway in that of its landing, clockwise from north."""
    heading_rad = uav.landing_heading_rad
    return _HEADING_DEG if heading_rad is None else round(math.degrees(heading_rad), 3)


def find_firmware(
    kind: FirmwareKind,
    n_uav: int,
    path: Path | None,
    environment: Mapping[str, str],
    vehicles: Collection[VehicleKind] = (VehicleKind.COPTER,),
) -> SitlFirmware:
    """The firmware of that kind on this machine, for ``n_uav`` instances of ``vehicles``.

    ``path`` is that of ArduCopter's binary, or of a build folder of PX4; without one a variable of
    ``environment`` says where it is, as it does of other vehicles' binaries.

    Raises:
        InputError: it is not there, cannot serve so many, or has no place to work in.
    """
    others = _find_others(kind, n_uav, environment, vehicles)
    if others and VehicleKind.COPTER not in vehicles:
        return SitlFirmware(kind, next(iter(others.values())), firmware_workplace(), others)
    source = "--firmware" if path is not None else kind.variable
    what, example = (
        ("ArduPilot's binary", "~/ardupilot/build/sitl/bin/arducopter")
        if kind is FirmwareKind.ARDUPILOT
        else ("a build folder of PX4", "~/PX4-Autopilot/build/px4_sitl_default")
    )
    remedy = f"give the path of {what}, such as {example}"
    text = str(path) if path is not None else environment.get(kind.variable, "")
    if not text:
        where = f"by --firmware PATH or in {kind.variable}"
        raise InputError(Fault("--autopilot", kind, "no firmware is known", f"{remedy}, {where}"))
    place = Path(text).expanduser().absolute()
    program = place / "bin" / "px4" if kind is FirmwareKind.PX4 else place
    if not program.is_file():
        raise InputError(Fault(source, text, f"there is no file {program}", remedy))
    if not os.access(program, os.X_OK):
        raise InputError(Fault(source, text, f"{program} cannot be executed", remedy))
    if kind is FirmwareKind.PX4 and not (place / "etc" / "init.d-posix" / "rcS").is_file():
        problem = f"there is no startup script {place}/etc/init.d-posix/rcS"
        raise InputError(Fault(source, text, problem, remedy))
    if kind is FirmwareKind.PX4 and os.pathsep in str(place):
        problem = f"PX4 finds its programs along PATH, so not below a folder with {os.pathsep!r}"
        raise InputError(Fault(source, text, problem, "give the build folder another name"))
    if n_uav > kind.most:
        problem = f"{n_uav} UAVs, but at most {kind.most} such vehicles run on one machine"
        raise InputError(Fault("--autopilot", kind, problem, "fly a smaller scenario"))
    return SitlFirmware(kind, program, firmware_workplace(), others)


def _find_others(
    kind: FirmwareKind,
    n_uav: int,
    environment: Mapping[str, str],
    vehicles: Collection[VehicleKind],
) -> dict[VehicleKind, Path]:
    """Binaries of what is no copter, by kind."""
    found: dict[VehicleKind, Path] = {}
    for vehicle in dict.fromkeys(vehicles):
        if vehicle is VehicleKind.COPTER:
            continue
        if kind is FirmwareKind.PX4:
            if vehicle not in PX4_VEHICLES:
                problem = f"a {vehicle} is not flown with PX4"
                raise InputError(Fault("--autopilot", kind, problem, "fly it with ardupilot"))
            continue  # of the same program
        if vehicle not in ARDUPILOT_VEHICLES:
            problem = f"a {vehicle} is not flown with ArduPilot"
            raise InputError(Fault("--autopilot", kind, problem, "fly it with px4"))
        if n_uav > kind.most:
            problem = f"{n_uav} UAVs, but at most {kind.most} such vehicles run on one machine"
            raise InputError(Fault("--autopilot", kind, problem, "fly a smaller scenario"))
        known = ARDUPILOT_VEHICLES[vehicle]
        text = environment.get(known.variable, "")
        place = Path(text).expanduser().absolute()
        if not (text and place.is_file() and os.access(place, os.X_OK)):
            problem = f"there is no program {place}" if text else "no firmware is known"
            remedy = (
                f"give the path of the binary, such as ~/ardupilot/build/sitl/bin/{known.program}"
            )
            raise InputError(Fault(known.variable, text or f"a {vehicle}", problem, remedy))
        found[vehicle] = place
    return found


_PLAIN: Final = re.compile(r"[A-Za-z0-9_./+-]+")
"""Signs that mean nothing to a shell, quoted or not, nor in PATH."""

_COMMON: Final = (Path("/tmp"), Path("/var/tmp"))  # noqa: S108 - files go into a private folder


def firmware_workplace(folders: Sequence[Path] | None = None) -> Path:
    """The first folder whose name a shell takes as it is, and in which files can be made.

    By default it is looked for where temporary files go, then where they usually go.

    Raises:
        InputError: there is none.
    """
    candidates = folders or (Path(tempfile.gettempdir()), *_COMMON)
    for folder in candidates:
        # A shell that is started there calls it by its own name, not by that of a link.
        place = folder.resolve()
        if _PLAIN.fullmatch(str(place)) and place.is_dir() and os.access(place, os.W_OK | os.X_OK):
            return place
    problem = "firmware's scripts can work neither there nor in a common place"
    remedy = "name a folder by letters, digits and _ . + - only, and let files be made in it"
    raise InputError(Fault("TMPDIR", str(candidates[0]), problem, remedy))
