"""Keys of the links to the autopilots: one per UAV, made from a pass phrase.

Ground stations take a pass phrase and send its SHA-256 to the autopilot as the key
(SETUP_SIGNING), so a key is made in the same way here: the operator enters the phrase there,
the agent reads the key. The table of all phrases stays in the authority's folder. Leaves
out: signing itself (agent.mavlink.signing).

Sources: MAVProxy's and Mission Planner's handling of pass phrases;
https://mavlink.io/en/guide/message_signing.html
"""

from __future__ import annotations

import csv
import hashlib
import io
import secrets
import string
from collections.abc import Mapping

__all__ = ["decode_table", "encode_table", "mavlink_key", "new_phrase"]

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
