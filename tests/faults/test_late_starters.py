"""Fleets of which one does not get ready: the others start without it, and it joins when it can."""

from __future__ import annotations

from dataclasses import replace
from functools import partial

from agent.core.interface import VehicleReady
from agent.vehicle.config import CommandStyle
from coordinator.operator.commands import StartRequest
from coordinator.operator.requests import OperatorClient
from sim.autopilot.firmware import FirmwareModelName
from sim.world.settings import RestartMemory
from swarm.protocol.timing import Timing
from swarm.protocol.uav_messages import StatusPhase
from tests.support.bridged_fleet import FIELD, ONE_DIAGONAL, OTHER_DIAGONAL, BridgedFleet

HOVER_S, RESTART_S = 20.0, 4.0
TIMING = Timing(status_s=1.0, hover_s=HOVER_S, restart_s=RESTART_S)
SLOW = replace(FIELD, tasks=tuple(replace(task, service_s=12.0) for task in FIELD.tasks))
"""Work enough for whoever comes half a minute later."""


def hovered_s(fleet: BridgedFleet) -> float:
    """How long the first in the air waited for the start."""
    assert fleet.world.zero_s is not None
    ready_s = min(fleet.books[uav].first_s(VehicleReady) for uav in ("u1", "u2"))
    return fleet.world.zero_s - ready_s


@ONE_DIAGONAL
def test_one_whose_agent_died_is_not_waited_for_and_joins_when_it_is_back(
    flavour: FirmwareModelName, style: CommandStyle
) -> None:
    fleet = BridgedFleet(flavour, style, mission=SLOW, timing=TIMING)
    fleet.at(2.0, partial(fleet.world.crash, "u0"))
    fleet.at(30.0, partial(fleet.world.restart, "u0", RestartMemory.NONE))
    fleet.fly()

    assert hovered_s(fleet) < 2.0 * RESTART_S
    assert fleet.world.mission_state.result().open == ()
    assert fleet.done_by("u0") != ()
    assert fleet.phase("u0") is StatusPhase.HOME
    assert set(fleet.world.finished.values()) == {0}


@OTHER_DIAGONAL
def test_on_the_operators_word_the_others_start_at_once(
    flavour: FirmwareModelName, style: CommandStyle
) -> None:
    fleet = BridgedFleet(
        flavour, style, mission=SLOW, timing=TIMING, faults={"u0": "gps-lost@0+35"}
    )
    said_s = HOVER_S
    seats: list[OperatorClient] = []
    fleet.at(said_s, lambda: seats.append(fleet.world.operate(StartRequest("u0", "no GPS"))))
    fleet.fly()

    assert fleet.world.zero_s is not None
    assert said_s <= fleet.world.zero_s < said_s + 2.0
    assert [seat.verdict and seat.verdict.text for seat in seats] == [
        "the mission has started without u0"
    ]
    assert fleet.done_by("u0") != ()
    fleet.assert_all_done()


@ONE_DIAGONAL
def test_one_that_gets_ready_too_late_joins_the_mission_that_runs(
    flavour: FirmwareModelName, style: CommandStyle
) -> None:
    fleet = BridgedFleet(
        flavour, style, mission=SLOW, timing=TIMING, faults={"u0": "gps-lost@0+35"}
    )
    fleet.fly()

    assert fleet.world.zero_s is not None
    assert HOVER_S - 1.0 < hovered_s(fleet) < HOVER_S + 2.0
    assert fleet.books["u0"].first_s(VehicleReady) > fleet.world.zero_s
    assert fleet.done_by("u0") != ()
    fleet.assert_all_done()
