"""What a keeper of air has granted, and who is told so when."""

from __future__ import annotations

from dataclasses import replace

from agent.core.kept_air import KeptAir
from swarm.model.ids import COORDINATOR
from swarm.protocol.uav_messages import Claim, ClaimedWay, ClaimPhase
from swarm.separation.shared_air import SharedAir
from swarm.separation.slabs import Slabs
from swarm.separation.taken_ways import Starter

AIR = SharedAir(
    Slabs.between(10.0, (30.0, 42.0)), [Starter(f"u{k}", (100.0 * k, 0.0, 30.0)) for k in range(4)]
)
"""Four on two slabs, of which each has three seats."""
ALL = {"u0", "u1", "u2", "u3"}
OWN = ClaimedWay(0, ((0.0, 0.0, 30.0),), flies=True)
ASKS = ClaimedWay(5, ((300.0, 0.0, 30.0), (300.0, 50.0, 30.0)))
AGAIN_S = 2.0


def claim(way: ClaimedWay) -> Claim:
    return Claim(ClaimPhase.IDLE, None, 0.0, 0, 0.0, way=way)


class Keeper:
    """``u0``, and what it knows of the others."""

    def __init__(self, own: ClaimedWay = OWN) -> None:
        self.kept = KeptAir("u0", AGAIN_S)
        self.own = self.said = own
        self.others = {"u3": claim(ASKS)}

    def claims(self) -> dict[str, Claim]:
        return {**self.others, "u0": claim(self.kept.told(self.own))}

    def look(self, now_s: float) -> list[str] | None:
        """Whom it tells what it has granted, having looked; None: there is nothing to say."""
        self.kept.look(AIR, self.claims, ALL, (), now_s)
        told = self.kept.told_to(claim(self.said), AIR, self.claims, (), now_s)
        if told is None:
            return None
        assert told[0].way is not None
        self.said = told[0].way
        return told[1]


def test_who_asked_the_other_keepers_and_the_coordinator_are_told_of_a_grant() -> None:
    keeper = Keeper()
    beside = AIR.beside("u0", {}, ())

    assert beside
    assert keeper.look(10.0) == sorted({"u3", COORDINATOR, *beside})
    assert keeper.said == replace(OWN, grants={"u3": 5})
    assert keeper.look(10.1) is None


def test_who_still_asks_for_what_it_was_granted_is_told_again_and_again() -> None:
    keeper = Keeper()
    keeper.look(10.0)

    assert keeper.look(11.9) is None
    assert keeper.kept.tell_again_at_s == 12.0
    assert keeper.look(12.0) == ["u3"]
    assert keeper.look(14.0) == ["u3"]


def test_a_later_life_tells_once_more_what_an_earlier_one_may_not_have_told() -> None:
    keeper = Keeper()
    keeper.said = replace(OWN, grants={"u3": 5})
    keeper.kept.recall(keeper.said)

    assert keeper.look(10.0) is None
    assert keeper.look(12.0) == ["u3"]


def test_who_flies_or_asks_for_something_else_is_told_no_more() -> None:
    for now in (replace(ASKS, flies=True), replace(ASKS, number=6, path_enu_m=ASKS.path_enu_m[:1])):
        keeper = Keeper()
        keeper.look(10.0)
        keeper.others["u3"] = claim(now)
        told = keeper.look(12.0)
        assert told is None or "u3" in told
        assert keeper.look(14.0) is None
        assert keeper.kept.tell_again_at_s is None


def test_what_it_has_granted_is_not_said_of_a_way_that_it_has_not_told_of() -> None:
    """Who hears of the grant alone hears of the own way what all others have heard."""
    keeper = Keeper()
    keeper.said = replace(OWN, path_enu_m=((0.0, 90.0, 30.0), *OWN.path_enu_m))
    keeper.look(10.0)

    assert keeper.said.path_enu_m == ((0.0, 90.0, 30.0), *OWN.path_enu_m)


def test_its_own_request_is_told_to_those_who_could_tell_it_after_a_restart() -> None:
    keeper = Keeper(ClaimedWay(3, ((0.0, 0.0, 30.0), (0.0, 50.0, 30.0))))
    keeper.others.clear()

    told = keeper.look(10.0)

    assert told is not None
    assert "u0" not in told
    assert COORDINATOR in told
    assert keeper.said.grants == {"u0": 3}
