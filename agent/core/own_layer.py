"""The height layer of one UAV's own: what lies in it, and where it is above a place.

In its layer a UAV is as high above the place that it visits as the brief says, wherever that is. At
a task that asks for a height of its own it is not, nor where it was stopped on a slant to one:
whatever leads on from there, in any layer, leaves the layer of the brief out of its reckoning.
And nobody is led lower than everything that is visited, whatever it was reckoned from.
"""

from __future__ import annotations

from collections.abc import Iterable
from typing import Final

from agent.core.mission_view import MissionView
from swarm.protocol.fields import Point
from swarm.protocol.messages import MissionConfig
from swarm.protocol.registers import Replica

_SLACK_M: Final = 2.0
"""A vehicle that stops is so far beside where it tells that it is, and its word some time old."""


class OwnLayer:
    """Of the agent that knows ``replica`` and ``mission_view``."""

    def __init__(self, replica: Replica, mission_view: MissionView) -> None:
        self._replica = replica
        self._mission_view = mission_view
        self._heights_of: object = None
        """Brief and tasks of which the heights are."""
        self._heights_m = 0.0, 0.0, 0.0

    def above(self, place_enu_m: Point) -> Point:
        """Above that place or below it, in the own layer [m]."""
        east_m, north_m, up_m = place_enu_m
        me, brief = self._mission_view.me, self._replica.brief
        if me is None or brief is None:
            return place_enu_m
        up_m = me.layer_m
        if brief.terrain is not None:
            from swarm.allocation.legs.ground import ground_of

            up_m += ground_of(brief.terrain.terrain()).one_up_m(east_m, north_m)
        return east_m, north_m, up_m

    def misses(self, place_enu_m: Point) -> bool:
        """Whether nothing that is visited lies so high or low that its layer is there [m].

        Over hills nobody can tell: what lies between two places is higher above some ground.
        """
        me, brief = self._mission_view.me, self._replica.brief
        if me is None or brief is None or brief.terrain is not None:
            return False
        low_m, high_m, _ = self._visited_m(brief)
        return not low_m - _SLACK_M <= place_enu_m[2] - me.layer_m <= high_m + _SLACK_M

    def is_over(self, path_enu_m: Iterable[Point]) -> bool:
        """Whether no corner of a way is lower than all that is visited [m]; over hills likewise.

        Tasks that ask for a height of their own may ask for one below the ground of all others.
        """
        brief = self._replica.brief
        if brief is None or brief.terrain is not None:
            return True
        least_m = self._visited_m(brief)[2]
        return all(up_m >= least_m - _SLACK_M for *_, up_m in path_enu_m)

    def _visited_m(self, brief: MissionConfig) -> tuple[float, float, float]:
        """The lowest and the highest place without layers, and the lowest that is flown to [m]."""
        known = brief, self._replica.board_version
        if self._heights_of != known:
            up_m = [uav.position_enu_m[2] for uav in brief.uavs]
            up_m += [base.position_enu_m[2] for base in brief.bases]
            for task in self._replica.board.values():
                up_m += [place[2] for place in (task.position_enu_m, *task.path_enu_m)]
            own_m = [task.height_m for task in self._replica.board.values()]
            least_m = min([*up_m, *(height_m for height_m in own_m if height_m is not None)])
            self._heights_of, self._heights_m = known, (min(up_m), max(up_m), least_m)
        return self._heights_m
