"""Reads the files of keys, and says in one line what is wrong with one.

No text of a fault shows anything of a secret. Leaves out: what the files hold.
"""

from __future__ import annotations

import json
import os
import stat
from collections.abc import Callable
from pathlib import Path
from typing import Final, TypeVar

from swarm.errors import Fault, InputError

__all__ = ["checked", "decoded", "read_private"]

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
    """What is in a file that nobody else may be able to read.

    Raises:
        InputError: it cannot be read, or is open to others.
    """
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
