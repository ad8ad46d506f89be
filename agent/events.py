"""What the agent's core hears and what it wants done; the shell translates both."""

from __future__ import annotations

from dataclasses import dataclass

from agent.vehicle import Orders, Report
from swarm.events import BusFact, Wish

__all__ = ["Action", "Event", "Order"]


@dataclass(frozen=True, slots=True)
class Order:
    """Command the vehicle."""

    order: Orders


Event = BusFact | Report
Action = Wish | Order
