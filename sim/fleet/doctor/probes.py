"""Reads what the checks judge: clocks, limits, sockets, files of this machine."""

from __future__ import annotations

import contextlib
import ctypes
import errno
import os
import shutil
import socket
import stat
import tempfile
from collections.abc import Iterator
from pathlib import Path

import swarm
from sim.fleet.doctor.finding import CheckFinding
from sim.fleet.doctor.host import ClockReading, ResourceLimits, StateFolder, check_port
from swarm.runtime.clock import SystemClock, unix_s

_SLEPT_S = 0.02
_TIMEX_BYTES = 512
"""More than any system's `struct timex`."""
_TIMEX_MAX_ERROR_AT = 3 * ctypes.sizeof(ctypes.c_long)
"""Of `long maxerror` [µs]: behind modes, offset and freq (adjtimex(2))."""
_TIME_ERROR = 5
"""Answer of adjtimex(2): the clock is not synchronised."""
_TIMESYNCD = Path("/run/systemd/timesync/synchronized")


def read_clock() -> ClockReading:
    """What the clocks tell; waits a moment to see them run."""
    clock = SystemClock()
    before_s = clock.now_s()
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as nobody:
        # Nothing is ever sent there: the wait is the kernel's.
        nobody.bind(("127.0.0.1", 0))
        nobody.settimeout(_SLEPT_S)
        with contextlib.suppress(TimeoutError):
            nobody.recv(1)
    synchronised, max_error_s = _synchronised()
    return ClockReading(
        unix_s=unix_s(),
        released_unix_s=Path(swarm.__file__).stat().st_mtime,
        synchronised=synchronised,
        max_error_s=max_error_s,
        monotonic_s=clock.now_s() - before_s,
        slept_s=_SLEPT_S,
    )


def _synchronised() -> tuple[bool | None, float | None]:
    """Whether the kernel's clock is kept in time, and by how much it may be off [s]."""
    timex = ctypes.create_string_buffer(_TIMEX_BYTES)
    try:
        # With `modes` 0 it only reads, which everyone may.
        answer = ctypes.CDLL(None, use_errno=True).adjtimex(timex)
    except (AttributeError, OSError):
        return (True, None) if _TIMESYNCD.exists() else (None, None)
    if answer < 0:
        return (True, None) if _TIMESYNCD.exists() else (None, None)
    if answer == _TIME_ERROR:
        return False, None
    max_error_us = ctypes.c_long.from_buffer(timex, _TIMEX_MAX_ERROR_AT).value
    return True, max_error_us / 1e6


def read_limits() -> ResourceLimits:
    """What processes here may use."""
    try:
        import resource

        open_files = resource.getrlimit(resource.RLIMIT_NOFILE)[0]
        open_files = 10**9 if open_files == resource.RLIM_INFINITY else open_files
    except ImportError:  # not POSIX
        open_files = 10**9
    here = getattr(os, "sched_getaffinity", None)  # not on every system
    cpus = (os.cpu_count() or 1) if here is None else len(here(0))
    return ResourceLimits(cpus, open_files, _free_memory_bytes())


def _free_memory_bytes() -> float | None:
    try:
        lines = Path("/proc/meminfo").read_text(encoding="ascii").splitlines()
        return next(1024.0 * int(line.split()[1]) for line in lines if line.startswith("MemAvail"))
    except (OSError, ValueError, StopIteration):
        return None


def read_folder(path: Path) -> StateFolder:
    """Whether files can be written in that folder, or in one made there."""
    there = path
    while not there.exists() and there != there.parent:
        there = there.parent
    try:
        free_bytes = float(shutil.disk_usage(there).free)
        with tempfile.TemporaryFile(dir=there) as file:
            file.write(b"x" * 4096)
    except OSError as fault:
        return StateFolder(path, fault.strerror or str(fault), 0.0)
    return StateFolder(path, None, free_bytes)


def file_mode(path: Path) -> int:
    """Permissions of a file; 0 if there is none."""
    try:
        return stat.S_IMODE(path.stat().st_mode)
    except (OSError, ValueError):
        return 0


def look_at_port(
    what: str, place: str, host: str, port: int, *, datagrams: bool = False
) -> CheckFinding:
    """Whether a process, ``what``, could listen at ``place``, and who does if it could not."""
    problem = _listen_problem(host, port, datagrams=datagrams)
    holder = None if problem is None else _port_holder(port, datagrams=datagrams)
    return check_port(what, place, problem, holder)


def _listen_problem(host: str, port: int, *, datagrams: bool) -> str | None:
    """Why nobody can listen there; None if one can."""
    kind = socket.SOCK_DGRAM if datagrams else socket.SOCK_STREAM
    try:
        family, _, _, _, address = socket.getaddrinfo(host, port, type=kind)[0]
        with socket.socket(family, kind) as probe:
            if not datagrams:  # as servers do, or a port looks taken for a minute after its use
                probe.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
            probe.bind(address)
            if not datagrams:
                probe.listen()
    except OSError as fault:
        if fault.errno == errno.EACCES:
            return "ports below 1024 need the right to"
        return fault.strerror or str(fault)
    return None


def _port_holder(port: int, *, datagrams: bool) -> str | None:
    """Which program listens at that port, in words; None if none is seen."""
    kind = "udp" if datagrams else "tcp"
    inodes = {
        fields[9]
        for name in (kind, f"{kind}6")
        for fields in _sockets(Path("/proc/net") / name)
        if int(fields[1].rpartition(":")[2], 16) == port and (datagrams or fields[3] == "0A")
    }
    if not inodes:
        return None
    links = {f"socket:[{inode}]" for inode in inodes}
    for process in Path("/proc").glob("[0-9]*"):
        with contextlib.suppress(OSError):
            if any(str(file.readlink()) in links for file in (process / "fd").iterdir()):
                words = (process / "cmdline").read_bytes().decode(errors="replace").split("\0")
                return f"{_program(words)} (pid {process.name})"
    return "a program of another user"


def _program(words: list[str]) -> str:
    """A command line without paths, its interpreter and most arguments."""
    names = [Path(word).name for word in words if word and not word.startswith("-")]
    if len(names) > 1 and names[0].startswith("python"):
        del names[0]
    return " ".join(names[:2]) or "somebody"


def _sockets(table: Path) -> Iterator[list[str]]:
    """Rows of a table of sockets (proc(5))."""
    try:
        lines = table.read_text(encoding="ascii").splitlines()[1:]
    except OSError:
        return
    for line in lines:
        fields = line.split()
        if len(fields) > 9:
            yield fields
