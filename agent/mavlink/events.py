"""What the bridge hears beside orders, and what it wants done beside reports."""

from __future__ import annotations

from collections.abc import Hashable
from dataclasses import dataclass

from agent.vehicle import Orders, Report

__all__ = ["Action", "Event", "LinkDown", "LinkUp", "Received", "Send", "Tick"]


@dataclass(frozen=True, slots=True)
class Received:
    """Bytes came from the link."""

    data: bytes
    source: Hashable | None = None
    """Who sent them, on a link to which anybody can send; None where there is one other end."""


@dataclass(frozen=True, slots=True)
class Tick:
    """Time has passed."""


@dataclass(frozen=True, slots=True)
class LinkUp:
    """The link is open, for the first time or again."""


@dataclass(frozen=True, slots=True)
class LinkDown:
    """The link is closed."""


@dataclass(frozen=True, slots=True)
class Send:
    """Send these bytes."""

    data: bytes


Event = Received | Tick | LinkUp | LinkDown | Orders
Action = Send | Report
