"""Who may land at a base: slots are claimed like tasks."""

from __future__ import annotations

import itertools
import random

from swarm.protocol.bases import arrival_order, blocking, may_land
from swarm.protocol.uav_messages import BaseStage, Claim, ClaimPhase

B = "b0"


def at_base(
    stage: BaseStage,
    arrives_s: float = 0.0,
    *,
    phase: ClaimPhase = ClaimPhase.HELD,
    rank: int = 0,
    base: str = B,
) -> Claim:
    return Claim(phase, None, 0.0, rank, 99.0, base=base, stage=stage, arrives_s=arrives_s)


COMING = at_base(BaseStage.APPROACHING)
LANDED = at_base(BaseStage.LANDED)
PARKED = at_base(BaseStage.PARKED)


def lands(claims: dict[str, Claim], *, slots: int | None = 1, waited: bool = False) -> bool:
    return may_land("u0", B, slots, claims, {}, waited=waited)


def test_who_is_alone_on_a_base_lands_at_once() -> None:
    assert lands({"u0": COMING})
    assert lands({"u0": COMING, "u1": at_base(BaseStage.LANDED, base="b1"), "u2": PARKED})
    assert lands({"u0": COMING, "u1": LANDED}, slots=2)


def test_a_claim_that_is_only_proposed_lands_nobody_at_once() -> None:
    proposal = at_base(BaseStage.APPROACHING, phase=ClaimPhase.PROPOSED)

    assert not lands({"u0": proposal})
    assert lands({"u0": proposal}, waited=True)


def test_who_finds_others_on_their_way_waits_and_then_lands_by_arrival() -> None:
    mine = at_base(BaseStage.WAITING, 10.0)

    assert not lands({"u0": mine, "u1": COMING})
    assert lands({"u0": mine, "u1": COMING}, waited=True)
    assert not lands({"u0": mine, "u1": at_base(BaseStage.WAITING, 9.0)}, waited=True)
    assert lands({"u0": mine, "u1": at_base(BaseStage.WAITING, 11.0)}, waited=True)
    assert not lands({"u0": mine, "u1": LANDED}, waited=True)


def test_of_two_that_arrive_together_rank_decides_and_then_the_id() -> None:
    mine = at_base(BaseStage.WAITING, 10.0, rank=1)

    assert not lands({"u0": mine, "u1": at_base(BaseStage.WAITING, 10.0, rank=0)}, waited=True)
    assert lands({"u0": mine, "u1": at_base(BaseStage.WAITING, 10.0, rank=1)}, waited=True)


def test_a_base_without_a_limit_takes_everybody() -> None:
    assert lands({"u0": COMING, "u1": LANDED, "u2": COMING}, slots=None)


def test_who_has_claimed_another_base_may_not_land() -> None:
    assert not lands({"u0": at_base(BaseStage.APPROACHING, base="b1")}, waited=True)
    assert not lands({}, waited=True)


def test_the_lost_keep_the_slot_they_stand_on_until_they_are_said_to_be_ready() -> None:
    claims = {"u0": COMING, "u1": LANDED, "u2": COMING, "u3": PARKED}
    lost = {"u1", "u2", "u3"}

    assert blocking(claims, lost) == {"u1": B}
    assert blocking(claims, lost, ready={"u1"}) == {}
    assert not may_land("u0", B, 1, {"u0": COMING}, blocking(claims, lost), waited=True)
    assert may_land("u0", B, 2, {"u0": COMING}, blocking(claims, lost), waited=False)


def test_of_those_who_come_when_they_said_no_more_land_at_once_than_there_are_slots() -> None:
    """And the first of them need not wait, whoever else is on its way."""
    rng = random.Random(2)
    for slots, _ in itertools.product((1, 2, 3), range(200)):
        claims = {
            f"u{i}": at_base(
                BaseStage.APPROACHING, float(rng.randint(0, 3)), rank=rng.randint(0, 2)
            )
            for i in range(rng.randint(1, 6))
        }
        landing = [
            uav
            for uav in claims
            if may_land(uav, B, slots, claims, {}, waited=False, punctual=True)
        ]
        assert len(landing) == min(len(claims), slots)
        arrivals = sorted(claims, key=lambda uav: arrival_order(uav, claims[uav]))
        assert set(landing) == set(arrivals[:slots])


def test_wherever_all_know_the_same_no_more_land_than_there_are_slots() -> None:
    """Whatever stage each is in, all who may land now fit beside those who stand there."""
    rng = random.Random(1)
    stages = (BaseStage.APPROACHING, BaseStage.WAITING, BaseStage.LANDED, BaseStage.PARKED)
    n_landing = 0
    for slots, _ in itertools.product((1, 2, 3), range(300)):
        claims = {
            f"u{i}": at_base(rng.choice(stages), float(rng.randint(0, 3)), rank=rng.randint(0, 2))
            for i in range(rng.randint(1, 6))
        }
        standing = sum(claim.stage is BaseStage.LANDED for claim in claims.values())
        if standing > slots:
            continue
        waiting = [uav for uav, claim in claims.items() if claim.stage is BaseStage.WAITING]
        landing = [uav for uav in waiting if may_land(uav, B, slots, claims, {}, waited=True)]
        assert len(landing) == min(len(waiting), slots - standing)
        n_landing += len(landing)
    assert n_landing > 0
