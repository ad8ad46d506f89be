"""How much of a mission's areas is covered, and since when, while their lines are flown."""

from __future__ import annotations

from collections.abc import Collection, Iterable
from dataclasses import dataclass

import numpy as np

from swarm.allocation.problem import FloatArray
from swarm.model import Mission, TaskId
from swarm.survey.coverage import AreaCoverage


@dataclass(frozen=True, slots=True)
class FlownLine:
    """One line of an area, flown to its end."""

    task: TaskId
    begin_s: float
    """When it was entered [s mission time]."""
    end_s: float
    """When it was done [s mission time]."""


class SurveyedGround:
    """All that is to be covered in a mission, as one piece."""

    def __init__(self, mission: Mission) -> None:
        self._areas = [
            AreaCoverage(area, mission.tasks, mission.zones, mission.zone_margin_m)
            for area in mission.areas
        ]
        self._size_m2 = np.array([area.to_cover_m2 for area in self._areas])

    def share(self, flown: Collection[TaskId]) -> float:
        """How much of it those lines cover; within 0..1, 1 where there is nothing to cover."""
        if not self._size_m2.any():
            return 1.0
        shares = np.array([area.share(flown) for area in self._areas])
        return float(shares @ self._size_m2 / self._size_m2.sum())


@dataclass(frozen=True, slots=True, eq=False)
class CoverageCurve:
    """Coverage over time: what a line adds to those that end before it grows while it is flown.

    So the curve has its exact value whenever all lines that were begun have ended, and a line that
    is never ended adds nothing. Rows are in the order of ends.
    """

    begin_s: FloatArray
    """(n,) when a line was entered [s]."""
    end_s: FloatArray
    """(n,) and when it ended [s]."""
    share: FloatArray
    """(n,) what it and all that ended before cover."""

    @classmethod
    def of(cls, ground: SurveyedGround, lines: Iterable[FlownLine]) -> CoverageCurve:
        """That of lines, each flown once."""
        rows = sorted(lines, key=lambda line: (line.end_s, line.task))
        flown = [line.task for line in rows]
        return cls(
            np.array([line.begin_s for line in rows], dtype=np.float64),
            np.array([line.end_s for line in rows], dtype=np.float64),
            np.array([ground.share(flown[: n + 1]) for n in range(len(flown))], dtype=np.float64),
        )

    @property
    def covered(self) -> float:
        """What all lines cover."""
        return float(self.share[-1]) if len(self.share) else 0.0

    @property
    def makespan_s(self) -> float:
        """When the last line ended [s]; 0 without lines."""
        return float(self.end_s[-1]) if len(self.end_s) else 0.0

    def at(self, times_s: FloatArray) -> FloatArray:
        """(k,) coverage at (k,) mission times [s]."""
        took_s = np.maximum(self.end_s - self.begin_s, 1e-9)
        flown = np.clip((times_s[:, None] - self.begin_s) / took_s, 0.0, 1.0)
        return np.asarray(flown @ self._added)

    def mean(self, until_s: float) -> float:
        """The mean over the time from 0 to ``until_s``, by when all lines must have ended."""
        if until_s < self.makespan_s:
            raise ValueError(f"until_s must be >= {self.makespan_s} s, not {until_s}")
        middle_s = (self.begin_s + self.end_s) / 2.0
        return float(self._added @ (1.0 - middle_s / until_s)) if until_s > 0.0 else self.covered

    def reached_s(self, share: float) -> float | None:
        """The end of the line with which as much is covered [s]; None if it never is."""
        enough = np.flatnonzero(self.share >= share)
        return float(self.end_s[enough[0]]) if len(enough) else None

    @property
    def _added(self) -> FloatArray:
        return np.diff(self.share, prepend=0.0)
