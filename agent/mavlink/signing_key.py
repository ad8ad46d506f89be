"""Reads a signing key's file: 32 raw bytes, or 64 hexadecimal digits.

A file that everyone on the machine can read is refused, not warned of: each of them could
command the vehicle, a warning in a log is read after the flight, and `chmod o= FILE` mends
it. Leaves out: making keys (`swarm keys`) and giving them to vehicles.
"""

from __future__ import annotations

import os
import stat
from pathlib import Path

from agent.mavlink.signing import KEY_BYTES, SigningKey
from swarm.errors import Fault, InputError

__all__ = ["MAVLINK_KEY", "load_signing_key", "signing_key_of"]

MAVLINK_KEY = "mavlink.key"
"""A vehicle's key in the folder of its UAV, as `swarm keys` makes it."""

_LONGEST_BYTES = 4096
_HEX_DIGITS = 2 * KEY_BYTES
_REMEDY = (
    f"give a file of {KEY_BYTES} bytes or {_HEX_DIGITS} hexadecimal digits, "
    "such as (umask 077; openssl rand -hex 32 > FILE) makes"
)


def signing_key_of(uav: str, path: Path) -> Path:
    """The file with that UAV's key: ``path`` itself, or in a mission's keys the UAV's own."""
    return path / uav / MAVLINK_KEY if path.is_dir() else path


def load_signing_key(path: Path) -> SigningKey:
    """The key in that file.

    Raises:
        InputError: it cannot be read, everyone can read it, or it holds no key.
    """
    try:
        # Without waiting for the other end, should it be a pipe.
        file = os.open(path, os.O_RDONLY | getattr(os, "O_NONBLOCK", 0))
        try:
            mode = os.fstat(file).st_mode
            text = os.read(file, _LONGEST_BYTES)
        finally:
            os.close(file)
    except (OSError, ValueError) as error:
        reason = getattr(error, "strerror", None) or str(error)
        raise InputError(Fault(str(path), "", f"cannot be read ({reason})", _REMEDY)) from error
    if os.name == "posix" and mode & (stat.S_IROTH | stat.S_IWOTH):
        problem = "this key is open to everyone on this machine"
        raise InputError(Fault(str(path), "", problem, f"close it: chmod o= {path}"))
    try:
        return SigningKey(text if len(text) == KEY_BYTES else _from_hex(text))
    except ValueError as error:
        raise InputError(Fault(str(path), "", str(error), _REMEDY)) from error


def _from_hex(text: bytes) -> bytes:
    digits = text.strip()
    try:
        if len(digits) == _HEX_DIGITS:
            return bytes.fromhex(digits.decode("ascii"))
    except ValueError:
        pass
    raise ValueError(f"{len(text)} bytes that are no signing key")
