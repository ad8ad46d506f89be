"""Fleets that fly otherwise than their mission says find it out, and come home in time."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
import pytest

from coordinator.mission_view.mission_state import MissionState
from sim.world import field_vehicle
from sim.world.redecision import redecide
from sim.world.simulation import SimulatedMission, simulate_mission
from sim.world.uncertainty import Uncertainty
from swarm.model import Base, BaseId, Mission, Task, TaskId, Uav, UavId
from swarm.protocol.calibration import FlightRates
from swarm.protocol.events import CommonAction, CommonEvent
from swarm.protocol.timing import Timing
from tests.support.builders import MISSION

SLOW = Uncertainty(speed_frac=0.8, drain_frac=1.25)
RESERVE_FRAC = 0.2


def mission(seed: int, n_uav: int = 3, n_task: int = 15) -> Mission:
    """UAVs that have to swap their batteries on the way."""
    rng = np.random.default_rng(seed)
    return Mission(
        name=MISSION,
        horizon_s=2500.0,
        uavs=tuple(
            Uav(
                UavId(f"u{number}"),
                (20.0 * number, 0.0, 0.0),
                10.0,
                acceleration_m_s2=2.5,
                endurance_s=420.0,
                reserve_frac=RESERVE_FRAC,
            )
            for number in range(n_uav)
        ),
        tasks=tuple(
            Task(TaskId(f"t{number}"), (*rng.uniform(-400.0, 400.0, 2).tolist(), 0.0), 1.0, 10.0)
            for number in range(n_task)
        ),
        bases=(Base(BaseId("b0"), (0.0, 0.0, 0.0), 60.0, 1),),
    )


@dataclass
class Onlooker:
    """A mission state, and all that it has heard."""

    state: MissionState
    facts: list[CommonEvent]

    def start(self, now_s: float) -> Sequence[CommonAction]:
        return self.state.start(now_s)

    def step(self, event: CommonEvent, now_s: float) -> Sequence[CommonAction]:
        self.facts.append(event)
        return self.state.step(event, now_s)

    def next_deadline_s(self) -> float | None:
        return self.state.next_deadline_s()


def fly(
    flown: Mission, uncertainty: Uncertainty, facts: list[CommonEvent] | None = None
) -> SimulatedMission:
    heard: list[CommonEvent] = [] if facts is None else facts

    def look_on(state: MissionState, timing: Timing) -> Onlooker:
        del timing
        return Onlooker(state, heard)

    return simulate_mission(
        flown, method="greedy", seed=0, uncertainty=uncertainty, make_observer=look_on
    )


@pytest.fixture
def charges(monkeypatch: pytest.MonkeyPatch) -> list[float]:
    """Charge of every vehicle at every touch-down."""
    found: list[float] = []
    touch_down = field_vehicle.FieldVehicle._touch_down

    def look(
        vehicle: field_vehicle.FieldVehicle, place_enu_m: tuple[float, float, float], now_s: float
    ) -> None:
        touch_down(vehicle, place_enu_m, now_s)
        if vehicle.battery is not None:
            found.append(vehicle.battery.frac(now_s))

    monkeypatch.setattr(field_vehicle.FieldVehicle, "_touch_down", look)
    return found


@pytest.mark.parametrize("seed", range(2))
def test_slow_uavs_with_weak_batteries_are_known_for_it_and_keep_their_reserve(
    seed: int, charges: list[float]
) -> None:
    flown = fly(mission(seed), SLOW)

    assert flown.result.rates == {f"u{number}": FlightRates(1.25, 1.25) for number in range(3)}
    assert not flown.result.open
    assert not flown.lost_because
    assert min(charges) >= RESERVE_FRAC - 0.01  # of what the first legs could not tell yet


def test_estimates_are_there_after_few_legs() -> None:
    flown = fly(mission(0), SLOW)
    replica = flown.world.agents["u0"].replica
    assert max(told.legs for told in replica.calibrations.values()) <= 4


def test_every_choice_of_such_a_flight_comes_out_the_same_again() -> None:
    facts: list[CommonEvent] = []
    fly(mission(1), SLOW, facts)

    again = redecide(facts)
    assert again.ok
    assert again.without_inputs == 0
    assert again.agreeing >= 15


def test_who_flies_as_planned_tells_nothing() -> None:
    flown = fly(mission(0), Uncertainty())

    assert flown.result.rates == {}
    for agent in flown.world.agents.values():
        assert not agent.replica.calibrations


def test_speeds_are_found_where_only_acceleration_is_given() -> None:
    plain = mission(2)
    uavs = tuple(replace(uav, endurance_s=None) for uav in plain.uavs)
    plain = replace(plain, uavs=uavs, bases=())
    facts: list[CommonEvent] = []
    flown = fly(plain, Uncertainty(speed_frac=0.8), facts)

    assert flown.result.rates.keys() == {"u0", "u1", "u2"}
    assert all(1.1 <= each.time_frac <= 1.25 for each in flown.result.rates.values())
    again = redecide(facts)
    assert again.ok
    assert again.without_inputs == 0


def test_without_acceleration_airspeed_and_endurance_nothing_is_measured() -> None:
    plain = mission(2)
    uavs = tuple(replace(uav, endurance_s=None, acceleration_m_s2=None) for uav in plain.uavs)
    flown = fly(replace(plain, uavs=uavs, bases=()), Uncertainty(speed_frac=0.8))

    assert not flown.world.agents["u0"].replica.calibrations
