"""Pieces of input that a vehicle's link may carry: forged, spoilt, repeated and mere noise.

Leaves out: when they come, and what else happens (tests.support.bridge_fuzz).
"""

from __future__ import annotations

import math
import struct
from collections.abc import Callable
from pathlib import Path
from random import Random
from typing import Any, ClassVar

from pymavlink.dialects.v20 import ardupilotmega as mavlink

from agent.vehicle.codec import _CONVERTERS
from tests.support.bridge_flight import ORIGIN
from tests.support.fake_copter import (
    ARM,
    ASK,
    INTERVAL,
    REPOSITION,
    SET_MODE,
    SPEED,
    TAKEOFF,
    FakeCopter,
)
from tests.support.fake_px4 import FakePx4
from tests.support.mavlink_frames import LATER_IDS, MESSAGES, crafted, frame, rebuilt, recorded

FLAVOURS: dict[str, type[FakeCopter]] = {"arducopter": FakeCopter, "px4": FakePx4}
_RECORDINGS = Path("tests/data/recordings")
_SIGNED = 1
_INTERESTING = (0, 1, 2, 3, 4, 6, 16, 0x7F, 0x80, 0xFF)
_NUMBERS = (0.0, -0.0, 1.0, -1.0, 1e-30, 1e30, math.inf, -math.inf, math.nan)


class Hostile:
    """Makes pieces of input that a vehicle's link may carry.

    Args:
        flavour: whose recordings are spoilt.
        random: decides everything.
    """

    _recorded: ClassVar[dict[str, list[bytes]]] = {}

    def __init__(self, flavour: str, random: Random) -> None:
        self._random = random
        self._fake = FLAVOURS[flavour]
        if flavour not in self._recorded:
            self._recorded[flavour] = _recorded_frames(flavour)
        self._frames = self._recorded[flavour]
        self._genuine: list[bytes] = []
        """Frames of the vehicle of this episode, for being said again."""
        makers: list[Callable[[], bytes]] = [
            self._known_message,
            self._known_message,
            self._any_message,
            self._acknowledgement,
            self._heartbeat,
            self._position,
            self._mutated,
            self._mutated,
            self._replayed,
            self._flipped,
            self._truncated,
            self._noise,
        ]
        # A few kinds at a time: some of them would end every flight before others matter.
        self._makers = [maker for maker in makers if random.random() < 0.5] or makers

    def remember(self, data: bytes) -> None:
        """A frame that the vehicle really said."""
        if len(self._genuine) >= 200:
            self._genuine[self._random.randrange(200)] = data
        else:
            self._genuine.append(data)

    def piece(self) -> bytes:
        """One piece of input: mostly a single frame, now and then several."""
        random = self._random
        count = 1 if random.random() < 0.8 else random.randrange(2, 8)
        pieces = [random.choice(self._makers)() for _ in range(count)]
        if random.random() < 0.1:
            random.shuffle(pieces)
            pieces += pieces[: random.randrange(3)]
        return b"".join(pieces)

    def _system(self) -> int:
        return self._random.choice((1, 1, 1, 1, 1, 1, 2, 0, 255, self._random.randrange(256)))

    def _component(self) -> int:
        return self._random.choice((1, 1, 1, 1, 1, 1, 0, 190, self._random.randrange(256)))

    def _crafted(self, message_id: int, payload: bytes) -> bytes:
        return crafted(message_id, payload, self._system(), self._component())

    def _known_message(self) -> bytes:
        return self._filled(self._random.choice(_KNOWN))

    def _any_message(self) -> bytes:
        return self._filled(self._random.choice(_ANY))

    def _filled(self, message_id: int) -> bytes:
        """A message of that id with every field arbitrary, extreme or plausible."""
        random = self._random
        kind = MESSAGES[message_id]
        size = kind.unpacker.size
        match random.randrange(4):
            case 0:
                payload = random.randbytes(size)
            case 1:
                payload = bytes(random.choice(_INTERESTING) for _ in range(size))
            case _:
                payload = self._typed(kind.unpacker.format)
        cut = random.randrange(1, size + 1) if random.random() < 0.1 else size
        return self._crafted(message_id, payload[:cut])

    def _typed(self, form: str) -> bytes:
        values: list[Any] = []
        for code in _codes(form):
            if code.endswith("s"):
                values.append(self._random.randbytes(int(code[:-1] or 1)))
            elif code in "fd":
                values.append(self._number())
            else:
                values.append(self._whole(code))
        return struct.pack(form, *values)

    def _number(self) -> float:
        if self._random.random() < 0.4:
            return self._random.choice(_NUMBERS)
        return self._random.uniform(-1e3, 1e3)

    def _whole(self, code: str) -> int:
        bits = 8 * struct.calcsize(f"<{code}")
        least = -(1 << bits - 1) if code.islower() else 0
        most = least + (1 << bits) - 1
        random = self._random
        if random.random() < 0.6:
            return random.choice((0, 1, 2, 3, 4, most, least, most - 1, min(255, most), 190 & most))
        return random.randint(least, most)

    def _acknowledgement(self) -> bytes:
        command = self._random.choice((SET_MODE, ARM, TAKEOFF, REPOSITION, SPEED, INTERVAL, ASK))
        result = self._random.choice((0, 0, 0, 1, 2, 3, 4, 5, 6, 9, 77))
        to = self._random.choice(((255, 191), (255, 191), (0, 0), (254, 190), (1, 1)))
        return self._frame(mavlink.MAVLink_command_ack_message(command, result, 0, 0, *to))

    def _heartbeat(self) -> bytes:
        random = self._random
        fake = self._fake
        mode = random.choice(
            (
                fake.own_mode,
                fake.own_mode,
                fake.takeoff_mode,
                fake.return_mode,
                fake.mission_mode,
                fake.pilot_mode,
                fake.boot_mode,
                random.getrandbits(32),
            )
        )
        armed = 128 if random.random() < 0.7 else 0
        autopilot = random.choice((fake.autopilot, fake.autopilot, fake.autopilot, 0, 3, 12, 8))
        kind = random.choice((2, 2, 2, 2, 1, 6, 30))
        status = random.choice((0, 1, 3, 4, 4, 4, 5, 6, 8))
        return self._frame(
            mavlink.MAVLink_heartbeat_message(kind, autopilot, 81 | armed, mode, status, 3)
        )

    def _position(self) -> bytes:
        """A place near or far, whose height above home and boot time may be absurd."""
        random = self._random
        extremes = (-(2**31), 2**31 - 1, 0)
        away = random.choice((1e-6, 1e-4, 1e-2, 1.0))
        lat, lon = (
            round((degrees + random.uniform(-away, away)) * 1e7)
            for degrees in (ORIGIN.lat_deg, ORIGIN.lon_deg)
        )
        alt = round((ORIGIN.alt_m + random.uniform(-20.0, 200.0)) * 1e3)
        relative = random.choice((alt - round(ORIGIN.alt_m * 1e3), random.choice(extremes)))
        boot = random.choice((0, 2**32 - 1, random.randrange(10**6)))
        speeds = [random.choice((0, 0, 10, -300, 32767, -32768)) for _ in range(3)]
        if random.random() < 0.1:
            lat, lon, alt = (random.choice(extremes) for _ in range(3))
        return self._frame(
            mavlink.MAVLink_global_position_int_message(boot, lat, lon, alt, relative, *speeds, 0)
        )

    def _frame(self, message: Any) -> bytes:
        return frame(message, self._system(), self._component())

    def _old(self) -> bytes:
        pool = self._genuine if self._genuine and self._random.random() < 0.5 else self._frames
        return self._random.choice(pool)

    def _replayed(self) -> bytes:
        return self._old()

    def _mutated(self) -> bytes:
        """A frame that was said, with other contents and a checksum that fits them."""
        random = self._random
        old = self._old()
        message_id = int.from_bytes(old[7:10], "little")
        payload = bytearray(old[10 : 10 + old[1]])
        for _ in range(random.randrange(1, 4)):
            place = random.randrange(len(payload))
            payload[place] = random.choice((payload[place] ^ 1 << random.randrange(8), 0, 255))
        return self._crafted(message_id, bytes(payload))

    def _flipped(self) -> bytes:
        damaged = bytearray(self._old())
        for _ in range(self._random.choice((1, 1, 2, 8))):
            damaged[self._random.randrange(len(damaged))] ^= 1 << self._random.randrange(8)
        return bytes(damaged)

    def _truncated(self) -> bytes:
        old = self._old()
        cut = self._random.randrange(len(old))
        return old[:cut] if self._random.random() < 0.7 else old[cut:]

    def _noise(self) -> bytes:
        random = self._random
        size = random.randrange(1, 40)
        match random.randrange(3):
            case 0:
                return random.randbytes(size)
            case 1:
                return bytes(random.choice((0xFD, 0xFE, 0xFF, 0x01, 0x00)) for _ in range(size))
            case _:
                return b"\xfd" + random.randbytes(9 + size)


