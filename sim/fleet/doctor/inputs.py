"""Whether what a flight is given is fit for it: its scenario and its keys.

Keys are to be whole, closed to others, in force, and not about to expire.
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from coordinator.core.heights import height_warnings
from sim.fleet.doctor.field import check_field
from sim.fleet.doctor.finding import CheckFinding, fails, fine, warns
from swarm.identity import Identity, Role, load_identity
from swarm.identity.folder import shown_time
from swarm.model import Mission
from swarm.model.layers import layers_over
from swarm.runtime.errors import InputError
from swarm.scenario import load_scenario


def check_scenario(path: Path) -> tuple[Mission | None, list[CheckFinding]]:
    """The mission, if the file is sound, and what is to be said of it."""
    try:
        mission = load_scenario(path)
    except InputError as error:
        return None, [
            fails(
                "scenario",
                ": ".join(filter(None, (fault.source, fault.place, fault.problem))),
                fault.remedy,
            )
            for fault in error.faults
        ]
    text = f"{mission.name}: {len(mission.uavs)} UAVs, {len(mission.tasks)} tasks"
    if mission.origin is None:
        remedy = "give it [origin] with the place of your field before flying outdoors"
        found = [warns("scenario", f"{text}, and no origin", remedy)]
    else:
        found = [fine("scenario", f"{text}, D = {mission.horizon_s:g} s")]
    for warning in height_warnings(mission, layers_over(mission.terrain)):
        problem, _, remedy = warning.partition(": ")
        found.append(warns("height", problem, remedy))
    found += check_field(mission)
    return mission, found


_SOON_S = 7 * 86_400.0
"""Certificates that expire sooner deserve a word."""

_OPEN_TO_OTHERS = 0o077


def read_keys(
    folder: Path, mission: str | None, now_s: float
) -> tuple[Identity | None, list[CheckFinding]]:
    """The identity in a folder, if it can be flown with, and what there is to say of it."""
    try:
        identity = load_identity(folder, mission=mission, now_s=now_s)
    except InputError as error:
        return None, [
            fails("keys", f"{fault.source}: {fault.problem}", fault.remedy)
            for fault in error.faults
        ]
    return identity, [check_identity(identity, now_s), check_folder(folder, folder.stat().st_mode)]


def check_identity(identity: Identity, now_s: float) -> CheckFinding:
    """Whose they are, and for how long."""
    whose = f"those of {identity.common_name}, {identity.role} of {identity.mission}"
    text = f"{whose}, valid until {shown_time(identity.not_after_s)}"
    if identity.not_after_s - now_s < _SOON_S:
        remedy = "issue new ones before they expire: swarm keys renew, or swarm keys add"
        return warns("keys", text, remedy)
    return fine("keys", text)


def check_folder(folder: Path, mode: int) -> CheckFinding:
    """Whether others can look into the folder."""
    if mode & _OPEN_TO_OTHERS:
        text = f"others may look into {folder} (mode {mode & 0o777:04o})"
        return warns("key folder", text, f"close it: chmod 700 {folder}")
    return fine("key folder", f"{folder} is closed to others")


def check_roster(identity: Identity, uavs: Sequence[str], now_s: float) -> CheckFinding:
    """Who belongs to the mission, by the newest roster in the folder; ``uavs`` are to."""
    entries = identity.roster.entries
    counts = {role: sum(entry.role is role for entry in entries) for role in Role}
    told = ", ".join(f"{count} {role}" for role, count in counts.items() if count)
    text = f"version {identity.roster.version}: {told}"
    known = {entry.name for entry in entries if entry.role is Role.UAV}
    if missing := [uav for uav in uavs if uav not in known]:
        remedy = "make keys for them: swarm keys add"
        return fails("roster", f"{text}; without {', '.join(missing)} of the scenario", remedy)
    if late := [entry.name for entry in entries if entry.not_after_s < now_s]:
        remedy = "issue new ones: swarm keys add, or swarm keys renew for all"
        return warns("roster", f"{text}; keys of {', '.join(late)} have expired", remedy)
    return fine("roster", text)
