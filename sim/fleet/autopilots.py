"""Which autopilots a run flies with: simulated ones, real firmware, or vehicles that run."""

from __future__ import annotations

from collections.abc import Collection, Iterable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

from agent.vehicle.config import CommandStyle, parse_link
from sim.autopilot.firmware import FirmwareModelName, check_simulated
from sim.fleet.firmware import FirmwareKind, SitlFirmware, find_firmware
from swarm.model import Mission
from swarm.model.vehicles import VehicleKind
from swarm.runtime.errors import Fault, InputError, remedy_for_name

_SOURCE = "--autopilot"
_REMEDY = (
    "give sim, sim-px4, ardupilot, px4, or one URL for each UAV with commas between, "
    "such as tcp:10.0.0.2:5760,uav3=serial:/dev/ttyUSB0:57600#7"
)
_LARGEST_SYSTEM_ID = 255


@dataclass(frozen=True, slots=True)
class SimulatedAutopilots:
    """Simulated autopilots, started with the run."""

    flavour: FirmwareModelName = FirmwareModelName.ARDUPILOT


@dataclass(frozen=True, slots=True)
class VehiclePlace:
    """Where the vehicle of one UAV is."""

    uav: str
    url: str
    system_id: int


@dataclass(frozen=True, slots=True)
class RunningVehicles:
    """Vehicles that are there already; they stay when the run ends."""

    places: tuple[VehiclePlace, ...]
    """One for each UAV, in the order of the scenario."""


Autopilots = SimulatedAutopilots | SitlFirmware | RunningVehicles


def parse_autopilots(
    text: str,
    uavs: Sequence[str],
    firmware: Path | None,
    environment: Mapping[str, str],
    vehicles: Collection[VehicleKind] = (VehicleKind.COPTER,),
) -> Autopilots:
    """What ``--autopilot`` asks for.

    URLs stand for the UAVs in the order of the scenario, or for one by name (``uav2=URL``). The
    system id is the UAV's place in the scenario, unless the URL ends in ``#ID``. ``firmware`` is
    the value of ``--firmware``; ``environment`` may say where firmware is, too. ``vehicles`` are
    the kinds that the scenario has.

    Raises:
        InputError: it makes no sense, or what it names is not there.
    """
    kind = text.strip()
    if firmware is not None and kind not in tuple(FirmwareKind):
        raise InputError(
            Fault("--firmware", str(firmware), f"does not go with --autopilot {text}", _REMEDY)
        )
    match kind:
        case "sim" | "sim-px4":
            flavour = FirmwareModelName.ARDUPILOT if kind == "sim" else FirmwareModelName.PX4
            check_simulated(flavour, vehicles, _SOURCE)
            return SimulatedAutopilots(flavour)
        case "ardupilot" | "px4":
            return find_firmware(FirmwareKind(kind), len(uavs), firmware, environment, vehicles)
    if ":" not in kind:
        raise InputError(Fault(_SOURCE, text, "no such autopilot", _REMEDY))
    return RunningVehicles(_places(kind, uavs))


def check_commanded(mission: Mission, command: Mapping[str, CommandStyle]) -> None:
    """Refuse to command by missions what is not commanded so.

    Raises:
        InputError: a UAV that is no copter is to be commanded by missions.
    """
    for uav in mission.uavs:
        if uav.vehicle is VehicleKind.COPTER or command.get(uav.id) is not CommandStyle.MISSION:
            continue
        problem = f"{uav.id} is a {uav.vehicle}, which is not commanded by missions"
        raise InputError(Fault("--command", CommandStyle.MISSION, problem, "give reposition"))


def check_speedup(autopilots: Autopilots, speedup: float) -> None:
    """Refuse to hurry vehicles whose time cannot run faster.

    Raises:
        InputError: a vehicle hangs on a serial port, so it is real: every time limit that
            keeps it safe would be stretched.
    """
    if speedup == 1.0 or not isinstance(autopilots, RunningVehicles):
        return
    for place in autopilots.places:
        if place.url.startswith("serial:"):
            problem = f"the vehicle of {place.uav} at {place.url} is real, its time runs at 1"
            raise InputError(Fault("--speedup", f"{speedup:g}", problem, "leave the option out"))


def _places(text: str, uavs: Sequence[str]) -> tuple[VehiclePlace, ...]:
    found: dict[str, VehiclePlace] = {}
    unnamed = iter(uavs)
    for part in text.split(","):
        name, url = _name_and_url(part.strip())
        if not url:
            raise InputError(Fault(_SOURCE, text, "a URL is missing", _REMEDY))
        uav = name or next((each for each in unnamed if each not in found), None)
        if uav is None:
            raise InputError(Fault(_SOURCE, text, f"more URLs than UAVs ({len(uavs)})", _REMEDY))
        if uav not in uavs:
            remedy = remedy_for_name(uav, uavs, "the scenario has")
            raise InputError(Fault(_SOURCE, part, f"no UAV {uav!r}", remedy))
        if uav in found:
            raise InputError(Fault(_SOURCE, part, f"{uav} has a URL already", _REMEDY))
        found[uav] = _place(uav, url, uavs.index(uav) + 1)
    if missing := [uav for uav in uavs if uav not in found]:
        raise InputError(Fault(_SOURCE, text, f"no URL for {', '.join(missing)}", _REMEDY))
    _check_shared(found.values())
    return tuple(found[uav] for uav in uavs)


def _name_and_url(part: str) -> tuple[str, str]:
    """The UAV that is named before ``=``, empty if none is, and the URL."""
    name, marked, url = part.partition("=")
    return (name, url) if marked and ":" not in name else ("", part)


def _place(uav: str, url: str, system_id: int) -> VehiclePlace:
    address, marked, number = url.rpartition("#")
    if not marked:
        address = url
    else:
        if not (number.isascii() and number.isdigit() and len(number) < 4):
            raise InputError(Fault(_SOURCE, url, f"{number!r} is no system id", _REMEDY))
        system_id = int(number)
    if not 1 <= system_id <= _LARGEST_SYSTEM_ID:
        problem = f"system id {system_id} is not within 1..{_LARGEST_SYSTEM_ID}"
        raise InputError(Fault(_SOURCE, url, problem, "add #ID to the URL"))
    return VehiclePlace(uav, str(parse_link(address, _SOURCE)), system_id)


def _check_shared(places: Iterable[VehiclePlace]) -> None:
    """A serial port or a port to listen at serves one agent, whatever the vehicles' ids."""
    by_url: dict[str, str] = {}
    for place in places:
        other = by_url.setdefault(place.url, place.uav)
        if other != place.uav and place.url.startswith(("serial:", "udpin:")):
            problem = f"{other} and {place.uav} cannot share it"
            remedy = "let a MAVLink router serve both by TCP"
            raise InputError(Fault(_SOURCE, place.url, problem, remedy))
