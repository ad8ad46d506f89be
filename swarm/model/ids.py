"""Identifiers of UAVs and tasks; each is one chunk of a bus key."""

from __future__ import annotations

import re
from typing import NewType

__all__ = ["COORDINATOR", "ID_RULE", "TaskId", "UavId", "require_id", "valid_id"]

UavId = NewType("UavId", str)
TaskId = NewType("TaskId", str)

COORDINATOR = "coordinator"
"""Name of the coordinator among the writers on the bus; no UAV may bear it."""

ID_RULE = "1 to 64 letters, digits, '_', '-' or '.', beginning with a letter or digit"
_PATTERN = re.compile(r"[A-Za-z0-9][A-Za-z0-9_.-]{0,63}")


def valid_id(text: str) -> bool:
    """Whether ``text`` may name a UAV, a task or a mission."""
    return _PATTERN.fullmatch(text) is not None


def require_id(text: str, what: str) -> None:
    """Raise ``ValueError`` unless ``text`` is a valid id of ``what``."""
    if not valid_id(text):
        raise ValueError(f"{what} {text!r} is not {ID_RULE}")
