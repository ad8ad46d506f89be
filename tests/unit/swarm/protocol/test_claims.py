"""Who keeps a task: one winner for equal registers, in the order of the rules."""

from __future__ import annotations

from random import Random

from hypothesis import given
from hypothesis import strategies as st

from swarm.protocol.board import holders, winner
from swarm.protocol.uav_messages import Claim, ClaimPhase
from tests.support.builders import IDLE, OUT, held, proposed

times_s = st.sampled_from([0.0, 1.0, 2.0])
claimed = st.builds(
    Claim,
    st.sampled_from([ClaimPhase.PROPOSED, ClaimPhase.HELD]),
    st.sampled_from(["t0", "t1"]),
    times_s,
    st.integers(0, 1),
    times_s,
)
fleets = st.dictionaries(
    st.sampled_from(["u0", "u1", "u2", "u3"]), claimed | st.sampled_from([IDLE, OUT]), max_size=4
)


@given(fleets, st.randoms(use_true_random=False))
def test_every_order_of_claims_names_the_same_winner(
    claims: dict[str, Claim], random: Random
) -> None:
    items = list(claims.items())
    random.shuffle(items)

    assert holders(dict(items)) == holders(claims)


@given(fleets)
def test_every_claimed_task_has_one_holder_who_claims_it(claims: dict[str, Claim]) -> None:
    found = holders(claims)

    assert set(found) == {claim.task for claim in claims.values() if claim.task is not None}
    assert all(claims[uav].task == task for task, uav in found.items())


@given(fleets)
def test_a_proposal_never_beats_a_held_claim(claims: dict[str, Claim]) -> None:
    for task, uav in holders(claims).items():
        rivals = [claim for claim in claims.values() if claim.task == task]
        if any(claim.phase is ClaimPhase.HELD for claim in rivals):
            assert claims[uav].phase is ClaimPhase.HELD


@given(fleets, st.sampled_from(["u0", "u1", "u2", "u3"]))
def test_a_loser_who_leaves_changes_no_winner(claims: dict[str, Claim], leaver: str) -> None:
    before = holders(claims)
    if leaver in before.values():
        return
    rest = {uav: claim for uav, claim in claims.items() if uav != leaver}

    assert holders(rest) == before


def test_held_beats_proposed_whatever_was_decided_when() -> None:
    assert winner([("u0", proposed("t", 0.0)), ("u1", held("t", 9.0, 9, 9.0))]) == "u1"


def test_the_earlier_proposal_wins_whatever_its_rank_and_completion() -> None:
    assert winner([("u0", proposed("t", 2.0, 0, 3.0)), ("u1", proposed("t", 1.0, 9, 9.0))]) == "u1"


def test_proposals_of_one_instant_go_by_rank_then_by_id() -> None:
    assert winner([("u0", proposed("t", 1.0, 1, 3.0)), ("u1", proposed("t", 1.0, 0, 9.0))]) == "u1"
    assert winner([("u1", proposed("t", 1.0, 0, 3.0)), ("u0", proposed("t", 1.0, 0, 9.0))]) == "u0"


def test_of_two_held_claims_the_earlier_completion_wins_whatever_was_decided_when() -> None:
    assert winner([("u0", held("t", 1.0, 0, 9.0)), ("u1", held("t", 2.0, 9, 8.0))]) == "u1"


def test_held_claims_of_equal_completion_go_by_rank_then_by_id() -> None:
    assert winner([("u0", held("t", 1.0, 1, 9.0)), ("u1", held("t", 2.0, 0, 9.0))]) == "u1"
    assert winner([("u1", held("t", 1.0, 0, 9.0)), ("u0", held("t", 2.0, 0, 9.0))]) == "u0"


def test_nobody_wins_what_nobody_claims() -> None:
    assert winner([]) is None
    assert holders({"u0": IDLE, "u1": OUT}) == {}
