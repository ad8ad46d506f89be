"""Files that only their owner can read: written so from their first moment on, and read.

What is wrong with a file is said in one line.
"""

from __future__ import annotations

import contextlib
import json
import os
import secrets
import shutil
import stat
from collections.abc import Callable
from pathlib import Path
from typing import Final, TypeVar

from swarm.runtime.errors import Fault, InputError

_FILE_MODE = 0o600
_FOLDER_MODE = 0o700


def make_private_folder(path: Path) -> None:
    """Make the folder ``path``; those above it must be there."""
    path.mkdir(mode=_FOLDER_MODE)
    path.chmod(_FOLDER_MODE)


def write_private(path: Path, data: bytes) -> None:
    """Make the file ``path``; it may be empty after a loss of power."""
    flags = os.O_WRONLY | os.O_CREAT | os.O_EXCL | getattr(os, "O_NOFOLLOW", 0)
    with os.fdopen(os.open(path, flags, _FILE_MODE), "wb") as file:
        os.fchmod(file.fileno(), _FILE_MODE)
        file.write(data)


def replace_private(path: Path, data: bytes) -> None:
    """Put ``data`` in the place of the file ``path``: whole or not at all."""
    draft = _beside(path)
    try:
        write_private(draft, data)
        sync(draft)
        draft.replace(path)
    except OSError:
        with contextlib.suppress(OSError):
            draft.unlink()
        raise
    sync(path.parent)


def swap_in_folder(path: Path, files: dict[str, bytes]) -> None:
    """Put a private folder with ``files`` in the place of ``path``, which need not be there.

    After a loss of power it may be the old one, or hold empty files.
    """
    draft, old = _beside(path), _beside(path)
    make_private_folder(draft)
    try:
        for name, data in files.items():
            write_private(draft / name, data)
        if path.is_dir():
            path.rename(old)
        draft.rename(path)
    except OSError:
        shutil.rmtree(draft, ignore_errors=True)
        raise
    shutil.rmtree(old, ignore_errors=True)


def _beside(path: Path) -> Path:
    """A name in the same folder that nobody else uses; no identity begins with a dot."""
    return path.with_name(f".{path.name}.{secrets.token_hex(4)}")


def sync(path: Path) -> None:
    """Have the disk keep the file or, of a folder, the names in it."""
    handle = os.open(path, os.O_RDONLY)
    try:
        os.fsync(handle)
    finally:
        os.close(handle)


T = TypeVar("T")
U = TypeVar("U")
_LONGEST_FILE_BYTES: Final = 1 << 22


def decoded(path: Path, decode: Callable[[bytes], T], remedy: str, *, secret: bool = False) -> T:
    """What ``decode`` makes of the file.

    Args:
        path: of the file.
        decode: raises ValueError, whose text may be shown, of what it cannot read.
        remedy: what to do about a file that is missing or damaged.
        secret: whether nobody else may be able to read it.

    Raises:
        InputError: it cannot be read or decoded, or is open to others.
    """
    return checked(path, decode, _read_file(path, remedy, secret=secret), remedy)


def read_private(path: Path, remedy: str) -> bytes:
    """What is in a file that nobody else may be able to read; raises as `decoded` does."""
    return _read_file(path, remedy, secret=True)


def checked(path: Path, check: Callable[[U], T], given: U, remedy: str) -> T:
    """What ``check`` makes of ``given``, which comes from the file ``path``.

    Raises:
        InputError: it raised ValueError.
    """
    try:
        return check(given)
    except (ValueError, RecursionError) as error:
        # Ours are fit to be shown; those of the standard library may quote the file.
        quotes = isinstance(error, json.JSONDecodeError | UnicodeError | RecursionError)
        problem = "is damaged" if quotes else f"is damaged: {error}"
        raise InputError(Fault(str(path), "", problem, remedy)) from None


def _read_file(path: Path, remedy: str, *, secret: bool) -> bytes:
    try:
        # Without waiting for the other end, should it be a pipe.
        with os.fdopen(os.open(path, os.O_RDONLY | os.O_NONBLOCK), "rb") as file:
            mode = os.fstat(file.fileno()).st_mode
            data = file.read(_LONGEST_FILE_BYTES) or b""
    except FileNotFoundError:
        raise InputError(Fault(str(path), "", "is missing", remedy)) from None
    except OSError as error:
        problem = f"cannot be read: {error.strerror or error}"
        open_up = "let this user read it, or run as the one who can"
        raise InputError(Fault(str(path), "", problem, open_up)) from None
    if secret and mode & (stat.S_IRWXG | stat.S_IRWXO):
        problem = f"is open to others (mode {stat.S_IMODE(mode):04o})"
        raise InputError(Fault(str(path), "", problem, f"close it: chmod 600 {path}"))
    return data
