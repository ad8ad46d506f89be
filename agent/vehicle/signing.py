"""MAVLink 2 signing of one link: reads the key, signs what we say, judges what is said to us.

Who holds the key can speak, nobody else; what was said once cannot be said again. A stream is
what one component says over one link of its own; its timestamps only grow. Of a stream not
heard before, a timestamp may be up to a minute behind ours. As in the reference implementations
that rule is for the first frame of a stream only: an autopilot without a clock advances its
timestamps by what it hears from us, so one that does not hear us falls behind without being any
less genuine. Our own timestamps follow wall time and are newer than any genuine one heard, the
vehicle's included: so they go on even after a restart with a clock that was set back.

A key file that everyone on the machine can read is refused, not warned of: each of them could
command the vehicle, and a warning in a log is read after the flight. Leaves out: making keys
(`swarm keys`), giving one to a vehicle (SETUP_SIGNING, which ground stations send) and secrecy:
signed frames can be read by all.

Source: https://mavlink.io/en/guide/message_signing.html
"""

from __future__ import annotations

import hashlib
import hmac
import os
import stat
from collections.abc import Callable
from dataclasses import dataclass, field
from enum import StrEnum
from pathlib import Path

from pymavlink.dialects.v20 import ardupilotmega as mavlink

from swarm.runtime.errors import Fault, InputError

KEY_BYTES = 32

SIGNATURE_BYTES = 13
"""Link id, timestamp and the signature proper."""

SIGNED = 0x01
"""MAVLINK_IFLAG_SIGNED."""

LINK_ID = 200
"""Ours, unless told otherwise. Ground stations count theirs from 0, and one that shares our
system and component id must not share our stream."""


_HASH_BYTES = 6

_STAMP_BYTES = 6

_NEWEST_STAMP = 2**48 - 1

_STAMPS_PER_S = 1e5

_EPOCH_UNIX_S = 1_420_070_400.0
"""2015-01-01 00:00 GMT."""

_LATE_STAMPS = 6_000_000
"""One minute."""

_MOST_STREAMS = 256
"""Streams remembered; who has the key and speaks for more components is not believed."""

_START_V2 = 0xFD

_FLAGS_AT = 2

_SYSTEM_AT = 5

_COMPONENT_AT = 6


@dataclass(frozen=True, slots=True)
class SigningKey:
    """The secret that both ends of a link share; its text does not show it.

    Raises:
        ValueError: it is not 32 bytes, or all of them are zero, which means "no signing".
    """

    secret: bytes = field(repr=False)

    def __post_init__(self) -> None:
        if len(self.secret) != KEY_BYTES:
            raise ValueError(f"a signing key has {KEY_BYTES} bytes, not {len(self.secret)}")
        if not any(self.secret):
            raise ValueError("a signing key of zeros means no signing at all")


class SignatureVerdict(StrEnum):
    """What came of a frame; all but the first mean that it is dropped."""

    BELIEVED = "believed"
    UNSIGNED = "unsigned"
    WRONG = "wrongly signed"
    REPLAYED = "replayed"
    """Its stream has been heard with that timestamp or a newer one."""
    LATE = "signed long ago"
    """The first frame of its stream, and more than a minute old."""
    CROWD = "signed for too many"


class Signing:
    """One link's end that has a key.

    Args:
        key: shared with the vehicle.
        unix_s: wall time [s since 1970]; it may be wrong and may jump.
        link_id: distinguishes the links over which one component speaks; 0..255.
    """

    def __init__(
        self, key: SigningKey, unix_s: Callable[[], float], *, link_id: int = LINK_ID
    ) -> None:
        self._key = key
        self._unix_s = unix_s
        self._link_id = link_id.to_bytes(1)
        self._newest = 0
        """Of our own timestamps and the genuine ones heard."""
        self._streams: dict[tuple[int, int, int], int] = {}
        """Newest timestamp by system, component and link id."""

    def sign(self, frame: bytes, crc_extra: int) -> bytes:
        """The unsigned MAVLink 2 ``frame`` of a message with that CRC_EXTRA, signed."""
        signed = bytearray(frame[:-2])
        signed[_FLAGS_AT] |= SIGNED
        crc: int = mavlink.x25crc(signed[1:] + bytes([crc_extra])).crc
        self._newest = min(max(self._newest + 1, self._wall_stamp()), _NEWEST_STAMP)
        signed += crc.to_bytes(2, "little")
        signed += self._link_id + self._newest.to_bytes(_STAMP_BYTES, "little")
        return bytes(signed) + self._hash(signed)

    def judge(self, frame: bytes) -> SignatureVerdict:
        """Whether to believe ``frame``, whose checksum is right; remembers it if so."""
        if frame[0] != _START_V2 or not frame[_FLAGS_AT] & SIGNED:
            # Telemetry radios put in their own reports and know no key.
            radio = _message_id(frame) == mavlink.MAVLINK_MSG_ID_RADIO_STATUS
            return SignatureVerdict.BELIEVED if radio else SignatureVerdict.UNSIGNED
        if not hmac.compare_digest(frame[-_HASH_BYTES:], self._hash(frame[:-_HASH_BYTES])):
            return SignatureVerdict.WRONG
        stamp = int.from_bytes(frame[-_HASH_BYTES - _STAMP_BYTES : -_HASH_BYTES], "little")
        stream = (frame[_SYSTEM_AT], frame[_COMPONENT_AT], frame[-SIGNATURE_BYTES])
        newest = self._streams.get(stream)
        if newest is None:
            if stamp + _LATE_STAMPS < max(self._newest, self._wall_stamp()):
                return SignatureVerdict.LATE
            if len(self._streams) >= _MOST_STREAMS:
                return SignatureVerdict.CROWD
        elif stamp <= newest:
            return SignatureVerdict.REPLAYED
        self._streams[stream] = stamp
        self._newest = max(self._newest, stamp)
        return SignatureVerdict.BELIEVED

    def _hash(self, frame: bytes | bytearray) -> bytes:
        return hashlib.sha256(self._key.secret + frame).digest()[:_HASH_BYTES]

    def _wall_stamp(self) -> int:
        return min(max(int((self._unix_s() - _EPOCH_UNIX_S) * _STAMPS_PER_S), 0), _NEWEST_STAMP)


def _message_id(frame: bytes) -> int:
    return int.from_bytes(frame[7:10], "little") if frame[0] == _START_V2 else frame[5]


MAVLINK_KEY = "mavlink.key"
"""A vehicle's key in the folder of its UAV, as `swarm keys` makes it."""


_LONGEST_BYTES = 4096

_HEX_DIGITS = 2 * KEY_BYTES

_KEY_REMEDY = (
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
        raise InputError(Fault(str(path), "", f"cannot be read ({reason})", _KEY_REMEDY)) from error
    if os.name == "posix" and mode & (stat.S_IROTH | stat.S_IWOTH):
        problem = "this key is open to everyone on this machine"
        raise InputError(Fault(str(path), "", problem, f"close it: chmod o= {path}"))
    try:
        return SigningKey(text if len(text) == KEY_BYTES else _from_hex(text))
    except ValueError as error:
        raise InputError(Fault(str(path), "", str(error), _KEY_REMEDY)) from error


def _from_hex(text: bytes) -> bytes:
    digits = text.strip()
    try:
        if len(digits) == _HEX_DIGITS:
            return bytes.fromhex(digits.decode("ascii"))
    except ValueError:
        pass
    raise ValueError(f"{len(text)} bytes that are no signing key")
