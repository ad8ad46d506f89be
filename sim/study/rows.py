"""What a study finds, one row for each point, trial and policy: what is stored, compared and drawn.

Leaves out: where rows are kept (sim.study.store) and what they say together
(sim.study.statistics).
"""

from __future__ import annotations

from dataclasses import dataclass, fields, replace
from typing import Any

import numpy as np

from sim.study.config import Point
from sim.study.flight import Flight, Score

__all__ = ["BOUND", "COLUMNS", "WALL_COLUMNS", "Row", "row_of", "without_wall_times"]

BOUND = "clairvoyant"
"""In place of a policy's name in rows of the bound, which have a value and nothing else."""


@dataclass(frozen=True, slots=True)
class Row:
    """What one policy made of one fate. What a bound does not have is None."""

    point: int
    """Which setting of the uncertainty: 0 for the study's own, then those that it varies to."""
    vary: str
    """The number that is varied there, such as ``loss``; empty for the study's own setting."""
    at: float | None
    """And its value; None for the study's own setting."""
    trial: int
    """From 0. Rows of one point and trial met the same fate."""
    policy: str
    value: float
    """See sim.study.flight.value_of [value·s]."""
    done: int | None = None
    failed: int | None = None
    missed: int | None = None
    duplicate_visits: int | None = None
    makespan_s: float | None = None
    """Latest end of a visit [s mission time]."""
    lost_uavs: int | None = None
    epochs: int | None = None
    moved: int | None = None
    """Tasks that re-planning moved from one UAV's list to another's, summed over all plans."""
    released: int | None = None
    """Tasks given up by a living UAV that was on its way there."""
    messages: int | None = None
    decisions: int | None = None
    """How many were made and timed."""
    decision_median_wall_s: float | None = None
    """None where nothing was decided; the wall times alone differ from run to run [s]."""
    decision_p99_wall_s: float | None = None
    decision_max_wall_s: float | None = None

    @property
    def key(self) -> tuple[int, int, str]:
        """Which row of a study it is."""
        return self.point, self.trial, self.policy


COLUMNS = tuple(field.name for field in fields(Row))
WALL_COLUMNS = tuple(name for name in COLUMNS if name.endswith("_wall_s"))
"""Differ from run to run; all others are the same for the same seed."""


def row_of(point: Point, trial: int, policy: str, scored: Score, flight: Flight) -> Row:
    """The row of a flight."""
    wall_s = np.asarray(flight.decision_s, dtype=float)
    some = wall_s.size > 0
    return Row(
        point=point.index,
        vary=point.vary,
        at=point.at,
        trial=trial,
        policy=policy,
        value=scored.value,
        done=scored.done,
        failed=scored.failed,
        missed=scored.missed,
        duplicate_visits=scored.duplicate_visits,
        makespan_s=scored.makespan_s,
        lost_uavs=scored.lost_uavs,
        epochs=flight.epochs,
        moved=flight.moved,
        released=flight.released,
        messages=flight.messages,
        decisions=int(wall_s.size),
        decision_median_wall_s=float(np.median(wall_s)) if some else None,
        decision_p99_wall_s=float(np.quantile(wall_s, 0.99)) if some else None,
        decision_max_wall_s=float(wall_s.max()) if some else None,
    )


def without_wall_times(row: Row) -> Row:
    """What of ``row`` is the same in every run of the same study."""
    cleared: dict[str, Any] = dict.fromkeys(WALL_COLUMNS)
    return replace(row, **cleared)
