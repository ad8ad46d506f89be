"""Bugs put in on purpose are found by random schedules, within few seeds."""

from __future__ import annotations

import pytest

from sim.faults.case import FIRST_IN_FIELD
from sim.faults.planted_bugs import BUGS, FIELD_BUGS
from sim.faults.schedule import DisturbanceKind
from sim.faults.soak import first_breach

SEEDS = range(200)
"""Without a bug, these break nothing (test_schedules); with one, fewer than 30 did."""
IN_FIELD = range(FIRST_IN_FIELD, FIRST_IN_FIELD + 30)
"""The same of the field (test_field_schedules); fewer than 4 did."""


@pytest.mark.parametrize("bug", sorted(BUGS))
def test_a_deliberate_bug_is_found(bug: str) -> None:
    seeds = IN_FIELD if bug in FIELD_BUGS else SEEDS

    breach = first_breach(seeds, tuple(DisturbanceKind), bug)

    assert breach is not None
