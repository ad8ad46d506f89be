"""Rows of studies that nobody flew: values, counts and times of the right kind."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from sim.study.trial import BOUND, COLUMNS, TrialRow

_WORTH = {"central": 1.0, "guided": 1.02, "greedy": 0.8}


def without_wall_times(row: TrialRow) -> TrialRow:
    """What of ``row`` is the same in every run of the same study."""
    cleared: dict[str, Any] = {name: None for name in COLUMNS if name.endswith("_wall_s")}
    return replace(row, **cleared)


def study_rows(
    policies: Sequence[str],
    varied: Mapping[str, Sequence[float]] | None = None,
    *,
    trials: int,
) -> list[TrialRow]:
    """The study's own setting, then the others; in order of point, policy and trial."""
    settings: list[tuple[str, float | None]] = [("", None)]
    settings += [(name, at) for name, values in (varied or {}).items() for at in values]
    rng = np.random.default_rng(5)
    rows: list[TrialRow] = []
    for point, (vary, at) in enumerate(settings):
        luck = rng.uniform(900.0, 1100.0, trials).tolist()
        rows += [TrialRow(point, vary, at, n, BOUND, 1.1 * each) for n, each in enumerate(luck)]
        for policy in policies:
            rows += [_row(point, vary, at, n, policy, each, rng) for n, each in enumerate(luck)]
    return rows


def _row(
    point: int,
    vary: str,
    at: float | None,
    trial: int,
    policy: str,
    luck: float,
    rng: np.random.Generator,
) -> TrialRow:
    wall_s = float(rng.lognormal(-6.0, 0.3))
    return TrialRow(
        point=point,
        vary=vary,
        at=at,
        trial=trial,
        policy=policy,
        value=luck * _WORTH.get(policy, 0.9) * float(rng.normal(1.0, 0.002)),
        done=9,
        failed=0,
        missed=int(rng.integers(2)),
        duplicate_visits=int(rng.integers(3)),
        makespan_s=float(rng.uniform(300.0, 400.0)),
        lost_uavs=1,
        epochs=1,
        moved=int(rng.integers(5)),
        released=int(rng.integers(2)),
        messages=0,
        decisions=12,
        decision_median_wall_s=wall_s,
        decision_p99_wall_s=3.0 * wall_s,
        decision_max_wall_s=5.0 * wall_s,
    )
