"""Nobody rises, turns back while it rises, or flies elsewhere, into air that nobody has granted."""

from __future__ import annotations

from dataclasses import replace

from agent.core.interface import GoTo, Home, MotorsRun, Prepare, Return, VehicleReady
from agent.core.place_on_way import PlaceOnWay
from swarm.model.ids import COORDINATOR, OPERATOR
from swarm.protocol.fields import Point
from swarm.protocol.messages import CommandKind, OperatorCommand
from swarm.protocol.uav_messages import Claim, ClaimedWay, ClaimPhase
from swarm.separation.taken_ways import is_home
from tests.support.builders import entry, uav
from tests.support.field_agent import FieldAgent
from tests.support.lone_agent import ABOVE_START, LoneAgent, notes, orders

ELSEWHERE = (-50.0, 0.0, 10.0)


def in_the_air() -> LoneAgent:
    """``u0`` of two that are to keep 5 m apart is above its start."""
    agent = LoneAgent(uav("u0"), uav("u1", east_m=-50.0))
    agent.brief = replace(agent.brief, separation_m=5.0)
    agent.see(COORDINATOR, "u1")
    agent.learn(agent.statement(COORDINATOR, agent.brief))
    agent.happen(VehicleReady())
    return agent


def other_hovers(agent: LoneAgent, place_enu_m: Point, number: int) -> list[object]:
    way = ClaimedWay(number, (place_enu_m,), flies=True)
    return list(agent.hear("u1", Claim(ClaimPhase.IDLE, None, 0.0, 0, 0.0, way=way)))


def own_way(agent: LoneAgent) -> ClaimedWay:
    way = agent.core.replica.claims["u0"].way
    assert way is not None
    return way


def begun_anew(*, other_at: Point) -> LoneAgent:
    """Its next life is to take part again, after it had come home for good."""
    earlier = in_the_air()
    other_hovers(earlier, other_at, 1)
    earlier.hear(OPERATOR, OperatorCommand("u0", CommandKind.RETURN, 1, ""))
    earlier.happen(Home())
    assert is_home(earlier.core.replica.claims["u0"])
    agent = earlier.reborn(rejoin=True)
    agent.see(COORDINATOR, "u1")
    agent.learn_what_was_known_to(earlier)
    return agent


def test_who_takes_part_again_after_it_has_landed_asks_for_the_air_above_its_start() -> None:
    agent = begun_anew(other_at=ABOVE_START)

    assert orders(agent.log) == []
    assert "asks for the air above its start" in notes(agent.log)
    assert (own_way(agent).path_enu_m, own_way(agent).flies) == ((ABOVE_START,), False)
    other_hovers(agent, ELSEWHERE, 2)

    assert [type(order) for order in orders(agent.log)] == [Prepare]
    assert own_way(agent).flies
    assert own_way(agent).grounded
    agent.happen(VehicleReady())
    assert (own_way(agent).path_enu_m, own_way(agent).grounded) == ((ABOVE_START,), False)


def test_who_is_told_to_return_before_it_was_granted_that_air_asks_no_more() -> None:
    agent = begun_anew(other_at=ABOVE_START)

    agent.hear(OPERATOR, OperatorCommand("u0", CommandKind.RETURN, 1, ""))

    assert [type(order) for order in orders(agent.log)] == [Return]
    assert is_home(agent.core.replica.claims["u0"])


def test_who_takes_part_again_where_nobody_flies_rises_at_once() -> None:
    agent = begun_anew(other_at=ELSEWHERE)

    assert [type(order) for order in orders(agent.log)] == [Prepare]


def test_who_is_told_to_return_on_its_first_way_up_comes_down_at_its_start() -> None:
    agent = FieldAgent("u1")
    agent.brief = replace(agent.brief, separation_m=5.0)
    agent.see(COORDINATOR, "u1")
    agent.learn(agent.statement(COORDINATOR, agent.brief))
    agent.happen(MotorsRun(ours=True))
    agent.be_at((45.0, 0.0, 10.0))  # the wind has taken it along, nearer to the base than to it

    agent.hear(OPERATOR, OperatorCommand("u0", CommandKind.RETURN, 1, ""))

    home = orders(agent.log)[-1]
    assert isinstance(home, Return)
    assert (home.path_enu_m, home.via_enu_m, home.land) == ((), ABOVE_START, True)


