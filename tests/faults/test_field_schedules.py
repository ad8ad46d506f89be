"""A fixed hundred missions with all of the field's constraints, under faults of every kind.

`swarm soak --first 2000000` plays more of them.
"""

from __future__ import annotations

import pytest

from sim.faults.case import FIRST_IN_FIELD
from sim.faults.schedule import DisturbanceKind
from sim.faults.soak import first_breach
from tests.faults.test_schedules import told

BLOCK = 5
HUNDRED = range(FIRST_IN_FIELD, FIRST_IN_FIELD + 100)
_LONG = (6, 7, 12, 18, 19, 25, 29, 37, 40, 41, 49, 50, 62, 64, 69, 76, 78, 84, 90, 91, 94)
"""Places in the hundred of those left to the night: they take 1 s each, and reach no state, end or
reason that the others do not (28 s of processor time together)."""
BY_NIGHT = [HUNDRED[place] for place in _LONG]
BY_DAY = [seed for seed in HUNDRED if seed not in BY_NIGHT]
BLOCKS = [
    pytest.param(seeds[first : first + BLOCK], marks=marks, id=str(seeds[first]))
    for seeds, marks in ((BY_DAY, ()), (BY_NIGHT, (pytest.mark.slow,)))
    for first in range(0, len(seeds), BLOCK)
]


@pytest.mark.parametrize("seeds", BLOCKS)
def test_every_kind_of_fault_is_survived_in_the_field(seeds: list[int]) -> None:
    assert told(first_breach(seeds, tuple(DisturbanceKind))) == ""
