"""Random fleets under random faults of every kind: no invariant ever breaks.

`swarm soak` plays more of the same, and makes small what fails.
"""

from __future__ import annotations

import pytest

from sim.faults.case import FIRST_WITH_ACCELERATION, format_case
from sim.faults.generator import random_case
from sim.faults.schedule import PLAIN_KINDS, DisturbanceKind
from sim.faults.soak import Breach, first_breach, shrunk
from tests.support.seeds import seeds, sweeps

BLOCK = 20
QUICK, BLOCKS = 3, 15
"""Blocks of every run of the tests, and of those of the night."""


def told(breach: Breach | None) -> str:
    """What a person needs who is to mend it; empty if there is nothing to mend."""
    if breach is None:
        return ""
    small = shrunk(breach)
    return f"seed {breach.case.seed}: {small.broken}\n{format_case(small.case)}"


@pytest.mark.parametrize("block", seeds(QUICK, BLOCKS))
def test_every_kind_of_fault_is_survived(block: int) -> None:
    breach = first_breach(range(block * BLOCK, (block + 1) * BLOCK), tuple(DisturbanceKind))

    assert told(breach) == ""


@pytest.mark.parametrize("block", seeds(1, 5))
def test_every_kind_of_fault_is_survived_by_uavs_that_speed_up_slowly(block: int) -> None:
    first = FIRST_WITH_ACCELERATION + block * BLOCK
    breach = first_breach(range(first, first + BLOCK), tuple(DisturbanceKind))

    assert told(breach) == ""


@pytest.mark.parametrize("sweep", sweeps(3, 16))
@pytest.mark.parametrize("kind", PLAIN_KINDS)
def test_each_kind_alone_is_survived(kind: DisturbanceKind, sweep: range) -> None:
    breach = first_breach([100_000 + seed for seed in sweep], (kind,))

    assert told(breach) == ""


def test_the_first_seeds_hold_every_kind_of_fault() -> None:
    kinds = {each.kind for seed in range(2 * BLOCK) for each in random_case(seed).schedule}

    assert kinds == set(PLAIN_KINDS)
