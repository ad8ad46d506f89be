"""Who keeps air, and what is granted: never two ways that meet, whoever knows what."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from swarm.protocol.uav_messages import Claim, ClaimedWay, ClaimPhase
from swarm.separation.shared_air import SharedAir, Starter
from swarm.separation.slabs import Slabs, apart

SLABS = Slabs(10.0, (30.0, 42.0))
FLEET = [Starter(f"u{k}", (100.0 * k, 0.0, 30.0)) for k in range(3)]
AIR = SharedAir(SLABS, FLEET)
ALL = {"u0", "u1", "u2"}


def claim(way: ClaimedWay, decided_s: float = 0.0, phase: ClaimPhase = ClaimPhase.IDLE) -> Claim:
    return Claim(phase, None, decided_s, 0, 0.0, way=way)


def asks(number: int, *path: tuple[float, float, float]) -> ClaimedWay:
    return ClaimedWay(number, path)


def home(heir: str | None = None, **grants: int) -> Claim:
    way = ClaimedWay(9, (), grounded=True, grants=grants, heir=heir)
    return claim(way, phase=ClaimPhase.OUT)


def test_a_free_way_is_granted_by_the_keeper_of_its_layer_alone() -> None:
    claims = {"u2": claim(asks(1, (200.0, 0.0, 30.0), (200.0, 50.0, 30.0)))}
    assert AIR.keeper(0, claims, ()) == "u0"
    assert AIR.granted("u0", claims, {}, ALL, ()) == {"u2": 1}
    assert AIR.granted("u1", claims, {}, ALL, ()) == {}
    assert not AIR.is_granted("u2", claims, {}, ())
    told = {**claims, "u0": claim(ClaimedWay(0, ((0.0, 0.0, 30.0),), True, grants={"u2": 1}))}
    assert AIR.is_granted("u2", told, {}, ())


def test_a_way_over_somebody_who_hovers_waits_until_that_one_has_left() -> None:
    claims = {"u2": claim(asks(1, (200.0, 0.0, 30.0), (50.0, 0.0, 30.0)))}
    assert AIR.granted("u0", claims, {}, ALL, ()) == {}  # u1 hovers at its start on the way
    claims["u1"] = claim(ClaimedWay(1, ((100.0, 50.0, 30.0),), flies=True))
    assert AIR.granted("u0", claims, {}, ALL, ()) == {"u2": 1}


def test_of_two_ways_that_meet_the_one_of_who_waits_longer_is_granted() -> None:
    claims = {
        "u1": claim(asks(1, (100.0, 0.0, 30.0), (200.0, 100.0, 30.0)), decided_s=5.0),
        "u2": claim(asks(1, (200.0, 0.0, 30.0), (100.0, 100.0, 30.0)), decided_s=3.0),
    }
    assert AIR.granted("u0", claims, {}, ALL, ()) == {"u2": 1}


def test_what_is_granted_stays_taken_until_its_uav_asks_for_something_else() -> None:
    crossing = asks(1, (100.0, 0.0, 30.0), (200.0, 100.0, 30.0))
    claims = {"u1": claim(crossing, 5.0), "u2": claim(asks(1, (200.0, 0.0, 30.0)), 9.0)}
    before = AIR.granted("u0", claims, {}, ALL, ())
    claims["u2"] = claim(asks(2, (200.0, 0.0, 30.0), (100.0, 100.0, 30.0)), 3.0)
    assert AIR.granted("u0", claims, before, ALL, ()) == {"u1": 1}
    claims["u1"] = claim(ClaimedWay(2, ((100.0, 0.0, 30.0),), flies=True))
    assert AIR.granted("u0", claims, before, ALL, ()) == {"u2": 2}


def test_who_leaves_where_it_is_in_the_way_of_a_stronger_one_need_not_wait_for_it() -> None:
    claims = {
        "u1": claim(asks(1, (100.0, 0.0, 30.0), (100.0, -50.0, 30.0)), decided_s=5.0),
        "u2": claim(asks(1, (200.0, 0.0, 30.0), (50.0, 0.0, 30.0)), decided_s=1.0),
    }
    assert AIR.granted("u0", claims, {}, ALL, ()) == {"u1": 1}


def test_a_keeper_that_knows_less_than_it_granted_grants_nothing() -> None:
    claims = {"u2": claim(asks(1, (200.0, 0.0, 30.0), (200.0, 50.0, 30.0)))}
    assert AIR.granted("u0", claims, {"u1": 4}, ALL, ()) == {"u1": 4}


def test_the_air_of_who_is_home_falls_to_its_heir_once_that_knows_what_was_granted() -> None:
    claims = {"u0": home(heir="u2", u1=4)}
    assert AIR.keeper(0, claims, ()) == "u2"
    assert AIR.kept("u2", claims, ()) == frozenset()
    claims["u1"] = claim(asks(4, (100.0, 0.0, 30.0)))
    assert AIR.kept("u2", claims, ()) == {0}


def test_without_an_heir_it_falls_to_the_next_one() -> None:
    assert AIR.keeper(0, {"u0": home()}, ()) == "u1"
    assert AIR.keeper(0, {}, {"u0", "u1"}) == "u2"
    assert AIR.keeper(0, {}, ALL) is None


def test_who_stands_on_the_ground_takes_no_air_until_its_way_up_is_granted() -> None:
    up = ClaimedWay(1, ((0.0, 0.0, 30.0), (0.0, 50.0, 30.0)), grounded=True)
    assert len(AIR.taken("u0", up, granted=False)) == 0
    assert len(AIR.taken("u0", up, granted=True)) == 2


@settings(max_examples=60)
@given(seed=st.integers(0, 2**32 - 1))
def test_ways_that_are_flown_never_meet_whatever_each_keeper_has_heard(seed: int) -> None:
    """Words arrive late or never; nobody flies but by grants, and all that fly stay apart."""
    rng = np.random.default_rng(seed)
    names = [each.uav for each in FLEET]
    truth = {each.uav: claim(ClaimedWay(0, (each.hovers_enu_m,), flies=True)) for each in FLEET}
    known = {name: dict(truth) for name in names}
    for _ in range(60):
        name = str(rng.choice(names))
        mine, way = known[name], truth[name].way
        assert way is not None
        act = rng.integers(4)
        if act == 0 and way.flies:  # it has arrived, and asks for somewhere else
            there = (*rng.uniform(0.0, 200.0, 2).tolist(), float(rng.choice(SLABS.layers_m)))
            way = replace(way, number=way.number + 1, path_enu_m=(way.path_enu_m[-1], there))
            truth[name] = claim(replace(way, flies=False), float(rng.integers(100)))
        elif act == 1:
            granted = AIR.granted(name, {**mine, name: truth[name]}, way.grants, ALL, ())
            truth[name] = replace(truth[name], way=replace(way, grants=granted))
        elif act == 2 and AIR.is_granted(name, {**mine, name: truth[name]}, way.grants, ()):
            truth[name] = replace(truth[name], way=replace(way, flies=True))
        else:  # it hears of somebody
            other = str(rng.choice(names))
            mine[other] = truth[other]
        flown = [
            AIR.wanted(uav, its.way) for uav, its in truth.items() if its.way and its.way.flies
        ]
        flown += [
            AIR.wanted(uav, its.way)[:1]
            for uav, its in truth.items()
            if its.way and not its.way.flies
        ]
        for k, one in enumerate(flown):
            assert all(apart(SLABS, one, other) for other in flown[k + 1 :])
