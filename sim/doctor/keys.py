"""Whether keys are fit to fly with: whole, closed to others, in force, and not about to expire.

Leaves out: what is wrong with keys that cannot be used (swarm.identity says it), and whether
the routers let them in (sim.doctor.bus).
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from sim.doctor.finding import Finding, fails, fine, warns
from swarm.errors import InputError
from swarm.identity import Identity, Role, load_identity
from swarm.identity.folder import shown_time

__all__ = ["check_folder", "check_identity", "check_roster", "read_keys"]

_SOON_S = 7 * 86_400.0
"""Certificates that expire sooner deserve a word."""
_OPEN_TO_OTHERS = 0o077


def read_keys(
    folder: Path, mission: str | None, now_s: float
) -> tuple[Identity | None, list[Finding]]:
    """The identity in a folder, if it can be flown with, and what there is to say of it.

    Args:
        folder: that `swarm keys` made.
        mission: that it has to be for; None for any.
        now_s: wall time [unix s].
    """
    try:
        identity = load_identity(folder, mission=mission, now_s=now_s)
    except InputError as error:
        return None, [
            fails("keys", f"{fault.source}: {fault.problem}", fault.remedy)
            for fault in error.faults
        ]
    return identity, [
        check_identity(identity, now_s),
        check_folder(folder, folder.stat().st_mode),
    ]


def check_identity(identity: Identity, now_s: float) -> Finding:
    """Whose they are, and for how long."""
    whose = f"those of {identity.common_name}, {identity.role} of {identity.mission}"
    text = f"{whose}, valid until {shown_time(identity.not_after_s)}"
    if identity.not_after_s - now_s < _SOON_S:
        remedy = "issue new ones before they expire: swarm keys renew, or swarm keys add"
        return warns("keys", text, remedy)
    return fine("keys", text)


def check_folder(folder: Path, mode: int) -> Finding:
    """Whether others can look into the folder."""
    if mode & _OPEN_TO_OTHERS:
        text = f"others may look into {folder} (mode {mode & 0o777:04o})"
        return warns("key folder", text, f"close it: chmod 700 {folder}")
    return fine("key folder", f"{folder} is closed to others")


def check_roster(identity: Identity, uavs: Sequence[str], now_s: float) -> Finding:
    """Who belongs to the mission, by the newest roster in the folder.

    Args:
        identity: whose folder it is.
        uavs: of the scenario; empty without one.
        now_s: wall time [unix s].
    """
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
