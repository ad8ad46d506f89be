"""Protocol bugs put in on purpose are found by random schedules, within few seeds."""

from __future__ import annotations

import pytest

from sim.faults.planted_bugs import BUGS
from sim.faults.schedule import DisturbanceKind
from sim.faults.soak import first_breach

SEEDS = range(200)
"""Without a bug, these break nothing (test_schedules); with one, fewer than 30 did."""


@pytest.mark.parametrize("bug", sorted(BUGS))
def test_a_deliberate_bug_is_found(bug: str) -> None:
    breach = first_breach(SEEDS, tuple(DisturbanceKind), bug)

    assert breach is not None
