"""What an agent tells of its vehicle's parameters."""

from __future__ import annotations

from dataclasses import replace

import pytest

from agent.core.interface import FlightLimits
from agent.core.verticals import Verticals
from swarm.protocol.events import LogLine
from swarm.protocol.uav_messages import Calibration
from tests.support.builders import entry, uav
from tests.support.field_agent import FieldAgent
from tests.support.lone_agent import LoneAgent, said

LIMITS = FlightLimits(2.0, 0.8)
"""An agent's UAV is to fly 1 m/s fast."""


def calibrations(agent: LoneAgent) -> list[Calibration]:
    return said(agent.log, Calibration)


def briefed(agent: LoneAgent) -> LoneAgent:
    agent.fly_to(entry("t0", 100.0))
    return agent


def test_it_is_told_at_once_and_only_what_is_new() -> None:
    agent = briefed(FieldAgent())
    agent.happen(LIMITS)
    assert calibrations(agent) == [Calibration(1.0, 1.0, 0, acceleration_m_s2=2.0, speed_m_s=0.8)]
    agent.happen(FlightLimits(2.01, 0.8))  # hardly another
    assert len(calibrations(agent)) == 1
    agent.happen(FlightLimits(1.5, 0.8))
    assert calibrations(agent)[-1].acceleration_m_s2 == 1.5


def test_it_is_told_beside_landing_and_climbing_and_stays_when_these_change() -> None:
    agent = briefed(FieldAgent(verticals=Verticals()))
    agent.happen(LIMITS)
    told = calibrations(agent)[-1]
    assert told.land_s > 0.0
    assert (told.acceleration_m_s2, told.speed_m_s) == (2.0, 0.8)


def test_decisions_count_on_it() -> None:
    agent = briefed(FieldAgent())
    agent.happen(FlightLimits(None, 0.5))
    agent.start_mission()
    assert agent.claim is not None
    assert agent.claim.completion_s == pytest.approx(200.0)  # 100 m at half a metre a second


def test_the_scenarios_acceleration_and_a_speed_that_can_be_flown_are_not_told() -> None:
    agent = FieldAgent()
    specs = tuple(replace(spec, acceleration_m_s2=3.0) for spec in agent.brief.uavs)
    agent.brief = replace(agent.brief, uavs=specs)
    briefed(agent)
    agent.happen(FlightLimits(2.0, 12.0))
    assert calibrations(agent) == []


def test_in_a_mission_without_the_keys_of_the_field_nothing_is_told() -> None:
    agent = briefed(LoneAgent(uav("u0")))
    agent.happen(LIMITS)
    assert calibrations(agent) == []


def test_a_later_life_tells_nothing_that_is_known_already() -> None:
    agent = FieldAgent()
    briefed(agent)
    agent.happen(LIMITS)
    later = agent.next_life()
    before = len(later.log)
    later.happen(LIMITS)
    assert not [each for each in later.log[before:] if isinstance(each, LogLine)]
    later.happen(FlightLimits(1.0, 0.8))
    assert [each.text for each in later.log[before:] if isinstance(each, LogLine)] == [
        "flies by its parameters"
    ]
