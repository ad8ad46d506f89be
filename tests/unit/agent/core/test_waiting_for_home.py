"""How long a UAV that needs a way home may wait for it, and when it lands where it is."""

from __future__ import annotations

import math

import pytest

from agent.core.interface import GoTo, Return, Telemetry
from agent.core.last_departure import PATIENT_S, LastDeparture
from agent.core.mission_view import MissionView
from agent.core.wish import Wish
from agent.core.zone_stay import ZoneStay
from tests.support.builders import entry
from tests.support.field_agent import BUDGET_S, ENDURANCE_S, FieldAgent

WAY_S = 60.0
RESERVE_S = ENDURANCE_S - BUDGET_S
CORNERS = ((60.0, 0.0, 17.0), (0.0, 0.0, 17.0))
RETRY_S = 0.5


def home(waited_s: float = 0.0) -> Wish:
    return Wish(Return("", resume=False), -waited_s, CORNERS, takes_s=WAY_S)


def lands(
    wish: Wish, sortie_end_s: float, drain_frac: float = 1.0, *, left_s: float | None = None
) -> bool:
    """At mission time 0, if its battery drains so many times as fast as planned.

    With ``left_s`` before it knows of a mission, its vehicle telling what is left to its reserve.
    """
    agent = FieldAgent()
    agent.fly_to(entry("t0", 20.0))
    replica = agent.core.replica
    view = MissionView("m", "u0", replica)
    if left_s is None:
        view.clock.hear(0.0, 0.0)
    elif math.isfinite(left_s):
        view.move(Telemetry(CORNERS[0], (0.0, 0.0, 0.0), (left_s + RESERVE_S) / ENDURANCE_S))
    battery = LastDeparture(view, ZoneStay("u0", replica, view))
    battery.sortie_end_s, battery.drain_frac = lambda: sortie_end_s, lambda: drain_frac
    return battery.must_land(wish, RETRY_S)


@pytest.mark.parametrize("drain_frac", [1.0, 2.0])
def test_who_could_not_come_home_any_more_lands_without_having_waited(drain_frac: float) -> None:
    """All but a tenth of its reserve would be used up when it is there."""
    last_s = WAY_S - 0.9 * RESERVE_S / drain_frac

    assert not lands(home(), last_s + 0.1, drain_frac)
    assert lands(home(), last_s - 0.1, drain_frac)


@pytest.mark.parametrize("drain_frac", [1.0, 2.0])
def test_who_has_asked_in_vain_lands_while_half_of_its_reserve_is_left(drain_frac: float) -> None:
    last_s = WAY_S - 0.5 * RESERVE_S / drain_frac + RETRY_S
    asked_twice = home(waited_s=2.1 * RETRY_S)

    assert not lands(asked_twice, last_s + 0.1, drain_frac)
    assert lands(asked_twice, last_s - 0.1, drain_frac)
    assert not lands(home(waited_s=1.9 * RETRY_S), last_s - 0.1, drain_frac)


def test_who_waits_for_the_way_to_a_task_may_look_for_another() -> None:
    wish = Wish(GoTo(1, CORNERS[-1], task="t0"), -100.0, CORNERS, takes_s=WAY_S)

    assert not lands(wish, -RESERVE_S)


def test_who_knows_of_no_mission_goes_by_what_its_vehicle_tells_of_the_charge() -> None:
    """Whatever had been reckoned with for the mission."""
    last_s = WAY_S - 0.5 * RESERVE_S + RETRY_S
    asked_twice = home(waited_s=2.1 * RETRY_S)

    assert not lands(asked_twice, 1e3, left_s=last_s + 0.1)
    assert lands(asked_twice, 1e3, left_s=last_s - 0.1)


def test_who_knows_neither_waits_as_long_as_one_whose_battery_has_no_end() -> None:
    assert not lands(home(waited_s=PATIENT_S - 2.0 * RETRY_S), 1e3, left_s=math.inf)
    assert lands(home(waited_s=PATIENT_S), 1e3, left_s=math.inf)
