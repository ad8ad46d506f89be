"""Identifiers of UAVs, tasks, bases, zones and areas; each is one chunk of a bus key."""

from __future__ import annotations

import re
from collections.abc import Mapping
from types import MappingProxyType
from typing import Final, NewType

UavId = NewType("UavId", str)
TaskId = NewType("TaskId", str)
BaseId = NewType("BaseId", str)
ZoneId = NewType("ZoneId", str)
AreaId = NewType("AreaId", str)

AUTHORITY = "authority"
"""Name of the mission authority among the writers on the bus; it signs the roster."""
COORDINATOR = "coordinator"
"""Name of the coordinator among the writers on the bus."""
OPERATOR = "operator"
"""Name of the operator among the writers on the bus, whatever machine a command comes from."""
FLEET = "fleet"
"""Target of a command that concerns every UAV."""
RESERVED: Final[Mapping[str, str]] = MappingProxyType(
    {
        AUTHORITY: "the mission authority",
        COORDINATOR: "the coordinator",
        OPERATOR: "the operator",
        FLEET: "the whole fleet",
    }
)
"""Names that no UAV may bear, and what they stand for on the bus."""

ID_RULE = "1 to 64 letters, digits, '_', '-' or '.', beginning with a letter or digit"
_PATTERN = re.compile(r"[A-Za-z0-9][A-Za-z0-9_.-]{0,63}")


def valid_id(text: str) -> bool:
    """Whether ``text`` may name a UAV, a task or a mission."""
    return _PATTERN.fullmatch(text) is not None


def require_id(text: str, what: str) -> None:
    """Raise ``ValueError`` unless ``text`` is a valid id of ``what``."""
    if not valid_id(text):
        raise ValueError(f"{what} {text!r} is not {ID_RULE}")
