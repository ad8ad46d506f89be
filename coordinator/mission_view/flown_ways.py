"""Ways that UAVs say they fly: round zones, and along lines, by the problem that all decide by.

An observer hears where a UAV goes and when it is done. How it flies there follows, as everybody
finds ways alike; in a mission without the field's constraints they are straight. Leaves out: where
vehicles truly were.
"""

from __future__ import annotations

import math

from swarm.allocation import field
from swarm.model import TaskId, UavId
from swarm.protocol.fields import Point

MapPoint = tuple[float, float]
"""Place [m; east and north of the mission origin]."""


class FlownWays:
    """Of one fleet.

    Args:
        problem: as the mission stands; None of a plain one.
    """

    def __init__(self, problem: field.FieldProblem | None) -> None:
        self._problem = problem

    def to_task(self, uav: str, here_enu_m: Point, task: str, *, backwards: bool) -> list[MapPoint]:
        """Corners on the way to where a task begins, both ends left out."""
        problem, row, column = self._problem, self._row(uav), self._column(task)
        if problem is None or row is None or column is None:
            return []
        node, _ = field.task_nodes(problem, column, backwards=backwards)
        return self._corners(problem, row, here_enu_m, node)

    def to_base(self, uav: str, here_enu_m: Point, base: str) -> list[MapPoint]:
        """Likewise on the way to a base."""
        problem, row = self._problem, self._row(uav)
        if problem is None or row is None or base not in problem.base_ids:
            return []
        return self._corners(problem, row, here_enu_m, field.base_node(problem, base))

    def to_start(self, uav: str, here_enu_m: Point) -> list[MapPoint]:
        """Likewise on the way to its own start."""
        problem, row = self._problem, self._row(uav)
        if problem is None or row is None:
            return []
        return self._corners(problem, row, here_enu_m, row)  # nodes begin with the starts

    def line_s(self, uav: str, task: str, *, backwards: bool) -> float:
        """Time along a task's line [s]; 0 of a place."""
        problem, row, column = self._problem, self._row(uav), self._column(task)
        if problem is None or row is None or column is None:
            return 0.0
        line_s = float(problem.line_s[problem.kind[row], column, int(backwards)])
        return line_s if math.isfinite(line_s) else 0.0

    def _corners(
        self, problem: field.FieldProblem, row: int, here_enu_m: Point, node: int
    ) -> list[MapPoint]:
        way = field.way_to(problem, row, here_enu_m, node)
        return [] if way is None else [corner[:2] for corner in way.via_enu_m]

    def _row(self, uav: str) -> int | None:
        known = () if self._problem is None else self._problem.uav_ids
        return known.index(UavId(uav)) if uav in known else None

    def _column(self, task: str) -> int | None:
        known = () if self._problem is None else self._problem.task_ids
        return known.index(TaskId(task)) if task in known else None
