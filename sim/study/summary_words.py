"""Figures and names of a study as text, the same in tables and plots.

Leaves out: putting them anywhere (sim.study.summary_tables, sim.study.study_plot).
"""

from __future__ import annotations

import math
from collections.abc import Sequence

from sim.study.rows import BOUND
from sim.study.statistics import Estimate
from sim.study.summary import Setting, Summary

__all__ = [
    "IDEAL",
    "NONE",
    "interval_text",
    "number_text",
    "policy_label",
    "spread_text",
    "trials_text",
]

IDEAL = "†"
"""Behind the names of policies that are modelled with ideal communication only."""
NONE = "–"
_DECIMALS = 2


def interval_text(estimate: Estimate | None) -> str:
    """A ratio as ``0.981 [0.977, 0.985]``; a dash for none."""
    if estimate is None or math.isnan(estimate.value):
        return NONE
    digits = _digits(estimate)
    value, low, high = (_end(x, digits) for x in (estimate.value, estimate.low, estimate.high))
    return value if estimate.low == estimate.high else f"{value} [{low}, {high}]"


def spread_text(estimate: Estimate | None) -> str:
    """A ratio as ``0.981 ± 0.004``: the further end of its interval on both sides."""
    if estimate is None or math.isnan(estimate.value):
        return NONE
    digits, half = _digits(estimate), estimate.half_width
    return f"{_end(estimate.value, digits)} ± {_end(half, digits) if half else 0}"


def number_text(value: float, decimals: int = _DECIMALS) -> str:
    """With three digits or all before the point, and at most so many decimals."""
    if value == 0.0 or (value.is_integer() and decimals == _DECIMALS):
        return f"{value:,.0f}"
    digits = min(decimals, max(0, 2 - math.floor(math.log10(abs(value)))))
    return f"{value:,.{digits}f}"


def policy_label(summary: Summary, policy: str) -> str:
    """Its name, and what is special about it."""
    if policy == BOUND:
        return f"{policy} (bound)"
    return f"{policy} {IDEAL}" if policy in summary.about.ideal else policy


def trials_text(settings: Sequence[Setting]) -> str:
    """How many trials these have, one or more settings."""
    counts = [each.trials for each in settings]
    least, most = min(counts), max(counts)
    noun = "trial" if most == 1 else "trials"
    return f"{most} {noun}" if least == most else f"{least} to {most} {noun}"


def _digits(estimate: Estimate) -> int:
    """Decimals that suit an interval."""
    return 4 if 0.00005 <= estimate.half_width < 0.001 else 3


def _end(value: float, digits: int) -> str:
    if math.isinf(value):
        return "∞" if value > 0.0 else "−∞"
    return f"{value:.{digits}f}"
