"""Bytes and text of the files people give, with one clear line when there is none.

Leaves out: what the text means.
"""

from __future__ import annotations

from pathlib import Path

from swarm.errors import Fault, InputError
from swarm.scenario.findings import printable

__all__ = ["LARGEST_FILE_BYTES", "decode", "read_bytes"]

LARGEST_FILE_BYTES = 16 * 2**20
"""Larger files are refused unread: no mission needs them, and they take minutes."""


def read_bytes(path: Path, what: str) -> bytes:
    """The content of the file ``path``, cut just above `LARGEST_FILE_BYTES`.

    Raises:
        InputError: it cannot be read; the remedy asks for a readable ``what``.
    """
    try:
        with path.open("rb") as file:
            return file.read(LARGEST_FILE_BYTES + 1)
    except (OSError, ValueError) as error:
        reason = error.strerror if isinstance(error, OSError) else None
        problem = f"cannot be read: {reason or error}"
        fault = Fault(printable(str(path)), "", problem, f"give a readable {what}")
        raise InputError(fault) from error


def decode(data: bytes, source: str, what: str) -> str:
    """``data`` as text in UTF-8, with or without a byte order mark.

    Raises:
        InputError: it is no such text, or larger than `LARGEST_FILE_BYTES`.
    """
    if len(data) > LARGEST_FILE_BYTES:
        problem = f"is larger than {LARGEST_FILE_BYTES // 2**20} MiB"
        raise InputError(Fault(source, "", problem, f"give a smaller {what}"))
    try:
        return data.decode("utf-8-sig")
    except UnicodeDecodeError as error:
        line = data.count(b"\n", 0, error.start) + 1
        column = error.start - data.rfind(b"\n", 0, error.start)
        problem = f"byte 0x{data[error.start]:02x} is not UTF-8"
        place = f"line {line}, column {column}"
        raise InputError(Fault(source, place, problem, "save the file as UTF-8")) from error
