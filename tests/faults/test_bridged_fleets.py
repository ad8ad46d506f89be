"""Fleets of real bridges and simulated autopilots: what befalls a vehicle, and who does its tasks.

Two of three UAVs are struck in one flight, since a flight takes its time. Faults count from
the arming of their vehicle: 11 s later it is on its way to its first task.
"""

from __future__ import annotations

import math
import re
from dataclasses import replace

from agent.core.interface import (
    HandedOver,
    HandOverExplained,
    NotReady,
    Refused,
    ReturnAdvised,
    VehicleReady,
)
from agent.vehicle.config import CommandStyle
from sim.autopilot.firmware import FirmwareModelName
from sim.world.bridged_vehicle import Equipment
from swarm.protocol.uav_messages import StatusPhase
from tests.support.bridged_fleet import FIELD, ONE_DIAGONAL, OTHER_DIAGONAL, BridgedFleet, fenced

LONG_S = 150.0
"""By then a vehicle that comes home by itself is there."""


def assert_let_go(fleet: BridgedFleet, uav: str, reason: str) -> None:
    """It was handed over for that reason, says so, and was not commanded any more."""
    told = fleet.books[uav].reasons(HandedOver)
    assert len(told) == 1
    in_full = [*told, *fleet.books[uav].reasons(HandOverExplained)][-1]
    assert reason in in_full
    assert fleet.phase(uav) is StatusPhase.OUT
    assert fleet.note(uav) == in_full
    claim = fleet.world.mission_state.replica.claims[uav]
    assert (claim.task, claim.handed_over) == (None, True)
    fleet.assert_left_alone_after(uav, HandedOver)


def assert_sent_home(fleet: BridgedFleet, uav: str, reason: str) -> None:
    """It was advised to return for that reason, and did, commanded by nothing but that mode."""
    book = fleet.books[uav]
    told = book.reasons(ReturnAdvised)
    assert len(told) == 1
    assert reason in told[0]
    assert book.reasons(HandedOver) == []
    assert fleet.phase(uav) is StatusPhase.HOME
    assert fleet.note(uav) == told[0]
    assert not fleet.world.mission_state.replica.claims[uav].handed_over
    assert {line.split()[1] for line in book.commands_after(book.first_s(ReturnAdvised))} <= {
        "COMMAND_LONG"
    }
    assert not fleet.vehicles[uav].pilot().armed


@ONE_DIAGONAL
def test_a_pilot_and_a_reboot_take_vehicles_away(
    flavour: FirmwareModelName, style: CommandStyle
) -> None:
    fleet = BridgedFleet(flavour, style, faults={"u0": "pilot@11", "u2": "reboot@11"}).fly()

    fleet.assert_all_done(without=("u0", "u2"))
    assert_let_go(fleet, "u0", "its pilot switched it to ")
    assert_let_go(fleet, "u2", "the autopilot rebooted")
    assert fleet.vehicles["u0"].pilot(LONG_S).armed, "it is its pilot's to bring it home"
    assert not fleet.vehicles["u2"].pilot(LONG_S).armed, "nobody starts its motors again"


@OTHER_DIAGONAL
def test_low_batteries_go_home_and_failsafes_are_left_to_themselves(
    flavour: FirmwareModelName, style: CommandStyle
) -> None:
    faults = {"u0": "battery-low@11", "u2": "failsafe-rtl@11"}
    fleet = BridgedFleet(flavour, style, faults=faults).fly()

    fleet.assert_all_done(without=("u0", "u2"))
    assert_sent_home(fleet, "u0", "battery at 10%, below the reserve of 20%")
    if (flavour, style) == (FirmwareModelName.PX4, CommandStyle.REPOSITION):
        # It warns for some seconds in the mode in which it obeys, and is sent home meanwhile.
        assert_sent_home(fleet, "u2", "the autopilot reports a failsafe")
    else:
        assert_let_go(fleet, "u2", "a failsafe switched it to ")
    assert not fleet.vehicles["u2"].pilot(LONG_S).armed, "the failsafe has brought it home"


def assert_home_after_silence(fleet: BridgedFleet, uav: str) -> None:
    """It was handed over for its silence, and came home when it was heard again.

    Its mission brings it, if it flies one, and its agent otherwise.
    """
    book = fleet.books[uav]
    assert book.reasons(HandedOver) == ["nothing heard for 5 s"]
    by_mission = fleet.style is CommandStyle.MISSION
    assert fleet.phase(uav) is (StatusPhase.OUT if by_mission else StatusPhase.HOME)
    why = ": it flies its mission, which ends at home" if by_mission else ", as it was left"
    assert re.fullmatch(rf"heard again after \d+ s{why}", fleet.note(uav))
    if by_mission:
        fleet.assert_left_alone_after(uav, HandedOver)
    assert fleet.world.mission_state.replica.claims[uav].handed_over is by_mission
    assert not fleet.vehicles[uav].pilot(LONG_S).armed


