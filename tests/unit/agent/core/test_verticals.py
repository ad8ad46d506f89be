"""Landing and climbing of real vehicles: known beforehand, measured, reckoned with, and apart."""

from __future__ import annotations

import itertools
import math
from dataclasses import replace

import pytest

from agent.core.states import AgentState
from agent.core.verticals import Verticals
from swarm.model import Zone, ZoneId
from swarm.protocol.uav_messages import BaseStage, Calibration
from tests.support.builders import entry
from tests.support.field_agent import BASE, BUDGET_S, SWAP_S, FieldAgent, Script, visiting
from tests.support.lone_agent import said

UPRIGHT = Verticals()
LAND_S, CLIMB_S = 23.2, 12.7
"""From and to a layer of 10 m, as told."""
SPOT = (50.0, 0.0, 0.0)
"""Of the first UAV: the base itself, from which its start is far enough."""


def calibrations(agent: FieldAgent) -> list[Calibration]:
    return said(agent.log, Calibration)


def flying_to_base(script: Script, *others: str) -> FieldAgent:
    agent = FieldAgent(*others, verticals=UPRIGHT)
    agent.fly_to(entry("t0", 100.0))
    script.items = ["base:b0"]
    agent.start_mission()
    assert agent.state() is AgentState.FLYING_TO_BASE
    return agent


def test_a_lower_layer_is_left_and_reached_sooner() -> None:
    heights_m = [2.0, 10.0, 13.0, 40.0]
    for times_s in (
        [UPRIGHT.land_s(h) for h in heights_m],
        [UPRIGHT.climb_s(h) for h in heights_m],
    ):
        assert times_s == sorted(times_s)
    assert UPRIGHT.land_s(10.0) == pytest.approx(LAND_S, abs=0.06)
    assert UPRIGHT.climb_s(10.0) == pytest.approx(CLIMB_S, abs=0.05)


def test_every_uav_of_a_fleet_has_a_spot_of_its_own_off_starts_and_zones() -> None:
    import shapely

    zone = Zone(ZoneId("herd"), ((15.0, -50.0), (60.0, -50.0), (60.0, 50.0), (15.0, 50.0)))
    starts = [(0.0, 0.0, 0.0), (5.0, 5.0, 0.0)]
    spots = [UPRIGHT.spot((0.0, 0.0, 2.0), uav, starts, [zone], 5.0) for uav in range(30)]

    pairs = itertools.combinations(spots, 2)
    assert all(math.dist(*pair) >= UPRIGHT.apart_m - 1e-9 for pair in pairs)
    assert all(math.dist(s[:2], start[:2]) >= UPRIGHT.apart_m for s in spots for start in starts)
    assert all(zone.shape().distance(shapely.Point(spot[:2])) >= 5.0 for spot in spots)
    assert {spot[2] for spot in spots} == {2.0}


def test_before_it_flies_it_tells_how_long_landing_and_climbing_take(script: Script) -> None:
    agent = flying_to_base(script)

    assert set(calibrations(agent)) == {Calibration(1.0, 1.0, 0, LAND_S, CLIMB_S)}
    claim = agent.claim
    assert claim is not None
    assert claim.arrives_s == 50.0 + LAND_S  # touch-down
    assert claim.completion_s == 50.0 + LAND_S + SWAP_S
    assert claim.sortie_end_s == BUDGET_S


def test_without_a_battery_that_ends_or_a_vehicle_that_lands_it_tells_nothing(
    script: Script,
) -> None:
    for agent in (FieldAgent(verticals=UPRIGHT, endurance_s=None), FieldAgent()):
        agent.fly_to(entry("t0", 100.0))
        agent.start_mission()
        assert calibrations(agent) == []


def test_landing_that_takes_longer_is_believed_at_once_and_shorter_after_some(
    script: Script,
) -> None:
    agent = flying_to_base(script)
    agent.run_until(49.0)
    agent.arrive(50.0)
    assert agent.landing.position_enu_m == SPOT
    assert agent.claim is not None
    assert agent.claim.completion_s == 50.0 + LAND_S + SWAP_S
    agent.touch_down(50.0 + LAND_S + 7.0)

    assert agent.claim.completion_s == pytest.approx(50.0 + LAND_S + 7.0 + SWAP_S)
    assert calibrations(agent)[-1] == Calibration(1.0, 1.0, 1, LAND_S + 7.0, CLIMB_S)


def test_what_the_first_leg_from_the_ground_takes_longer_is_the_climb(script: Script) -> None:
    agent = flying_to_base(script)
    agent.run_until(49.0)
    agent.arrive(50.0)
    agent.touch_down(50.0 + LAND_S)
    script.items = ["t0"]
    lifts_s = 50.0 + LAND_S + SWAP_S
    agent.get_full(lifts_s)
    assert agent.state() is AgentState.FLYING
    assert agent.claim is not None
    assert agent.claim.sortie_end_s == lifts_s + BUDGET_S
    agent.run_until(lifts_s + 60.0)
    agent.arrive(lifts_s + 50.0 + CLIMB_S + 5.0)

    assert calibrations(agent)[-1] == Calibration(1.0, 1.0, 1, LAND_S, CLIMB_S + 5.0)


@pytest.mark.parametrize("late", [True, False])
def test_who_turns_away_from_its_first_leg_when_it_should_be_there_has_climbed_for_longer(
    script: Script, late: bool
) -> None:
    """Else it would set off for the same again and again, and never get there in time."""
    agent = flying_to_base(script)
    agent.run_until(49.0)
    agent.arrive(50.0)
    agent.touch_down(50.0 + LAND_S)
    script.items = ["t0"]
    lifts_s = 50.0 + LAND_S + SWAP_S
    agent.get_full(lifts_s)
    script.items = ["base:b0"]
    turns_s = lifts_s + 50.0 + CLIMB_S + (4.0 if late else -4.0)
    agent.run_until(turns_s)
    agent.post(entry("t0", 100.0, withdrawn=True))

    assert agent.state() is AgentState.FLYING_TO_BASE
    climb_s = calibrations(agent)[-1].climb_s
    assert climb_s == pytest.approx(CLIMB_S + 4.0 + 1.0 if late else CLIMB_S, abs=0.1)


def test_without_a_slot_it_lands_beside_them_while_its_battery_pays_for_it(script: Script) -> None:
    agent = flying_to_base(script, "u1")
    agent.hear("u1", visiting(BaseStage.LANDED, 5.0))
    agent.run_until(49.0)
    agent.arrive(50.0)

    agent.run_until(BUDGET_S - LAND_S - 0.1)
    assert agent.state() is AgentState.ABOVE_BASE
    agent.run_until(BUDGET_S - LAND_S)

    assert agent.way_home.land
    assert agent.way_home.via_enu_m == (*SPOT[:2], 10.0)
    assert agent.state() is AgentState.BESIDE_SLOTS


def test_two_uavs_land_at_one_base_some_metres_apart(script: Script) -> None:
    places = []
    for index in range(2):
        agent = FieldAgent("u1", verticals=UPRIGHT)
        fleet = agent.brief.uavs[::-1] if index else agent.brief.uavs
        agent.brief = replace(agent.brief, uavs=fleet)
        agent.fly_to(entry("t0", 100.0))
        script.items = ["base:b0"]
        agent.start_mission()
        places.append(agent.flight.position_enu_m)

    assert math.dist(*places) >= UPRIGHT.apart_m - 1e-9
    assert all(math.dist(place[:2], BASE.position_enu_m[:2]) <= 10.0 for place in places)
