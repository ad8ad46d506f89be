"""Who keeps air, and what is granted: never two ways that meet, whoever knows what."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from swarm.protocol.uav_messages import Claim, ClaimedWay, ClaimPhase
from swarm.separation.shared_air import SharedAir
from swarm.separation.slabs import Slabs, apart
from swarm.separation.taken_ways import Starter
from swarm.separation.way_words import ends_like

SLABS = Slabs.between(10.0, (30.0, 42.0))
FLEET = [Starter(f"u{k}", (100.0 * k, 0.0, 30.0)) for k in range(3)]
TOGETHER = SharedAir(SLABS, FLEET)
"""Three on two slabs keep each of them together."""
ALONE = SharedAir(Slabs.between(10.0, (30.0, 42.0, 54.0)), FLEET)
"""Each has a slab of its own."""
HILLY = SharedAir(Slabs.over(10.0, (30.0, 42.0, 54.0), (0.0, 60.0)), FLEET)
"""Over hills they keep all of it together, however many layers there are."""
ALL = {"u0", "u1", "u2"}


def claim(
    way: ClaimedWay,
    decided_s: float = 0.0,
    phase: ClaimPhase = ClaimPhase.IDLE,
    task: str | None = None,
) -> Claim:
    return Claim(phase, task, decided_s, 0, 0.0, way=way)


def asks(number: int, *path: tuple[float, float, float]) -> ClaimedWay:
    return ClaimedWay(number, path)


def hovers(start: Starter, number: int = 0, **grants: int) -> Claim:
    return claim(ClaimedWay(number, (start.hovers_enu_m,), flies=True, grants=grants))


def home(heir: str | None = None, **grants: int) -> Claim:
    way = ClaimedWay(9, (), grounded=True, grants=grants, heir=heir)
    return claim(way, phase=ClaimPhase.OUT)


def test_where_each_has_a_slab_its_keeper_grants_alone() -> None:
    claims = {"u2": claim(asks(1, (200.0, 0.0, 30.0), (200.0, 50.0, 30.0)))}
    assert ALONE.granted("u0", claims, ALL, ()) == {"u2": 1}
    assert ALONE.granted("u1", claims, ALL, ()) == {}
    assert not ALONE.is_granted("u2", claims, ())
    told = {**claims, "u0": hovers(FLEET[0], u2=1)}
    assert ALONE.is_granted("u2", told, ())


def test_two_of_three_grant_and_the_third_speaks_only_for_one_who_is_not_heard() -> None:
    claims = {"u2": claim(asks(1, (200.0, 0.0, 30.0), (200.0, 50.0, 30.0)))}
    assert TOGETHER.granted("u0", claims, ALL, ()) == {"u2": 1}
    assert TOGETHER.granted("u1", claims, ALL, ()) == {"u2": 1}
    assert TOGETHER.granted("u2", claims, ALL, ()) == {}
    assert TOGETHER.granted("u2", claims, {"u1", "u2"}, ()) == {"u2": 1}
    one = {**claims, "u1": hovers(FLEET[1], u2=1)}
    assert not TOGETHER.is_granted("u2", one, ())
    lost = {**one, "u2": claim(replace(one["u2"].way or asks(1), grants={"u2": 1}))}
    assert TOGETHER.is_granted("u2", lost, ())


def test_a_way_can_be_asked_for_while_most_of_its_keepers_are_there() -> None:
    path = np.array([(200.0, 0.0, 30.0), (200.0, 50.0, 30.0)])
    assert TOGETHER.can_grant(path, {}, (), {"u1", "u2"}.__contains__)
    assert not TOGETHER.can_grant(path, {}, (), {"u2"}.__contains__)
    assert not ALONE.can_grant(path, {}, (), {"u1", "u2"}.__contains__)


def test_over_hills_a_lost_keeper_is_not_missed_by_ways_that_climb_through_all() -> None:
    """It asks for two of the three stacks; of these u0 sits first on one, u1 on the other."""
    over = asks(1, (200.0, 0.0, 30.0), (250.0, 0.0, 70.0), (300.0, 0.0, 30.0))
    claims = {"u2": claim(over)}
    path = np.array(over.path_enu_m)
    for lost in ("u0", "u1"):
        (left,) = {"u0", "u1"} - {lost}
        heard = ALL - {lost}
        assert HILLY.can_grant(path, claims, (), heard.__contains__)
        assert HILLY.granted(left, claims, heard, ()) == {"u2": 1}
        assert HILLY.granted("u2", claims, heard, ()) == {"u2": 1}
        said = {**claims, left: hovers(FLEET[int(left[1])], u2=1)}
        assert not HILLY.is_granted("u2", said, ())
        said["u2"] = claim(replace(over, grants={"u2": 1}))
        assert HILLY.is_granted("u2", said, ())
    assert not HILLY.can_grant(path, claims, (), {"u2"}.__contains__)


def test_over_hills_what_was_granted_in_one_stack_is_not_granted_in_another() -> None:
    """Both climb over the same place, one from the lowest stack and one from the highest."""
    claims = {
        "u1": claim(asks(1, (100.0, 0.0, 30.0), (150.0, 0.0, 70.0)), decided_s=1.0),
        "u2": claim(asks(1, (200.0, 0.0, 110.0), (150.0, 0.0, 70.0)), decided_s=2.0),
    }
    for keeper in ("u0", "u1", "u2"):
        assert "u2" not in HILLY.granted(keeper, claims, ALL, ())
    assert HILLY.granted("u0", claims, ALL, ()) == {"u1": 1}
    assert HILLY.granted("u1", claims, ALL, ()) == {"u1": 1}


def test_a_way_over_somebody_who_hovers_waits_until_that_one_has_left() -> None:
    claims = {"u2": claim(asks(1, (200.0, 0.0, 30.0), (50.0, 0.0, 30.0)))}
    assert ALONE.granted("u0", claims, ALL, ()) == {}  # u1 hovers at its start on the way
    claims["u1"] = claim(ClaimedWay(1, ((100.0, 50.0, 30.0),), flies=True))
    assert ALONE.granted("u0", claims, ALL, ()) == {"u2": 1}


def test_of_two_ways_that_meet_the_one_of_who_waits_longer_is_granted() -> None:
    claims = {
        "u1": claim(asks(1, (100.0, 0.0, 30.0), (200.0, 100.0, 30.0)), decided_s=5.0),
        "u2": claim(asks(1, (200.0, 0.0, 30.0), (100.0, 100.0, 30.0)), decided_s=3.0),
    }
    assert ALONE.granted("u0", claims, ALL, ()) == {"u2": 1}


def test_who_is_to_land_goes_before_who_goes_to_a_task() -> None:
    waits = asks(1, (100.0, 0.0, 30.0), (200.0, 100.0, 30.0))
    lands = asks(1, (200.0, 0.0, 30.0), (100.0, 100.0, 30.0))
    claims = {
        "u1": claim(waits, 3.0, ClaimPhase.HELD, "t1"),
        "u2": claim(lands, 5.0),
    }
    assert ALONE.granted("u0", claims, ALL, ()) == {"u2": 1}


def test_what_is_granted_stays_taken_until_its_uav_asks_for_something_else() -> None:
    crossing = asks(1, (100.0, 0.0, 30.0), (200.0, 100.0, 30.0))
    claims = {"u1": claim(crossing, 5.0), "u2": claim(asks(1, (200.0, 0.0, 30.0)), 9.0)}
    before = ALONE.granted("u0", claims, ALL, ())
    claims["u0"] = hovers(FLEET[0], **before)
    claims["u2"] = claim(asks(2, (200.0, 0.0, 30.0), (100.0, 100.0, 30.0)), 3.0)
    assert ALONE.granted("u0", claims, ALL, ()) == {"u1": 1}
    claims["u1"] = claim(ClaimedWay(2, ((100.0, 0.0, 30.0),), flies=True))
    assert ALONE.granted("u0", claims, ALL, ()) == {"u2": 2}


def test_who_leaves_where_it_is_in_the_way_of_a_stronger_one_need_not_wait_for_it() -> None:
    claims = {
        "u1": claim(asks(1, (100.0, 0.0, 30.0), (100.0, -50.0, 30.0)), decided_s=5.0),
        "u2": claim(asks(1, (200.0, 0.0, 30.0), (50.0, 0.0, 30.0)), decided_s=1.0),
    }
    assert ALONE.granted("u0", claims, ALL, ()) == {"u1": 1}


def test_who_lands_for_good_in_the_way_of_a_stronger_one_need_not_wait_for_it_either() -> None:
    stronger = claim(asks(1, (200.0, 0.0, 30.0), (50.0, 0.0, 30.0)), decided_s=1.0)
    lands = asks(1, (100.0, 0.0, 30.0), (60.0, 0.0, 30.0))
    stays = {"u1": claim(lands, decided_s=5.0), "u2": stronger}
    leaves = {"u1": claim(lands, 5.0, ClaimPhase.OUT), "u2": stronger}
    assert ALONE.granted("u0", stays, ALL, ()) == {}
    assert ALONE.granted("u0", leaves, ALL, ()) == {"u1": 1}


def test_a_keeper_that_knows_less_than_it_granted_grants_nothing() -> None:
    claims = {
        "u0": hovers(FLEET[0], u1=4),
        "u2": claim(asks(1, (200.0, 0.0, 30.0), (200.0, 50.0, 30.0))),
    }
    assert ALONE.granted("u0", claims, ALL, ()) == {"u1": 4}


def test_the_seat_of_who_is_home_falls_to_its_heir_once_that_knows_what_was_granted() -> None:
    claims = {"u0": home(heir="u2", u1=4)}
    assert ALONE.holder(0, claims, ()) == "u2"
    assert ALONE.inherited("u2", claims, ALL, ()) == ()
    claims["u1"] = claim(asks(4, (100.0, 0.0, 30.0)))
    assert ALONE.inherited("u2", claims, ALL, ()) == (0,)


def test_an_heir_grants_nothing_before_it_says_that_it_has_taken_over() -> None:
    claims = {
        "u0": home(heir="u2"),
        "u1": claim(asks(1, (100.0, 0.0, 30.0), (100.0, 50.0, 30.0))),
        "u2": hovers(FLEET[2]),
    }
    assert ALONE.granted("u2", claims, ALL, ()) == {}
    way = claims["u2"].way
    assert way is not None
    claims["u2"] = claim(replace(way, keeps=(0,)))
    assert ALONE.granted("u2", claims, ALL, ()) == {"u1": 1}
    claims["u2"] = claim(replace(way, grants={"u1": 1}))
    assert not ALONE.is_granted("u1", claims, ())
    claims["u2"] = claim(replace(way, grants={"u1": 1}, keeps=(0,)))
    assert ALONE.is_granted("u1", claims, ())


def test_what_an_heir_has_granted_for_another_slab_has_to_fit_into_the_new_one() -> None:
    """u1 granted u2 the middle slab of a way that meets, in the lowest, what u0 had granted."""
    up = asks(1, (200.0, 0.0, 30.0), (100.0, 0.0, 30.0), (100.0, 0.0, 42.0))
    claims = {
        "u0": home(heir="u1"),
        "u1": claim(ClaimedWay(3, ((140.0, 3.0, 30.0),), flies=True, grants={"u2": 1})),
        "u2": claim(up),
    }
    assert ALONE.inherited("u1", claims, ALL, ()) == ()
    claims["u2"] = claim(replace(up, number=2))
    assert ALONE.inherited("u1", claims, ALL, ()) == (0,)


def test_what_those_before_have_granted_binds_the_heir_too() -> None:
    claims = {
        "u0": home(heir="u1", u2=1),
        "u1": claim(ClaimedWay(3, ((0.0, 90.0, 30.0),), flies=True, keeps=(0,)), 5.0),
        "u2": claim(asks(1, (200.0, 0.0, 30.0), (0.0, 0.0, 30.0)), 9.0),
    }
    crossing = ClaimedWay(4, ((0.0, 90.0, 30.0), (100.0, -50.0, 30.0)), keeps=(0,))
    claims["u1"] = claim(crossing, 1.0)
    assert ALONE.granted("u1", claims, ALL, ()) == {}


def test_the_seat_of_who_is_gone_is_taken_over_only_when_all_others_are_heard() -> None:
    assert ALONE.holder(0, {"u0": home()}, ()) == "u1"
    assert ALONE.holder(0, {}, {"u0", "u1"}) == "u2"
    assert ALONE.holder(0, {}, ALL) is None
    assert ALONE.inherited("u1", {}, {"u1"}, {"u0"}) == ()
    assert ALONE.inherited("u1", {}, {"u1", "u2"}, {"u0"}) == (0,)


def test_who_was_only_taken_for_gone_does_not_sit_beside_its_heir() -> None:
    """It hears who has taken over, and grants nothing there any more."""
    claims = {
        "u1": claim(ClaimedWay(0, (FLEET[1].hovers_enu_m,), flies=True, keeps=(0,))),
        "u2": claim(asks(1, (200.0, 0.0, 30.0), (200.0, 50.0, 30.0))),
    }
    assert ALONE.holder(0, claims, ()) == "u1"
    assert ALONE.granted("u0", claims, ALL, ()) == {}
    assert ALONE.granted("u1", claims, ALL, ()) == {"u2": 1}


def test_who_stands_on_the_ground_takes_no_air_until_its_way_up_is_granted() -> None:
    up = ClaimedWay(1, ((0.0, 0.0, 30.0), (0.0, 50.0, 30.0)), grounded=True)
    assert len(ALONE.taken("u0", up, granted=False)) == 0
    assert len(ALONE.taken("u0", up, granted=True)) == 2


class Sky:
    """A fleet whose words arrive late or never, each with its own view of the others."""

    def __init__(self, rng: np.random.Generator, relief_m: float | None) -> None:
        n_uav, n_layer = int(rng.integers(2, 7)), int(rng.integers(1, 5))
        layers_m = tuple(30.0 + 12.0 * k for k in range(n_layer))
        self.slabs, self.relief_m = Slabs.between(10.0, layers_m), relief_m
        if relief_m is not None:
            self.slabs = Slabs.over(10.0, layers_m, (0.0, relief_m))
        fleet = [
            Starter(f"u{k}", (40.0 * k, 0.0, self.slabs.layers_m[k % n_layer]))
            for k in range(n_uav)
        ]
        self.air, self.names = SharedAir(self.slabs, fleet), [each.uav for each in fleet]
        self.truth = {each.uav: hovers(each) for each in fleet}
        self.said = dict(self.truth)
        """What each has said last, of which it may have flown some without a word."""
        self.known = {name: dict(self.truth) for name in self.names}
        self.lost: set[str] = set()
        """Who has crashed, and is in nobody's way any more."""
        self.expired: dict[str, set[str]] = {name: set() for name in self.names}
        self.rng = rng

    def view(self, name: str) -> tuple[dict[str, Claim], set[str], set[str]]:
        """What ``name`` knows, whom it hears, and whom it takes for gone."""
        heard = {each for each in self.names if self.rng.random() < 0.8}
        return (
            {**self.known[name], name: self.truth[name]},
            (heard | {name}) - self.lost,
            self.expired[name],
        )

    def say(self, name: str, way: ClaimedWay, phase: ClaimPhase = ClaimPhase.IDLE) -> None:
        self.truth[name] = claim(way, float(self.rng.integers(100)), phase)

    def act(self) -> None:
        """Somebody does something, of which most of the others hear, and some of them late."""
        name = str(self.rng.choice(self.names))
        if name not in self.lost and self.truth[name].phase is not ClaimPhase.OUT:
            self.let(name)
        to = self.tell(name)
        for other in self.names:
            if other in to and self.rng.random() < 0.6:
                self.known[other][name] = self.said[name]

    def tell(self, name: str) -> set[str]:
        """Say all that is true, or only what it has granted; to whom that is said."""
        now, before = self.truth[name], self.said[name]
        assert now.way is not None
        assert before.way is not None
        can_wait = now.phase is before.phase and ends_like(now.way, before.way)
        if not can_wait or self.rng.random() < 0.4:
            self.said[name] = now
            return set(self.names)
        self.said[name] = replace(before, way=replace(before.way, grants=now.way.grants))
        return {uav for uav, n in now.way.grants.items() if before.way.grants.get(uav) != n}

    def let(self, name: str) -> None:
        """One step of its agent: it grants, sets off, and may ask for more, go home or crash."""
        rng, (claims, heard, expired) = self.rng, self.view(name)
        way = self.truth[name].way
        assert way is not None
        decided_s = self.truth[name].decided_s
        way = replace(way, keeps=self.air.inherited(name, claims, heard, expired))
        claims[name] = claim(way, decided_s)
        way = replace(way, grants=self.air.granted(name, claims, heard, expired))
        claims[name] = self.truth[name] = claim(way, decided_s)
        if not way.flies and self.air.is_granted(name, claims, expired):
            way = replace(way, flies=True)
            self.truth[name] = claim(way, decided_s)
        fate = rng.random()
        if fate < 0.02:
            self.lost.add(name)
        elif fate < 0.04 and way.flies:  # home for good, with an heir or without
            heir = str(rng.choice(self.names)) if rng.random() < 0.7 else None
            ended = replace(way, path_enu_m=(), flies=False, grounded=True, heir=heir)
            self.say(name, ended, ClaimPhase.OUT)
        elif fate < 0.08 and self.lost:
            expired.add(str(rng.choice(sorted(self.lost))))
            # That takes as long as its battery lasts: who is heard by then has long been heard of.
            self.known[name].update(self.truth)
        elif fate < 0.14 and way.flies and len(way.path_enu_m) > 1:  # half of a piece is flown
            first, second, *rest = way.path_enu_m
            east_m, north_m, up_m = (0.5 * (a + b) for a, b in zip(first, second, strict=True))
            path = ((east_m, north_m, up_m), second, *rest)
            self.truth[name] = claim(replace(way, path_enu_m=path), decided_s)
        elif fate < 0.4 or (way.flies and fate < 0.8):  # it wants to be somewhere else
            here = way.path_enu_m[-1:] if way.flies else way.path_enu_m[:1]
            self.ask(name, replace(way, path_enu_m=here))

    def ask(self, name: str, way: ClaimedWay) -> None:
        """Straight up or down first, or at once, and level, or to another height."""
        rng, (east_m, north_m, _) = self.rng, way.path_enu_m[-1]
        corners = [way.path_enu_m[-1]]
        if rng.random() < 0.5:
            corners.append((east_m, north_m, self.some_height_m()))
        there = rng.uniform(0.0, 120.0, 2).tolist()
        corners.append((*there, self.some_height_m()))
        asked = replace(way, number=way.number + 1, path_enu_m=tuple(corners), flies=False)
        self.say(name, asked)

    def some_height_m(self) -> float:
        """Of a layer, over hills above ground of any height."""
        layer_m = float(self.rng.choice(self.slabs.layers_m))
        return layer_m + (0.0 if self.relief_m is None else self.rng.uniform(0.0, self.relief_m))

    def check(self) -> None:
        flown = []
        for uav, its in self.truth.items():
            assert its.way is not None
            path = np.array(its.way.path_enu_m).reshape(-1, 3)
            if uav not in self.lost and len(path):
                flown.append(path if its.way.flies else path[:1])
        for k, one in enumerate(flown):
            assert all(apart(self.slabs, one, other) for other in flown[k + 1 :])


