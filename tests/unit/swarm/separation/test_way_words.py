"""What a word about a way tells beyond another: what all are to know, and what can wait."""

from __future__ import annotations

from dataclasses import replace

from swarm.protocol.uav_messages import Claim, ClaimedWay, ClaimPhase
from swarm.separation.way_words import adds_nothing, ends_like, grants_alone

HERE, CORNER, END = (0.0, 0.0, 30.0), (50.0, 0.0, 30.0), (50.0, 50.0, 30.0)


def hovers(number: int, **grants: int) -> Claim:
    way = ClaimedWay(number, (HERE,), flies=True, grants=grants)
    return Claim(ClaimPhase.IDLE, None, 0.0, 0, 0.0, way=way)


def test_grants_are_told_to_those_whom_they_concern_and_all_else_to_everybody() -> None:
    said = ClaimedWay(1, ((0.0, 0.0, 30.0),), flies=True, grants={"u1": 1, "u2": 2})

    assert adds_nothing(said, said)
    assert adds_nothing(replace(said), said)
    assert adds_nothing(replace(said, grants={"u2": 2}), said)
    assert adds_nothing(replace(said, grants={"u1": 1, "u2": 3}), said)
    assert adds_nothing(None, None)
    for more in (
        replace(said, grants={"u2": 2}, number=2),
        replace(said, flies=False),
        replace(said, keeps=(0,)),
        None,
    ):
        assert not adds_nothing(more, said)


def test_that_a_granted_way_is_flown_or_has_ended_can_wait() -> None:
    said = ClaimedWay(1, (HERE, CORNER, END))
    flown = replace(said, flies=True)

    assert ends_like(flown, said)
    assert ends_like(replace(flown, grants={"u1": 4}), said)
    assert ends_like(replace(flown, path_enu_m=(END,)), said)
    assert ends_like(replace(flown, path_enu_m=(CORNER, END)), flown)
    for other in (
        replace(flown, path_enu_m=(CORNER,)),
        replace(flown, path_enu_m=(HERE, END)),
        replace(flown, path_enu_m=()),
        replace(flown, number=2),
        replace(flown, grounded=True),
        replace(flown, keeps=(1,)),
        replace(flown, heir="u1"),
    ):
        assert not ends_like(other, said)
    assert not ends_like(said, flown)


def test_words_of_grants_alone_concern_those_who_were_granted_something() -> None:
    before = hovers(3, u1=1)
    now = hovers(3, u1=1, u2=5)

    assert grants_alone("u1", now, before)
    assert not grants_alone("u2", now, before)
    assert grants_alone("u1", before, before)
    assert not grants_alone("u1", replace(now, phase=ClaimPhase.OUT), before)
    assert not grants_alone("u1", replace(now, decided_s=1.0), before)
    assert not grants_alone("u1", hovers(4, u1=1), before)
    assert not grants_alone("u1", replace(now, way=None), before)
