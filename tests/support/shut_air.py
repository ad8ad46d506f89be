"""One agent in air that it shares with another one, which takes whatever a test says."""

from __future__ import annotations

from dataclasses import replace

from agent.core.interface import GoTo
from swarm.protocol.fields import Point
from swarm.protocol.messages import TaskEntry
from swarm.protocol.uav_messages import Claim, ClaimedWay, ClaimPhase
from tests.support.field_agent import FAR_BASE, FieldAgent
from tests.support.lone_agent import orders

FAR_AWAY = ((-900.0, 0.0, 10.0),)
SOON_S = 1.1
"""It looks for air again by then."""


class Fleet:
    """The agent of ``u0``, which keeps the air round its start, and ``u1``, who flies there."""

    def __init__(self, *entries: TaskEntry) -> None:
        self.agent = FieldAgent("u1", bases=[FAR_BASE])
        self.agent.brief = replace(self.agent.brief, separation_m=5.0, band_m=(8.0, 12.0))
        self.agent.fly_to(*entries)
        self.other_flies(*FAR_AWAY)
        self.agent.be_at((0.0, 0.0, 10.0), None)
        self.agent.start_mission()

    def other_flies(self, *path: Point) -> None:
        """The other one is on its way along ``path``."""
        way = ClaimedWay(0, path, flies=True)
        self.agent.hear("u1", Claim(ClaimPhase.IDLE, None, 0.0, 1, 0.0, way=way))

    def flights(self, since: int) -> list[GoTo]:
        """Where it was sent since it had been ordered so often."""
        return [order for order in orders(self.agent.log)[since:] if isinstance(order, GoTo)]
