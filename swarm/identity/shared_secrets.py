"""Secrets that two sides share: passwords of the routers' door, keys of the MAVLink links.

By the door password a router refuses who is not in its roster. The key of a link to an
autopilot is one per UAV, made from a pass phrase.
"""

from __future__ import annotations

import csv
import hashlib
import hmac
import io
import secrets
import string
from collections.abc import Mapping

from swarm.identity.roster import Roster

DOOR_SECRET_BYTES = 32


def door_password(door_secret: bytes, common_name: str) -> str:
    """What ``common_name`` says at the door; 64 hexadecimal digits."""
    return hmac.new(door_secret, common_name.encode(), hashlib.sha256).hexdigest()


def door_dictionary(roster: Roster, door_secret: bytes) -> dict[str, str]:
    """Password by common name of everyone in ``roster``."""
    names = [entry.common_name for entry in roster.entries]
    return {name: door_password(door_secret, name) for name in names}


_COLUMNS = ["uav", "pass_phrase", "key"]
_LETTERS = string.ascii_letters + string.digits
_PHRASE_LETTERS = 32


def new_phrase() -> str:
    """A pass phrase that nobody guesses: 190 random bits."""
    return "".join(secrets.choice(_LETTERS) for _ in range(_PHRASE_LETTERS))


def mavlink_key(phrase: str) -> str:
    """The key that ground stations make of ``phrase``; 64 hexadecimal digits."""
    return hashlib.sha256(phrase.encode("ascii")).hexdigest()


def encode_table(phrases: Mapping[str, str]) -> bytes:
    """Phrases by UAV as CSV, with the keys they make."""
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow(_COLUMNS)
    for uav, phrase in sorted(phrases.items()):
        writer.writerow([uav, phrase, mavlink_key(phrase)])
    return text.getvalue().encode("ascii")


def decode_table(data: bytes) -> dict[str, str]:
    """Phrases by UAV.

    Raises:
        ValueError: it is no such table.
    """
    rows = list(csv.reader(io.StringIO(data.decode("ascii", "replace"))))
    if not rows or rows[0] != _COLUMNS or any(len(row) != len(_COLUMNS) for row in rows):
        raise ValueError(f"it is no table with the columns {', '.join(_COLUMNS)}")
    return {uav: phrase for uav, phrase, _ in rows[1:]}
