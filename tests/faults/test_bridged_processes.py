"""Agents of real bridges die and start anew in flight, and operators step in."""

from __future__ import annotations

from functools import partial

import pytest

from agent.core.interface import GoTo, HandedOver, Hold, Return
from agent.vehicle.activity import FlightPhase
from agent.vehicle.config import CommandStyle
from coordinator.operator.commands import RequestResult
from sim.autopilot.firmware import FirmwareModelName
from sim.world.settings import RestartMemory
from swarm.protocol.messages import CommandKind
from swarm.protocol.uav_messages import StatusPhase
from tests.support.bridged_fleet import LIMIT_S, ONE_DIAGONAL, OTHER_DIAGONAL, BridgedFleet, Logbook
from tests.support.fake_copter import ARM, TAKEOFF

HOLD, RESUME, RETURN, ABORT = CommandKind
IN_FLIGHT_S = 15.0
"""On the way to the first task."""
LONG_S = 150.0


def commands(book: Logbook, *, life: int) -> set[int]:
    """Numbers of the commands that were sent in that life of the agent."""
    of_life = (sent for sent in book.sent if sent.life == life and not sent.harmless)
    return {sent.message.command for sent in of_life if sent.name.startswith("COMMAND")}


@pytest.mark.parametrize("found", [RestartMemory.DISK, RestartMemory.NONE])
@ONE_DIAGONAL
def test_an_agent_that_starts_anew_takes_its_vehicle_on_in_the_air(
    flavour: FirmwareModelName, style: CommandStyle, found: RestartMemory
) -> None:
    fleet = BridgedFleet(flavour, style)
    fleet.at(IN_FLIGHT_S, partial(fleet.world.crash, "u0"))
    fleet.at(IN_FLIGHT_S + 2.0, partial(fleet.world.restart, "u0", found))
    fleet.fly()

    fleet.assert_all_done()
    book = fleet.books["u0"]
    assert book.lives == 2
    assert fleet.done_by("u0") != ()
    assert not {ARM, TAKEOFF} & commands(book, life=2)
    assert book.reasons(HandedOver) == []
    assert fleet.phase("u0") is StatusPhase.HOME
    assert not fleet.vehicles["u0"].pilot().armed


@OTHER_DIAGONAL
def test_a_vehicle_that_fell_while_its_agent_was_down_is_not_started_again(
    flavour: FirmwareModelName, style: CommandStyle
) -> None:
    fleet = BridgedFleet(flavour, style, faults={"u0": "reboot@11"})
    fleet.at(14.0, partial(fleet.world.crash, "u0"))
    fleet.at(20.0, partial(fleet.world.restart, "u0", RestartMemory.DISK))
    assert fleet.world.run(LIMIT_S)

    assert fleet.books["u0"].lives == 2
    assert not {ARM, TAKEOFF} & commands(fleet.books["u0"], life=2)
    assert fleet.note("u0").startswith("it was left in the air and stands on the ground now")
    assert fleet.world.mission_state.result().open == ()
    assert fleet.done_by("u0") == ()


@ONE_DIAGONAL
def test_a_vehicle_whose_agent_stays_away_comes_home_if_a_mission_stands_on_it(
    flavour: FirmwareModelName, style: CommandStyle
) -> None:
    fleet = BridgedFleet(flavour, style)
    fleet.at(IN_FLIGHT_S, partial(fleet.world.crash, "u0"))
    fleet.fly()

    result = fleet.world.mission_state.result()
    assert result.open == ()
    assert result.lost_uavs == ("u0",)
    assert fleet.done_by("u0") == ()
    assert all(sent.at_s <= IN_FLIGHT_S for sent in fleet.books["u0"].sent)
    pilot = fleet.vehicles["u0"].pilot(LONG_S)
    comes_home = style is CommandStyle.MISSION
    assert pilot.armed is not comes_home


@OTHER_DIAGONAL
def test_a_vehicle_that_is_held_stays_where_it_is_until_it_may_go_on(
    flavour: FirmwareModelName, style: CommandStyle
) -> None:
    fleet = BridgedFleet(flavour, style)
    places = []

    def look() -> None:
        now_s = fleet.world.queue.now_s()
        places.append(fleet.vehicles["u0"].pilot().position_enu_m(now_s))

    fleet.say(IN_FLIGHT_S, HOLD, "u0")
    fleet.at(IN_FLIGHT_S + 5.0, look)
    fleet.at(IN_FLIGHT_S + 12.0, look)
    fleet.say(IN_FLIGHT_S + 12.0, RESUME, "u0")
    fleet.fly()

    fleet.assert_all_done()
    assert [seat.verdict and seat.verdict.result for seat in fleet.seats] == [
        RequestResult.OBEYED
    ] * 2
    assert places[0] == pytest.approx(places[1], abs=0.01)
    assert places[0][2] == pytest.approx(10.0, abs=0.5)
    orders = [type(order) for _, order in fleet.books["u0"].ordered]
    assert Hold in orders
    assert fleet.books["u0"].reasons(HandedOver) == []
    assert fleet.done_by("u0") != ()


@ONE_DIAGONAL
def test_a_vehicle_that_is_sent_home_takes_no_further_task(
    flavour: FirmwareModelName, style: CommandStyle
) -> None:
    fleet = BridgedFleet(flavour, style)
    fleet.say(IN_FLIGHT_S, RETURN, "u0")
    fleet.fly()

    fleet.assert_all_done(without=("u0",))
    assert [seat.verdict and seat.verdict.result for seat in fleet.seats] == [RequestResult.OBEYED]
    book = fleet.books["u0"]
    assert isinstance(book.ordered[-1][1], Return)
    last_targets = [
        sent for sent in book.sent if sent.phase is FlightPhase.FLYING and not sent.harmless
    ]
    assert max(sent.at_s for sent in last_targets) <= book.ordered[-1][0]
    assert not fleet.vehicles["u0"].pilot().armed


@OTHER_DIAGONAL
def test_an_abort_brings_every_vehicle_home(
    flavour: FirmwareModelName, style: CommandStyle
) -> None:
    fleet = BridgedFleet(flavour, style)
    fleet.say(IN_FLIGHT_S, ABORT)
    assert fleet.world.run(200.0)

    assert [seat.verdict and seat.verdict.result for seat in fleet.seats] == [RequestResult.OBEYED]
    assert fleet.world.mission_state.result().done == ()
    for uav, book in fleet.books.items():
        assert fleet.world.finished[uav] == 0
        assert [type(order) for _, order in book.ordered if isinstance(order, GoTo)] == [GoTo]
        assert not fleet.vehicles[uav].pilot().armed