@ONE_DIAGONAL
def test_who_is_silent_comes_home_once_it_is_heard_and_who_is_blind_is_left_alone(
    flavour: FirmwareModelName, style: CommandStyle
) -> None:
    """The silent one is heard again after 10 s, still flying to where it was sent."""
    faults = {"u0": "silent@11+10", "u2": "gps-lost@11"}
    fleet = BridgedFleet(flavour, style, faults=faults).fly()

    fleet.assert_all_done(without=("u0", "u2"))
    assert_home_after_silence(fleet, "u0")
    assert_let_go(fleet, "u2", "no valid position for 5 s")


@OTHER_DIAGONAL
def test_a_fix_that_comes_late_delays_the_takeoff_and_nothing_else(
    flavour: FirmwareModelName, style: CommandStyle
) -> None:
    fleet = BridgedFleet(flavour, style, faults={"u0": "gps-lost@0+15", "u2": "gps-lost@0+60"})
    fleet.fly()

    fleet.assert_all_done()
    assert fleet.books["u0"].first_s(VehicleReady) < 15.0 + 40.0
    for uav in ("u0", "u2"):
        assert (fleet.books[uav].reasons(Refused), fleet.phase(uav)) == ([], StatusPhase.HOME)
        assert fleet.books[uav].first_s(VehicleReady) > 15.0


@ONE_DIAGONAL
def test_who_cannot_arm_stays_and_who_does_not_move_gives_its_tasks_away(
    flavour: FirmwareModelName, style: CommandStyle
) -> None:
    faults = {"u0": "refuse-arming@0", "u2": "stuck@11"}
    fleet = BridgedFleet(flavour, style, faults=faults).fly()

    fleet.assert_all_done(without=("u0", "u2"))
    waits = [r.reason for _, r in fleet.books["u0"].reported if isinstance(r, NotReady)]
    assert waits[-1].startswith("pre-arm checks do not pass")
    assert not {"takeoff", "climbing"} & set(waits)
    assert not any(sent.name == "COMMAND_INT" for sent in fleet.books["u0"].sent)
    assert {"the vehicle stands still"} == {
        reason[:24] for reason in fleet.books["u2"].reasons(Refused)
    }
    assert fleet.phase("u2") is StatusPhase.HOME


@OTHER_DIAGONAL
def test_another_vehicle_than_the_configured_one_is_never_commanded(
    flavour: FirmwareModelName, style: CommandStyle
) -> None:
    def other(equipment: Equipment) -> Equipment:
        return replace(equipment, vehicle=replace(equipment.vehicle, system_id=42))

    fleet = BridgedFleet(
        flavour, style, change={"u0": other}, faults={"u2": "wrong-id@11+20"}
    ).fly()

    fleet.assert_all_done(without=("u0", "u2"))
    book = fleet.books["u0"]
    assert {sent.name for sent in book.sent} == {"HEARTBEAT"}
    assert "heartbeat of system id 1" in str(book.reported)
    assert_home_after_silence(fleet, "u2")


@ONE_DIAGONAL
def test_a_fence_keeps_targets_from_one_uav_and_brings_a_strayed_one_home(
    flavour: FirmwareModelName, style: CommandStyle
) -> None:
    fleet = BridgedFleet(flavour, style, change={"u0": fenced(75.0), "u2": fenced(130.0)})

    def blow() -> None:
        """Away from where it flies to, in whatever mode."""
        fleet.vehicles["u2"].pilot().flight.motion.fly_to(
            (24.0, 9000.0, 16.0), 14.0, fleet.world.queue.now_s()
        )

    fleet.at(16.0, blow)
    fleet.fly()

    fleet.assert_all_done(without=("u2",))
    refused = fleet.books["u0"].reasons(Refused)
    assert refused
    assert set(refused) == {"target is farther than 75 m from the origin"}
    near = {task.id for task in FIELD.tasks if math.hypot(*task.position_enu_m[:2]) <= 75.0}
    assert set(fleet.done_by("u0")) <= near
    assert_sent_home(fleet, "u2", "from the origin, outside the fence of 130 m")
