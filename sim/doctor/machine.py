"""Whether the machine is fit for a flight: clock, limits, ports, files.

Every check judges values that were read elsewhere (sim.doctor.probes).
"""

from __future__ import annotations

from dataclasses import dataclass
from datetime import UTC, datetime
from pathlib import Path

from sim.doctor.finding import Finding, fails, fine, warns

__all__ = [
    "Clock",
    "Folder",
    "Limits",
    "check_clock",
    "check_key",
    "check_limits",
    "check_port",
    "check_state",
]

_LONGEST_AGE_S = 20 * 365.25 * 86_400.0
_SKEW_S = 1.0
"""Between clocks of a fleet, up to which no UAV loses its task by it."""
_FILES_AT_ALL = 128
_FILES_PER_UAV = 8
"""Pipes of its agent and autopilot in the launcher (6), and its link in a mesh."""
_MEMORY_PER_UAV_BYTES = 100e6
"""Of an agent (46 MB) and a simulated autopilot (42 MB), shares of common pages included, as
measured with 10 UAVs on Python 3.11, and a little more."""
_UAVS_PER_CPU = 50
_LEAST_FREE_BYTES = 50e6


@dataclass(frozen=True, slots=True)
class Clock:
    """What the machine's clocks tell."""

    unix_s: float
    """Wall time."""
    released_unix_s: float
    """When the program was installed: wall time is later."""
    synchronised: bool | None
    """Whether it is kept in time by others; None if that cannot be told."""
    max_error_s: float | None
    """By how much it may be off, as far as the system knows."""
    monotonic_s: float
    """How far the monotonic clock went in `slept_s`."""
    slept_s: float


def check_clock(clock: Clock) -> Finding:
    """Whether the date can be, the clock is kept in time, and time passes."""
    if not 0.5 <= clock.monotonic_s / clock.slept_s <= 10.0:
        text = f"went {clock.monotonic_s:.3f} s in {clock.slept_s:g} s"
        return fails("clock", f"the monotonic clock {text}", "restart the machine")
    date = datetime.fromtimestamp(clock.unix_s, UTC)
    shown = f"{date:%Y-%m-%d %H:%M:%S} UTC"
    age_s = clock.unix_s - clock.released_unix_s
    if not -86_400.0 <= age_s <= _LONGEST_AGE_S:
        return fails("clock", f"{shown} cannot be", "set it: timedatectl set-ntp true")
    if clock.synchronised is None:
        text = f"{shown}; whether it is kept in time cannot be told here"
        remedy = "make sure that all machines of the fleet agree within 1 s"
        return warns("clock", text, remedy)
    if not clock.synchronised:
        remedy = "let NTP keep it in time: timedatectl set-ntp true, or chrony; machines of a fleet"
        return warns("clock", f"{shown}, not synchronised", f"{remedy} shall agree within 1 s")
    if clock.max_error_s is not None and clock.max_error_s > _SKEW_S:
        text = f"{shown}, synchronised, but may be off by {clock.max_error_s:.1f} s"
        return warns("clock", text, "look at the time servers: timedatectl timesync-status")
    return fine("clock", f"{shown}, synchronised")


@dataclass(frozen=True, slots=True)
class Limits:
    """What processes of this machine may use."""

    cpus: int
    open_files: int
    memory_bytes: float | None
    """Free memory; None if that cannot be told."""


def check_limits(limits: Limits, uavs: int) -> list[Finding]:
    """Whether agents and simulated autopilots of that many UAVs can run here together."""
    findings = []
    fleet = f"{uavs} UAV{'s'[: uavs - 1]}"
    wanted = _FILES_AT_ALL + _FILES_PER_UAV * uavs
    if limits.open_files < wanted:
        text = f"{limits.open_files} open files are too few for {fleet} on this machine"
        findings.append(fails("open files", text, f"raise the limit: ulimit -n {wanted}"))
    else:
        findings.append(fine("open files", f"{limits.open_files} allowed, enough for {fleet}"))
    cpus = f"{limits.cpus} processor{'s'[: limits.cpus - 1]}"
    if uavs > _UAVS_PER_CPU * limits.cpus:
        remedy = "fly at a lower --speedup, or spread agents over machines"
        findings.append(warns("processors", f"{cpus} are few for {fleet}", remedy))
    else:
        findings.append(fine("processors", f"{cpus} for {fleet}"))
    if limits.memory_bytes is not None:
        free_gb = f"{limits.memory_bytes / 1e9:.1f} GB free"
        wanted_gb = f"{_MEMORY_PER_UAV_BYTES * uavs / 1e9:.1f} GB"
        if limits.memory_bytes < _MEMORY_PER_UAV_BYTES * uavs:
            text = f"{free_gb}; {fleet} with simulated autopilots take {wanted_gb}"
            remedy = "fly fewer UAVs here, or close other programs"
            findings.append(warns("memory", text, remedy))
        else:
            findings.append(fine("memory", f"{free_gb}, {wanted_gb} for {fleet}"))
    return findings


def check_port(what: str, place: str, problem: str | None, holder: str | None) -> Finding:
    """Whether a process could listen at ``place``.

    Args:
        what: is going to listen.
        place: address and port.
        problem: why nobody can; None if one can.
        holder: who listens there, as far as that can be told.
    """
    if problem is None:
        return fine(what, f"{place} is free")
    if holder is not None:
        return fails(what, f"{place} is taken by {holder}", "end that, or choose another port")
    remedy = "choose another port, or an address of this machine (see ip address)"
    return fails(what, f"{place} cannot be listened at: {problem}", remedy)


@dataclass(frozen=True, slots=True)
class Folder:
    """A folder for what processes remember."""

    path: Path
    problem: str | None
    """Why nothing can be written there; None if it can."""
    free_bytes: float


def check_state(folder: Folder) -> Finding:
    """Whether processes can keep their memory there."""
    if folder.problem is not None:
        text = f"{folder.path} cannot be written: {folder.problem}"
        remedy = f"make it: sudo install -d -o $USER {folder.path}, or name another"
        return fails("state", text, remedy)
    free = f"{folder.free_bytes / 1e6:.0f} MB free"
    if folder.free_bytes < _LEAST_FREE_BYTES:
        return warns("state", f"{folder.path} is writable, {free}", "make room on that disk")
    return fine("state", f"{folder.path} is writable, {free}")


def check_key(path: Path, problem: str | None, mode: int) -> Finding:
    """Whether a signing key can be used, and nobody else reads it.

    Args:
        path: of its file.
        problem: what keeps it from being used; None if nothing does.
        mode: permissions of the file.
    """
    if problem is not None:
        what, _, remedy = problem.partition("; ")
        return fails("signing key", what, remedy or "give a signing key's file")
    if mode & 0o077:
        text = f"{path} can be read by others (mode {mode & 0o777:04o})"
        return warns("signing key", text, f"close it: chmod 600 {path}")
    return fine("signing key", f"{path} holds a key, for its owner alone")
