"""Vehicles whose ways meet keep their distance and all come home, on every firmware and style."""

from __future__ import annotations

import math

import pytest

from agent.vehicle.config import CommandStyle
from sim.autopilot.firmware import FirmwareModelName
from sim.faults.injector import FaultInjector
from sim.faults.invariants import InvariantChecker
from sim.world.engine import EventQueue
from sim.world.network import NetworkConditions
from sim.world.rough_network import RoughNetwork
from swarm.model.ids import COORDINATOR
from tests.support.bridged_crossings import (
    SEPARATION_M,
    CrossingFleet,
    mission_of,
    random_mission,
    roughness,
)
from tests.support.bridged_fleet import KINDS, ONE_DIAGONAL, OTHER_DIAGONAL

LONGEST_S = 2_400.0
"""No flight takes longer, keepers of air that are lost until their batteries are empty included."""
FORSAKEN = "no coordinator and nothing left to do"
CROSSING = mission_of(((-80.0, 0.0), (80.0, 0.0)), ((0.0, -80.0), (0.0, 80.0)))
HEAD_ON = mission_of(((-80.0, 0.0), (80.0, 0.0)), ((80.0, 0.0), (-80.0, 0.0)))


@ONE_DIAGONAL
def test_two_that_cross_keep_their_distance(
    flavour: FirmwareModelName, style: CommandStyle, monkeypatch: pytest.MonkeyPatch
) -> None:
    fleet = CrossingFleet(monkeypatch, flavour, style, CROSSING)

    fleet.fly()

    fleet.assert_all_done()
    assert fleet.nearest_m >= SEPARATION_M, fleet.nearest
    assert not fleet.made_room("u0") or not fleet.made_room("u0")[-1].stands
    assert any(order.stands or order.path_enu_m for order in fleet.made_room("u1"))


@OTHER_DIAGONAL
def test_two_that_meet_head_on_pass_each_other(
    flavour: FirmwareModelName, style: CommandStyle, monkeypatch: pytest.MonkeyPatch
) -> None:
    fleet = CrossingFleet(monkeypatch, flavour, style, HEAD_ON)

    fleet.fly()

    fleet.assert_all_done()
    assert fleet.nearest_m >= SEPARATION_M, fleet.nearest
    assert any(order.path_enu_m for order in fleet.made_room("u1"))


def test_without_giving_way_they_would_meet(monkeypatch: pytest.MonkeyPatch) -> None:
    kind = (FirmwareModelName.ARDUPILOT, CommandStyle.REPOSITION)
    fleet = CrossingFleet(monkeypatch, *kind, HEAD_ON, gives_way=False)

    fleet.fly()

    assert fleet.nearest_m < 1.0


@pytest.mark.slow
def test_eight_through_one_point_all_get_through(monkeypatch: pytest.MonkeyPatch) -> None:
    ways = []
    for number in range(8):
        east, north = (90.0 * f(number * math.pi / 4.0) for f in (math.cos, math.sin))
        ways.append(((east, north), (-east, -north)))
    kind = (FirmwareModelName.ARDUPILOT, CommandStyle.REPOSITION)
    fleet = CrossingFleet(monkeypatch, *kind, mission_of(*ways))

    fleet.fly(600.0)

    fleet.assert_all_done()
    assert fleet.nearest_m >= SEPARATION_M, fleet.nearest


ROUGH = [
    pytest.param(
        seed,
        planned,
        marks=() if seed == 1 - planned or (seed, planned) == (3, True) else pytest.mark.slow,
        id=f"{seed}-{'planned' if planned else 'by giving way alone'}",
    )
    for seed in range(100)
    for planned in (True, False)
]
"""By day one of each, and one in which the last words of a UAV are heard by some alone."""


@pytest.mark.parametrize(("seed", "planned"), ROUGH)
def test_random_ways_with_all_that_goes_wrong(
    seed: int, planned: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Accelerations, wind, places 1 m off, losses, agents that die or hang, parted fleets."""
    flavour, style = KINDS[seed % len(KINDS)]
    drawn = roughness(random_mission(seed), seed, planned=planned)
    judge, networks = InvariantChecker(), list[RoughNetwork]()

    def network(queue: EventQueue) -> RoughNetwork:
        conditions = NetworkConditions(loss_frac=drawn.loss_frac)
        networks.append(RoughNetwork(queue, conditions, seed))
        return networks[0]

    fleet = CrossingFleet(
        monkeypatch,
        flavour,
        style,
        drawn.mission,
        seed=seed,
        network=network,
        planned=planned,
        rough=drawn,
        watch=judge,
    )
    injector = FaultInjector(fleet.world, networks[0], drawn.schedule)
    judge.attend(fleet.world, networks[0], injector)

    fleet.world.run(LONGEST_S)

    judge.conclude()

    told = "\n".join((*map(str, drawn.schedule), str(fleet.nearest), *fleet.told()))
    assert judge.broken is None, f"{judge.broken}\n{told}"
    assert fleet.nearest_m >= SEPARATION_M, told
    assert set(fleet.world.alive) <= drawn.for_good, told
    flies = {f"t{n}": uav for n, uav in enumerate(fleet.books) if uav not in drawn.for_good}
    if fleet.world.zero_s is None:  # its coordinator was lost before: nobody else begins a mission
        assert COORDINATOR in drawn.for_good, told
        assert {fleet.note(uav) for uav in flies.values()} == {FORSAKEN}, told
        return
    done = set(fleet.world.mission_state.result().done)
    kept_from = {task for task, uav in flies.items() if judge.shut_air.keeps_from(uav, task)}
    assert flies.keys() - kept_from <= done, told


@ONE_DIAGONAL
def test_who_starts_side_by_side_takes_off_and_lands_one_after_the_other(
    flavour: FirmwareModelName, style: CommandStyle, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Three starts 3 m apart, in layers of their own; all come home at once."""
    ways = [((3.0 * n, 0.0), (-30.0 + 30.0 * n, 60.0)) for n in range(3)]
    fleet = CrossingFleet(monkeypatch, flavour, style, mission_of(*ways, band_m=(15.0, 60.0)))

    fleet.fly(900.0)

    fleet.assert_all_done()
    assert fleet.nearest_m >= SEPARATION_M - 1.0, fleet.nearest