_KNOWN = [*sorted(_CONVERTERS), mavlink.MAVLINK_MSG_ID_STATUSTEXT, *LATER_IDS]
_ANY = sorted(MESSAGES)


def _codes(form: str) -> list[str]:
    """The codes of a struct format, repetitions written out, texts in one."""
    codes: list[str] = []
    count = ""
    for char in form.lstrip("<"):
        if char.isdigit():
            count += char
        elif char == "s":
            codes.append(f"{count}s")
            count = ""
        else:
            codes += [char] * int(count or 1)
            count = ""
    return codes


def is_frame(piece: bytes) -> bool:
    """Whether that is one whole unsigned frame of a message of the dialect."""
    return (
        len(piece) >= 12
        and piece[0] == 0xFD
        and not piece[2] & _SIGNED
        and len(piece) == 12 + piece[1]
        and int.from_bytes(piece[7:10], "little") in MESSAGES
    )


def _recorded_frames(flavour: str) -> list[bytes]:
    """What the real vehicle said, as frames."""
    frames = [
        frame(rebuilt(row), row["sys"], row["comp"])
        for path in sorted(_RECORDINGS.glob(f"{flavour}-*.jsonl"))
        for row in recorded(path, "vehicle")
    ]
    if not frames:
        raise ValueError(f"no recordings of {flavour} in {_RECORDINGS}")
    return frames
