"""Whether this computer is fit for a flight, and what is installed on it right.

Looks at clock, limits, ports and folders; at Python, packages and kernels.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from datetime import UTC, datetime
from pathlib import Path

from sim.fleet.capacity import BYTES_PER_UAV, cpu_frac
from sim.fleet.doctor.finding import CheckFinding, fails, fine, warns

_LONGEST_AGE_S = 20 * 365.25 * 86_400.0

_SKEW_S = 1.0
"""Between clocks of a fleet, up to which no UAV loses its task by it."""

_FILES_AT_ALL = 128

_FILES_PER_UAV = 8
"""Pipes of its agent and autopilot in the launcher (6), and its link in a mesh."""

_LEAST_FREE_BYTES = 50e6


@dataclass(frozen=True, slots=True)
class ClockReading:
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


def check_clock(clock: ClockReading) -> CheckFinding:
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
class ResourceLimits:
    """What processes of this machine may use."""

    cpus: int
    open_files: int
    memory_bytes: float | None
    """Free memory; None if that cannot be told."""


def check_limits(
    limits: ResourceLimits, uavs: int, *, keeps_apart: bool = False
) -> list[CheckFinding]:
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
    if uavs > limits.cpus / cpu_frac(keeps_apart=keeps_apart):
        remedy = "fly at a lower --speedup, or spread agents over machines"
        findings.append(warns("processors", f"{cpus} are few for {fleet}", remedy))
    else:
        findings.append(fine("processors", f"{cpus} for {fleet}"))
    if limits.memory_bytes is not None:
        free_gb = f"{limits.memory_bytes / 1e9:.1f} GB free"
        wanted_gb = f"{BYTES_PER_UAV * uavs / 1e9:.1f} GB"
        if limits.memory_bytes < BYTES_PER_UAV * uavs:
            text = f"{free_gb}; {fleet} with simulated autopilots take {wanted_gb}"
            remedy = "fly fewer UAVs here, or close other programs"
            findings.append(warns("memory", text, remedy))
        else:
            findings.append(fine("memory", f"{free_gb}, {wanted_gb} for {fleet}"))
    return findings


def check_port(what: str, place: str, problem: str | None, holder: str | None) -> CheckFinding:
    """Whether a process, ``what``, could listen at ``place``.

    ``problem`` is why nobody can, ``holder`` who listens there; None where there is none.
    """
    if problem is None:
        return fine(what, f"{place} is free")
    if holder is not None:
        return fails(what, f"{place} is taken by {holder}", "end that, or choose another port")
    remedy = "choose another port, or an address of this machine (see ip address)"
    return fails(what, f"{place} cannot be listened at: {problem}", remedy)


@dataclass(frozen=True, slots=True)
class StateFolder:
    """A folder for what processes remember."""

    path: Path
    problem: str | None
    """Why nothing can be written there; None if it can."""
    free_bytes: float


def check_state(folder: StateFolder) -> CheckFinding:
    """Whether processes can keep their memory there."""
    if folder.problem is not None:
        text = f"{folder.path} cannot be written: {folder.problem}"
        remedy = f"make it: sudo install -d -o $USER {folder.path}, or name another"
        return fails("state", text, remedy)
    free = f"{folder.free_bytes / 1e6:.0f} MB free"
    if folder.free_bytes < _LEAST_FREE_BYTES:
        return warns("state", f"{folder.path} is writable, {free}", "make room on that disk")
    return fine("state", f"{folder.path} is writable, {free}")


def check_key(path: Path, problem: str | None, mode: int) -> CheckFinding:
    """Whether a signing key can be used, and by its file's ``mode`` nobody else reads it."""
    if problem is not None:
        what, _, remedy = problem.partition("; ")
        return fails("signing key", what, remedy or "give a signing key's file")
    if mode & 0o077:
        text = f"{path} can be read by others (mode {mode & 0o777:04o})"
        return warns("signing key", text, f"close it: chmod 600 {path}")
    return fine("signing key", f"{path} holds a key, for its owner alone")


_REQUIREMENT = re.compile(r"([A-Za-z0-9_.-]+)(?:\[[^\]]*\])?\s*([^;]*)(;.*)?")

_NAMED = ("eclipse-zenoh", "pymavlink")
"""Packages whose versions are told: what is flown depends on them most."""

_INSTALL = "install it anew: pip install --force-reinstall peckorder"


def check_python(version: tuple[int, int, int], least: tuple[int, int]) -> CheckFinding:
    """The interpreter's version."""
    shown = ".".join(map(str, version))
    if version[:2] < least:
        wanted = ".".join(map(str, least))
        return fails("python", f"{shown} is too old", f"use Python {wanted} or newer")
    return fine("python", shown)


def check_packages(
    requirements: Sequence[str], version_of: Callable[[str], str | None]
) -> CheckFinding:
    """Whether every package that is needed is there and new enough.

    ``requirements`` are as the package's metadata names them, extras among them.
    """
    missing, old, told = [], [], []
    for text in requirements:
        match = _REQUIREMENT.fullmatch(text.strip())
        if match is None or "extra ==" in (match[3] or ""):
            continue
        name, wanted, installed = match[1], match[2].strip(), version_of(match[1])
        if installed is None:
            missing.append(name)
        elif not _satisfies(installed, wanted):
            old.append(f"{name} {installed} (needed {wanted})")
        elif name in _NAMED:
            told.append(f"{name} {installed}")
    if missing or old:
        parts = [f"{', '.join(missing)} missing"] if missing else []
        return fails("packages", "; ".join(parts + old), "install them: pip install -U peckorder")
    return fine("packages", ", ".join(told) or "all there")


def _satisfies(installed: str, wanted: str) -> bool:
    """Whether a version lies within bounds such as ``>=1.10.2,<2``; others are not judged."""
    for bound in filter(None, (part.strip() for part in wanted.split(","))):
        if bound.startswith(">=") and _numbers(installed) < _numbers(bound[2:]):
            return False
        if bound.startswith("<") and bound[1] != "=" and _numbers(installed) >= _numbers(bound[1:]):
            return False
    return True


def _numbers(version: str) -> tuple[int, ...]:
    return tuple(int(number) for number in re.findall(r"\d+", version)[:3])


def check_kernels(plan: Callable[[], Mapping[str, float]]) -> CheckFinding:
    """Whether the compiled kernels load, and by J of table-1 by method compute what they should."""
    try:
        found = plan()
    except Exception as fault:  # noqa: BLE001 - whatever is wrong with what was compiled
        problem = f"{type(fault).__name__}: {fault}"
        return fails("kernels", f"do not work ({problem})", _INSTALL)
    wrong = [
        f"{method} {found.get(method)} instead of {right}"
        for method, right in _TABLE_1.items()
        if abs(found.get(method, 0.0) - right) > 5e-5
    ]
    if wrong:
        return fails("kernels", f"compute wrongly: {', '.join(wrong)}", _INSTALL)
    return fine("kernels", "load, and plan table-1 as they should")


_TABLE_1 = {"greedy": 118.4939, "exact": 120.3335}
"""J of the plans of table-1 by method [value·s]; README."""
