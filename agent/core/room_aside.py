"""Where one UAV's vehicle may make room for others: in no zone that is in force now.

Leaves out: the ground and the vehicle's own fence, which its bridge knows (agent.vehicle).
"""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise
from typing import TYPE_CHECKING

import numpy as np

from swarm.model import Zone
from swarm.protocol.field_messages import ZoneSpec
from swarm.protocol.fields import Point
from swarm.protocol.operator_commands import zones_in_force
from swarm.protocol.registers import Replica

if TYPE_CHECKING:
    from swarm.allocation.legs.obstacles import Obstacles

_BESIDE_M = 1.0
"""So much nearer than the margin a vehicle may come, as when it is ordered to: nothing hovers
quite where it was told, and ways lead along margins."""


class RoomAside:
    """Judges ways by the zones of brief and operator, drawn and removed ones included.

    Args:
        replica: what is known.
    """

    def __init__(self, replica: Replica) -> None:
        self._replica = replica
        self._zones: tuple[ZoneSpec, ...] = ()
        self._obstacles: list[tuple[Zone, Obstacles]] = []

    def is_clear(self, path_enu_m: Sequence[Point]) -> bool:
        """Whether that path, flown corner by corner, keeps out of all zones [m]."""
        self._heed()
        for here, there in pairwise(path_enu_m):
            low_m, high_m = sorted((here[2], there[2]))
            ends_m = np.array([[here[:2]], [there[:2]]])
            for zone, obstacles in self._obstacles:
                if zone.concerns(low_m, high_m) and not obstacles.clear(*ends_m)[0]:
                    return False
        return True

    def _heed(self) -> None:
        """Take the zones that are in force now."""
        zones, brief = zones_in_force(self._replica), self._replica.brief
        if zones == self._zones:
            return
        from swarm.allocation.legs.obstacles import Obstacles  # plain missions start sooner without

        self._zones = zones
        margin_m = 0.0 if brief is None else max(0.0, brief.zone_margin_m - _BESIDE_M)
        known = [spec.zone() for spec in zones]
        self._obstacles = [(zone, Obstacles([zone], margin_m)) for zone in known]