@settings(max_examples=40)
@given(seed=st.integers(0, 2**32 - 1), relief_m=st.none() | st.floats(0.0, 80.0))
def test_ways_that_are_flown_never_meet_whatever_each_keeper_has_heard(
    seed: int, relief_m: float | None
) -> None:
    """Nobody flies but by grants: some go home, some crash, and seats change hands."""
    sky = Sky(np.random.default_rng(seed), relief_m)
    for _ in range(120):
        sky.act()
        sky.check()


def test_a_grant_of_a_request_that_is_over_lets_nobody_go_and_keeps_nobody_back() -> None:
    there, back = (200.0, 0.0, 30.0), (200.0, 50.0, 30.0)
    claims = {"u0": hovers(FLEET[0], u2=1), "u2": claim(asks(2, there, back))}
    over = {"u0": hovers(FLEET[0]), "u2": claim(asks(2, there, back))}

    assert not ALONE.is_granted("u2", claims, ())
    for keeper in ALL:
        now = ALONE.granted(keeper, claims, ALL, ())
        assert now == ALONE.granted(keeper, over, ALL, ())


def test_who_sits_beside_a_keeper_has_a_seat_where_it_has_one() -> None:
    assert TOGETHER.beside("u0", {}, ()) == {"u1", "u2"}
    assert ALONE.beside("u0", {}, ()) == set()
    assert TOGETHER.beside("u0", {"u1": home(heir="u2")}, ()) == {"u2"}
