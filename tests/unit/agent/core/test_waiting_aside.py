"""From where a UAV that has made room for another one flies on."""

from __future__ import annotations

import pytest

from agent.core.fleet_air import FleetAir
from agent.core.interface import GoTo
from agent.core.mission_view import MissionView, Peers
from agent.core.wish import Wish
from swarm.protocol.fields import Point
from tests.support.builders import entry
from tests.support.field_agent import FieldAgent
from tests.support.lone_agent import TIMING

LINE = ((20.0, 0.0, 0.0), (20.0, 40.0, 0.0), (60.0, 40.0, 0.0))
ALONG = tuple((east_m, north_m, 17.0) for east_m, north_m, _ in LINE)
ASIDE = (2.5, 0.0, 17.0)


def flown_from_aside(corners_enu_m: tuple[Point, ...], task: str) -> tuple[Point, ...]:
    """Its corners, once it has stepped aside from where they begin, to where nothing is between."""
    agent = FieldAgent()
    agent.fly_to(entry("line", 20.0, path_enu_m=LINE), entry("place", 60.0, 1))
    replica = agent.core.replica
    air = FleetAir("u0", replica, MissionView("m", "u0", replica), Peers("u0", TIMING))
    wish = Wish(GoTo(1, corners_enu_m[-1], task=task), 0.0, corners_enu_m)

    air.begin_at(wish, ASIDE)

    return wish.corners_enu_m


@pytest.mark.parametrize("along", [ALONG, ALONG[::-1]], ids=["on", "back"])
def test_who_waits_to_work_along_a_line_begins_it_where_it_begins(along: tuple[Point, ...]) -> None:
    assert flown_from_aside(along, "line") == (ASIDE, *along)


@pytest.mark.parametrize(
    ("way", "task"),
    [
        pytest.param(ALONG, "place", id="to a place"),
        pytest.param(((0.0, 0.0, 17.0), ALONG[0]), "line", id="to where a line begins"),
    ],
)
def test_who_waits_to_fly_somewhere_need_not_go_back_first(
    way: tuple[Point, ...], task: str
) -> None:
    assert flown_from_aside(way, task) == (ASIDE, *way[1:])


def test_straight_above_or_below_it_is_where_its_way_begins() -> None:
    above = (*ALONG[0][:2], 24.0)
    agent = FieldAgent()
    agent.fly_to(entry("line", 20.0, path_enu_m=LINE))
    replica = agent.core.replica
    air = FleetAir("u0", replica, MissionView("m", "u0", replica), Peers("u0", TIMING))
    wish = Wish(GoTo(1, ALONG[-1], task="line"), 0.0, ALONG)

    air.begin_at(wish, above)

    assert wish.corners_enu_m == ALONG
