"""The runs of this user on this machine, which commands find without being told where.

`swarm run` chooses its endpoints anew each time. It tells them in a file of its own in a folder
that this user alone can read and write, ``$XDG_RUNTIME_DIR/peckorder`` or ``peckorder-UID`` where
temporary files go, and takes the file back when it ends. A file whose process has died is removed
by who comes next; one of somebody else, or that others could have written, is not read. Keys are
named there, never told: whoever cannot read their folder has none.
"""

from __future__ import annotations

import contextlib
import os
import stat
import tempfile
from collections.abc import Iterator
from dataclasses import asdict, dataclass
from json import dumps
from pathlib import Path

from swarm.protocol.timing import LinkKind

_LONGEST = 1 << 16
"""Bytes of a file: 1000 endpoints have room."""


@dataclass(frozen=True, slots=True)
class LocalRun:
    """How to reach one run of this machine."""

    pid: int
    """Of the process that started it."""
    begun: int | None
    """When that process began, by the kernel's count: another one may get its number later."""
    mission: str
    mesh: bool
    """Whether its processes are peers; else they are clients of routers."""
    endpoints: tuple[str, ...]
    """Of all peers, or of the routers."""
    link: LinkKind
    """What kind of link its processes were told they have."""
    viewer_keys: str | None = None
    """The folder of keys of who looks on; None where it has no keys."""
    operator_keys: str | None = None
    """The folder of keys of who steps in."""
    unencrypted: bool = False
    """Whether it talks in the clear beyond this machine."""

    def __str__(self) -> str:
        return f"{self.mission} (pid {self.pid})"


@contextlib.contextmanager
def announced(run: LocalRun) -> Iterator[str | None]:
    """Let others find ``run`` as long as the context lasts; gives why they cannot, if so."""
    try:
        folder = _folder()
        folder.mkdir(mode=0o700, parents=True, exist_ok=True)
        if (fault := _distrust(folder)) is not None:
            yield f"{folder} {fault}"
            return
        file = folder / f"{run.pid}.json"
        _write(file, run)
    except OSError as error:
        yield f"{error.filename}: {error.strerror}"
        return
    try:
        yield None
    finally:
        with contextlib.suppress(OSError):
            file.unlink()


def local_runs() -> list[LocalRun]:
    """Runs of this user that are on, by mission and number."""
    folder = _folder()
    try:
        if _distrust(folder) is not None:
            return []
        files = sorted(folder.glob("*.json"))
    except OSError:
        return []
    runs = []
    for file in files:
        run = _read(file)
        if run is None:
            continue
        if run.begun == begun(run.pid) and _lives(run.pid):
            runs.append(run)
        else:
            with contextlib.suppress(OSError):
                file.unlink()
    return sorted(runs, key=lambda run: (run.mission, run.pid))


def begun(pid: int) -> int | None:
    """When that process began, by the kernel's count; None where nothing tells."""
    try:
        told = Path(f"/proc/{pid}/stat").read_bytes()
    except OSError:
        return None
    # The second field is the program's name, in which anything may stand.
    return int(told.rpartition(b")")[2].split()[19])


def _folder() -> Path:
    own = os.environ.get("XDG_RUNTIME_DIR")
    if own and Path(own).is_dir():
        return Path(own) / "peckorder"
    return Path(tempfile.gettempdir()) / f"peckorder-{os.getuid()}"


def _distrust(folder: Path) -> str | None:
    """Why what lies in ``folder`` is not to be believed; None if it is.

    Raises:
        OSError: it is not there, or cannot be looked at.
    """
    found = folder.lstat()
    if not stat.S_ISDIR(found.st_mode):
        return "is no folder"
    return _not_private(found)


def _not_private(found: os.stat_result) -> str | None:
    if found.st_uid != os.getuid():
        return "belongs to somebody else"
    return "is open to others" if found.st_mode & 0o077 else None


def _write(file: Path, run: LocalRun) -> None:
    """The whole file at once, readable by this user alone."""
    handle, name = tempfile.mkstemp(dir=file.parent)  # made with mode 0600
    with os.fdopen(handle, "w", encoding="utf-8") as new:
        new.write(dumps(asdict(run)))
    Path(name).rename(file)


def _read(file: Path) -> LocalRun | None:
    """What ``file`` tells; None if it is not this user's own, or tells nothing of the kind.

    What a later release tells besides is passed over.
    """
    from pydantic import TypeAdapter

    try:
        handle = os.open(file, os.O_RDONLY | os.O_NOFOLLOW | os.O_NONBLOCK)
    except OSError:
        return None
    with os.fdopen(handle, "rb") as opened:
        found = os.fstat(opened.fileno())
        if not stat.S_ISREG(found.st_mode) or _not_private(found) is not None:
            return None
        try:
            return TypeAdapter(LocalRun).validate_json(opened.read(_LONGEST), strict=True)
        except (ValueError, OSError):
            return None


def _lives(pid: int) -> bool:
    try:
        os.kill(pid, 0)
    except PermissionError:
        return True
    except (OSError, OverflowError):
        return False
    return True
