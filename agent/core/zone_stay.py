"""How long a UAV has waited in a zone that has been drawn over it, and where it would leave that.

Leaves out: which air leads there (agent.core.fleet_air).
"""

from __future__ import annotations

import math

from agent.core.mission_view import MissionView
from swarm.model import UavId
from swarm.protocol.fields import Point
from swarm.protocol.operator_commands import zones_in_force
from swarm.protocol.registers import Replica
from swarm.separation.slabs import POSITION_ERROR_M


class ZoneStay:
    """Of the UAV of one agent, ``uav``."""

    def __init__(self, uav: str, replica: Replica, mission_view: MissionView) -> None:
        self._uav = uav
        self._replica = replica
        self._mission_view = mission_view
        self._waits: tuple[tuple[float, float], float] | None = None
        """Where it waits in a zone, seen from above [m], and since when [s]."""
        self._out_from: object = None
        """From which place, by which problem, the way out was looked for last."""
        self._out_m: Point | None = None
        """What was found."""

    def lasts_s(self, waits_at_enu_m: Point) -> float:
        """How long it has waited there in a zone, whatever it wished first [s]; 0 outside."""
        here, now_s = waits_at_enu_m[:2], self._mission_view.now_s
        if self.out_m() is None:
            self._waits = None
            return 0.0
        if self._waits is None or self._waits[0] != here:
            self._waits = here, now_s
        return now_s - self._waits[1]

    def out_m(self) -> Point | None:
        """The nearest place outside of a zone that has been drawn over it [m]; None: it is in none.

        Beside one it may seem in by chance.
        """
        problem, place = self._mission_view.board.field_problem, self._mission_view.place_enu_m
        if not zones_in_force(self._replica) or problem is None or problem.network is None:
            return None
        if place is None or UavId(self._uav) not in problem.uav_ids:
            return None
        if self._out_from != (place, problem):
            row = problem.uav_ids.index(UavId(self._uav))
            self._out_from, self._out_m = (place, problem), problem.network.way_out_m(row, place)
        out_m = self._out_m
        beside = out_m is None or math.dist(place[:2], out_m[:2]) <= POSITION_ERROR_M
        return None if beside else out_m
