"""Fleets of real bridges and simulated autopilots whose MAVLink links lose frames or go silent."""

from __future__ import annotations

import pytest

from agent.core.interface import HandedOver, VehicleReport
from agent.vehicle.config import CommandStyle
from sim.autopilot.firmware import FirmwareModelName
from sim.world.bridged_vehicle import LinkQuality
from swarm.protocol.uav_messages import StatusPhase
from tests.support.bridged_fleet import KINDS, BridgedFleet, Sent

SEEDS = [2, *(pytest.param(seed, marks=pytest.mark.slow) for seed in (0, 3))]
"""Seeds of lost frames; of 1, five answers in a row are lost."""


def cut_in_upload(flavour: FirmwareModelName, silent_s: float) -> BridgedFleet:
    """The link of ``u0`` falls silent when half of a mission to its first task is sent."""
    fleet = BridgedFleet(flavour, CommandStyle.MISSION)
    items: list[float] = []

    def watch(uav: str, said: Sent | VehicleReport) -> None:
        begun = uav == "u0" and fleet.world.zero_s is not None
        if begun and isinstance(said, Sent) and said.name == "MISSION_ITEM_INT":
            items.append(said.at_s)
            if len(items) == 2:
                fleet.vehicles["u0"].cut(silent_s)

    fleet.on_said = watch
    return fleet.fly()


@pytest.mark.parametrize("flavour", list(FirmwareModelName))
def test_an_upload_that_was_cut_goes_on_after_a_short_silence(flavour: FirmwareModelName) -> None:
    fleet = cut_in_upload(flavour, 3.0)

    fleet.assert_all_done()
    assert fleet.books["u0"].reasons(HandedOver) == []
    assert fleet.done_by("u0") != ()
    assert fleet.phase("u0") is StatusPhase.HOME


@pytest.mark.parametrize("flavour", list(FirmwareModelName))
def test_a_long_silence_in_an_upload_leaves_the_vehicle_hovering_or_on_its_way_home(
    flavour: FirmwareModelName,
) -> None:
    """What the vehicle has no whole mission for it does not fly."""
    fleet = cut_in_upload(flavour, 12.0)

    fleet.assert_all_done(without=("u0",))
    assert fleet.books["u0"].reasons(HandedOver) == ["nothing heard for 5 s"]
    fleet.assert_left_alone_after("u0", HandedOver)
    east_m, north_m, _ = (
        fleet.vehicles["u0"].pilot(60.0).position_enu_m(fleet.world.queue.now_s() + 60.0)
    )
    assert abs(east_m) < 1.0
    assert abs(north_m) < 1.0


@pytest.mark.parametrize("seed", SEEDS)
@pytest.mark.parametrize(("flavour", "style"), KINDS)
def test_a_fifth_of_all_frames_lost_each_way_keeps_nobody_from_its_tasks(
    flavour: FirmwareModelName, style: CommandStyle, seed: int
) -> None:
    fleet = BridgedFleet(flavour, style, seed=seed, link=LinkQuality(0.05, 0.2)).fly()

    fleet.assert_all_done()
    for uav, book in fleet.books.items():
        assert book.reasons(HandedOver) == []
        assert 0 < len(fleet.done_by(uav)) <= book.arrivals()
        assert fleet.phase(uav) is StatusPhase.HOME
