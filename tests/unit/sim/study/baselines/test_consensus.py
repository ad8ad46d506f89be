"""Table I of the paper, entry by entry: UAV 0 hears UAV 1 about one task; 2 and 3 are others."""

from __future__ import annotations

import numpy as np
import pytest

from sim.study.baselines.cbba import NO_BID, NOBODY, Beliefs, update_beliefs

ME, SENDER, M, N = 0, 1, 2, 3
LEAVE, UPDATE, RESET = "leave", "update", "reset"
LOWER, HIGHER = 3.0, 7.0


def outcome(
    theirs: int, mine: int, *, their_bid: float, newer: tuple[int, ...] = (), now: int = 9
) -> str:
    """What hearing does; the sender's news are newer about some and else older."""
    beliefs, said = Beliefs.blank(4, 1), Beliefs.blank(4, 1)
    my_bid = 5.0
    beliefs.winner[ME, 0], beliefs.bid[ME, 0] = mine, NO_BID if mine == NOBODY else my_bid
    said.winner[SENDER, 0] = theirs
    said.bid[SENDER, 0] = NO_BID if theirs == NOBODY else their_bid
    beliefs.heard[ME] = 4
    said.heard[SENDER] = [8 if uav in newer else 2 for uav in range(4)]
    before = (int(beliefs.winner[ME, 0]), float(beliefs.bid[ME, 0]))
    update_beliefs(beliefs, said, SENDER, np.array([ME]), now)
    after = (int(beliefs.winner[ME, 0]), float(beliefs.bid[ME, 0]))
    assert beliefs.heard[ME, SENDER] == now
    assert all(beliefs.heard[ME, u] == (8 if u in newer else 4) for u in (M, N))
    if after == before:
        return LEAVE
    if after == (NOBODY, NO_BID):
        return UPDATE if theirs == NOBODY else RESET
    assert after == (theirs, float(said.bid[SENDER, 0]))
    return UPDATE


@pytest.mark.parametrize(
    ("theirs", "mine", "their_bid", "newer", "expected"),
    [
        (SENDER, ME, HIGHER, (), UPDATE),
        (SENDER, ME, LOWER, (), LEAVE),
        (SENDER, SENDER, LOWER, (), UPDATE),
        (SENDER, M, LOWER, (M,), UPDATE),
        (SENDER, M, HIGHER, (), UPDATE),
        (SENDER, M, LOWER, (), LEAVE),
        (SENDER, NOBODY, LOWER, (), UPDATE),
        (ME, ME, HIGHER, (), LEAVE),
        (ME, SENDER, HIGHER, (), RESET),
        (ME, M, HIGHER, (M,), RESET),
        (ME, M, HIGHER, (), LEAVE),
        (ME, NOBODY, HIGHER, (), LEAVE),
        (M, ME, HIGHER, (M,), UPDATE),
        (M, ME, HIGHER, (), LEAVE),
        (M, ME, LOWER, (M,), LEAVE),
        (M, SENDER, LOWER, (M,), UPDATE),
        (M, SENDER, HIGHER, (), RESET),
        (M, M, LOWER, (M,), UPDATE),
        (M, M, HIGHER, (), LEAVE),
        (M, N, LOWER, (M, N), UPDATE),
        (M, N, HIGHER, (M,), UPDATE),
        (M, N, LOWER, (M,), LEAVE),
        (M, N, HIGHER, (N,), RESET),
        (M, N, HIGHER, (), LEAVE),
        (M, NOBODY, LOWER, (M,), UPDATE),
        (M, NOBODY, HIGHER, (), LEAVE),
        (NOBODY, ME, 0.0, (), LEAVE),
        (NOBODY, SENDER, 0.0, (), UPDATE),
        (NOBODY, M, 0.0, (M,), UPDATE),
        (NOBODY, M, 0.0, (), LEAVE),
        (NOBODY, NOBODY, 0.0, (), LEAVE),
    ],
)
def test_action_rules(
    theirs: int, mine: int, their_bid: float, newer: tuple[int, ...], expected: str
) -> None:
    assert outcome(theirs, mine, their_bid=their_bid, newer=newer) == expected


def test_equal_bids_go_to_the_smaller_index() -> None:
    assert outcome(SENDER, ME, their_bid=5.0) == LEAVE
    assert outcome(SENDER, M, their_bid=5.0) == UPDATE