def test_who_has_to_turn_before_its_vehicle_has_said_a_word_stops_where_its_way_begins() -> None:
    agent = in_the_air()
    agent.post(entry("near", 50.0), entry("far", -200.0))
    agent.start_mission()
    other_hovers(agent, ELSEWHERE, 2)
    sent = orders(agent.log)[-1]
    assert isinstance(sent, GoTo)
    assert sent.leg > 0

    agent.hear(OPERATOR, OperatorCommand("u0", CommandKind.RETURN, 1, ""))

    stop = orders(agent.log)[-1]
    assert isinstance(stop, GoTo)
    assert (stop.leg, stop.position_enu_m) == (0, ABOVE_START)


def test_who_was_flying_home_in_an_earlier_life_goes_on_once_it_is_known_where_it_is() -> None:
    earlier = in_the_air()
    earlier.hear(OPERATOR, OperatorCommand("u0", CommandKind.RETURN, 1, ""))
    earlier.start_mission()
    agent = earlier.reborn()
    agent.see(COORDINATOR, "u1")
    agent.learn_what_was_known_to(earlier)
    assert orders(agent.log) == []

    agent.be_at((20.0, 0.0, 10.0))

    stop = orders(agent.log)[0]
    assert isinstance(stop, GoTo)
    assert (stop.leg, stop.position_enu_m) == (0, (20.0, 0.0, 10.0))


def test_who_waits_for_a_word_of_where_it_is_waits_no_longer_than_for_an_answer() -> None:
    place = PlaceOnWay(2.5)

    assert place.is_awaited(10.0)
    assert place.is_awaited(12.4)
    assert not place.is_awaited(12.5)


def test_who_leaves_the_ground_is_taken_to_be_where_its_way_begins_until_it_is_up() -> None:
    place = PlaceOnWay(2.5)
    place.tell((30.0, 50.0, 0.0))

    place.set_off((30.0, 50.0, 70.0), from_ground=True)
    assert place.enu_m == (30.0, 50.0, 70.0)
    place.tell((30.5, 50.0, 40.0))
    assert place.enu_m == (30.0, 50.0, 70.0)
    place.tell((30.5, 50.0, 69.0))
    assert place.enu_m == (30.5, 50.0, 69.0)
    place.tell((30.5, 50.0, 40.0))
    assert place.enu_m == (30.5, 50.0, 40.0)


def test_who_has_flown_its_way_home_is_below_its_end_and_lands_by_itself() -> None:
    home = Return("aborted", resume=True, via_enu_m=(40.0, 30.0, 25.0))
    flown = ClaimedWay(7, ((0.0, 0.0, 36.0), (40.0, 30.0, 36.0)), flies=True, shift_m=11.0)
    place = PlaceOnWay(2.5)
    assert not place.has_flown(flown, home)  # nobody knows where it is

    for place_enu_m, lands in (
        ((20.0, 15.0, 36.0), False),
        ((40.0, 29.0, 36.5), False),
        ((40.0, 29.0, 34.5), False),
        ((40.0, 29.0, 33.5), True),
        ((40.0, 30.0, 12.0), True),
        ((40.0, 27.0, 12.0), False),
        ((40.0, 30.0, 0.0), True),
        ((40.0, 30.0, 60.0), False),
    ):
        place.tell(place_enu_m)
        assert place.has_flown(flown, home) is lands, place_enu_m
    place.tell((40.0, 30.0, 0.0))
    assert not place.has_flown(replace(flown, flies=False), home)
    assert not place.has_flown(flown, replace(home, via_enu_m=(0.0, 0.0, 25.0)))


def test_a_later_life_leaves_a_vehicle_alone_that_lands_at_home_already() -> None:
    earlier = in_the_air()
    earlier.be_at((0.0, 0.0, 10.0), None)
    earlier.hear(OPERATOR, OperatorCommand("u0", CommandKind.RETURN, 1, ""))
    agent = earlier.reborn()
    agent.see(COORDINATOR, "u1")
    agent.learn_what_was_known_to(earlier)

    agent.be_at((0.0, 0.0, 0.0), None)

    assert [type(order) for order in orders(agent.log)] == [Return]
    agent.happen(Home())
    assert is_home(agent.core.replica.claims["u0"])
