"""What befalls real bridges in a mission with a zone, a base and batteries for half of it."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial

import numpy as np
import pytest
import shapely

from agent.core.interface import GoTo, HandedOver, Home
from agent.vehicle.activity import FlightPhase
from agent.vehicle.config import CommandStyle
from coordinator.operator.commands import RequestResult
from coordinator.operator.readiness import ReadyRequest
from coordinator.operator.zone_edits import NewZone
from sim.autopilot.firmware import FirmwareModelName
from sim.world.settings import RestartMemory
from swarm.model import Zone, ZoneId
from tests.support.bridged_fleet import OTHER_DIAGONAL, long_flight
from tests.support.bridged_pasture import (
    BARN,
    PLACES,
    UAVS,
    PastureFleet,
    departs,
    in_phase,
    is_landed,
    pasture,
)
from tests.support.fake_copter import ARM

LIMIT_S = 900.0
FLED_S = 25
"""By then a UAV has left a zone that was drawn over it, and has it as its fence [s]."""
ENDURANCE_S = 155.0
TASKS = {f"t{number}" for number in range(len(PLACES))}


def assert_all_done(fleet: PastureFleet) -> None:
    """Every task, by vehicles that all came home by themselves."""
    result, told = fleet.world.mission_state.result(), "\n".join(fleet.told())
    assert set(result.done) == TASKS, told
    assert (result.failed, result.open) == ((), ()), told
    assert set(fleet.world.finished.values()) == {0}, told
    for uav in fleet.books:
        assert fleet.books[uav].reasons(HandedOver) == [], told
        assert not fleet.pilot(uav).armed, told
    fleet.assert_safe()


def draw_a_wall(fleet: PastureFleet, ahead_m: float) -> Zone:
    """Across the way of u1, so far ahead of it; nobody is forbidden to be there yet."""
    now_s = fleet.world.queue.now_s()
    east_m, north_m, _ = fleet.pilot("u1").position_enu_m(now_s)
    _, order = fleet.books["u1"].ordered[-1]
    assert isinstance(order, GoTo), "it flies to its first task"
    goal_m = order.position_enu_m
    away = np.array([goal_m[0] - east_m, goal_m[1] - north_m])
    along = away / np.linalg.norm(away)
    aside = np.array([-along[1], along[0]])
    here = np.array([east_m, north_m])
    corners = [
        here + (ahead_m + beyond_m) * along + side_m * aside
        for beyond_m, side_m in ((0, -40), (0, 40), (15, 40), (15, -40))
    ]
    polygon = tuple((float(east), float(north)) for east, north in corners)
    fleet.want(now_s, NewZone("wall", polygon))
    return Zone(ZoneId("wall"), polygon)


@long_flight(FirmwareModelName.PX4, CommandStyle.MISSION)
def test_a_zone_drawn_across_a_flown_path_is_flown_round(
    flavour: FirmwareModelName, style: CommandStyle
) -> None:
    """Far enough ahead: to brake for it takes its way."""
    fleet = PastureFleet(flavour, style, mission=pasture(300.0))
    fleet.once(
        "u1", in_phase(FlightPhase.FLYING), 2.0, lambda: fleet.zones.append(draw_a_wall(fleet, 60))
    )
    fleet.fly(LIMIT_S)

    assert [zone.id for zone in fleet.zones] == ["herd", "wall"]
    assert [seat.verdict and seat.verdict.result for seat in fleet.seats] == [RequestResult.OBEYED]
    assert_all_done(fleet)


@OTHER_DIAGONAL
@pytest.mark.parametrize("ahead_m", [2.0, pytest.param(8.0, marks=pytest.mark.slow), 14.0])
def test_a_zone_drawn_nearer_than_a_uav_can_brake_is_its_fence_once_it_is_outside(
    flavour: FirmwareModelName, style: CommandStyle, ahead_m: float
) -> None:
    """It slides in, and leaves by the shortest way; its own fence does not take it from us."""
    fleet = PastureFleet(flavour, style, mission=pasture(300.0))
    inside: list[bool] = []
    areas: list[int] = []

    def draw() -> None:
        wall = draw_a_wall(fleet, ahead_m).shape()

        def look() -> None:
            pilot = fleet.pilot("u1")
            here_m = pilot.position_enu_m(fleet.world.queue.now_s())[:2]
            inside.append(wall.contains(shapely.Point(here_m)))
            areas.append(pilot.fence.area_count)

        for later_s in range(FLED_S):
            fleet.at(fleet.world.queue.now_s() + later_s, look)

    fleet.once("u1", in_phase(FlightPhase.FLYING), 4.0, draw)
    fleet.fly(LIMIT_S)

    assert any(inside), "it could not brake"
    assert not inside[-1]
    assert (areas[0], areas[-1]) == (1, 2), areas
    assert_all_done(fleet)


@pytest.mark.parametrize(
    ("flavour", "style", "said"),
    [
        (FirmwareModelName.ARDUPILOT, CommandStyle.MISSION, True),
        (FirmwareModelName.PX4, CommandStyle.REPOSITION, False),
        *(
            pytest.param(*case, marks=pytest.mark.slow)
            for case in (
                (FirmwareModelName.ARDUPILOT, CommandStyle.MISSION, False),
                (FirmwareModelName.PX4, CommandStyle.REPOSITION, True),
            )
        ),
    ],
)
def test_a_base_that_a_dead_uav_blocks_is_used_again_only_if_the_operator_says_so(
    flavour: FirmwareModelName, style: CommandStyle, said: bool
) -> None:
    fleet = PastureFleet(flavour, style, mission=pasture(ENDURANCE_S))
    first: list[str] = []

    def die(uav: str) -> None:
        """Whoever lands first never gets up again, and stands on the only slot."""
        if not first:
            first.append(uav)
            fleet.world.crash(uav)

    def say() -> None:
        """The other one has come down beside the slots."""
        swaps_then.append(sum(map(fleet.swaps, UAVS)))
        if said:
            fleet.want(fleet.world.queue.now_s(), ReadyRequest(first[0]))

    swaps_then: list[int] = []
    for uav in UAVS:
        fleet.once(uav, is_landed, 1.0, partial(die, uav))
        fleet.once(uav, lambda report: isinstance(report, Home), 5.0, say)
    fleet.world.run(LIMIT_S)

    (other,) = set(UAVS) - set(first)
    done, told = set(fleet.world.mission_state.result().done), "\n".join(fleet.told())
    assert swaps_then[0] == 0, "nobody has landed where somebody stands"
    assert (fleet.swaps(other) > 0) is said, told
    assert (done == TASKS) is said, told
    assert fleet.world.finished[other] == 0, told
    assert not fleet.pilot(other).armed, told
    fleet.assert_safe()


@long_flight(FirmwareModelName.ARDUPILOT, CommandStyle.REPOSITION)
def test_where_no_swap_is_confirmed_nobody_starts_and_with_the_word_all_goes_on(
    flavour: FirmwareModelName, style: CommandStyle
) -> None:
    fleet = PastureFleet(flavour, style, by_itself=False, mission=pasture(ENDURANCE_S))
    quiet_s = 400.0
    stood: list[bool] = []

    def look() -> None:
        for uav in UAVS:
            landed_s = fleet.books[uav].first_s(type_of_landing(fleet, uav))
            arms = [sent for sent in fleet.books[uav].sent if sent.at_s > landed_s]
            stood.append(not any(getattr(s.message, "command", 0) == ARM for s in arms))

    def say() -> None:
        """Of whoever waits for it."""
        now_s = fleet.world.queue.now_s()
        for uav in UAVS:
            if "swarm ready" in fleet.note(uav):
                fleet.want(now_s, ReadyRequest(uav))
        fleet.at(now_s + 15.0, say)

    fleet.at(quiet_s, look)
    fleet.at(quiet_s, say)
    fleet.fly(LIMIT_S)

    assert stood == [True, True]
    assert_all_done(fleet)


def type_of_landing(fleet: PastureFleet, uav: str) -> type:
    """The report that it stands at its base, or that it has come down beside the slots."""
    kinds = [type(said) for _, said in fleet.books[uav].reported]
    return next(kind for kind in kinds if kind.__name__ in ("Landed", "Home"))


@long_flight(FirmwareModelName.PX4, CommandStyle.REPOSITION)
def test_a_battery_that_drains_twice_as_fast_is_changed_in_time(
    flavour: FirmwareModelName, style: CommandStyle
) -> None:
    plain = PastureFleet(flavour, style, mission=pasture(300.0))
    plain.fly(LIMIT_S)
    fleet = PastureFleet(flavour, style, mission=pasture(300.0), drain=2.0)
    fleet.fly(LIMIT_S)

    assert sum(map(plain.swaps, UAVS)) < sum(map(fleet.swaps, UAVS))
    rates = fleet.world.mission_state.replica.calibrations
    assert max(rates[uav].drain_frac for uav in UAVS) > 1.5
    assert_all_done(fleet)


MOMENTS = ("landing", "swapping", "climbing")
KILLS = [
    pytest.param(seed, moment, marks=() if seed == number % 2 else pytest.mark.slow)
    for number, moment in enumerate(MOMENTS)
    for seed in range(40)
]
"""By day one at each moment, of both kinds of firmware and of ways to command."""


@pytest.mark.parametrize(("seed", "moment"), KILLS)
def test_an_agent_killed_at_its_base_goes_on_where_its_vehicle_is(seed: int, moment: str) -> None:
    """Killed at any moment from the order to land until it has climbed, for any while."""
    rng = np.random.default_rng([seed, MOMENTS.index(moment)])
    flavour = list(FirmwareModelName)[seed % 2]
    style = list(CommandStyle)[(seed // 2 + MOMENTS.index(moment)) % 2]
    fleet = PastureFleet(flavour, style, mission=pasture(ENDURANCE_S), seed=seed)
    found = list(RestartMemory)[int(rng.integers(2))]
    begins: dict[str, tuple[Callable[[str], Callable[..., bool]], float]] = {
        "landing": (lambda _: in_phase(FlightPhase.LANDING), 25.0),
        "swapping": (lambda _: is_landed, BARN.swap_s),
        "climbing": (partial(departs, fleet), 15.0),
    }
    begun, lasts_s = begins[moment]
    down_s = float(rng.choice([0.3, 2.0, 8.0, 25.0]))
    killed: list[str] = []

    def kill(uav: str) -> None:
        """Whoever does it first."""
        if killed:
            return
        killed.append(uav)
        fleet.world.crash(uav)
        back_s = fleet.world.queue.now_s() + down_s
        fleet.at(back_s, partial(fleet.world.restart, uav, found))

    after_s = float(rng.uniform(0.0, lasts_s))
    for uav in UAVS:
        fleet.once(uav, begun(uav), after_s, partial(kill, uav))
    fleet.fly(LIMIT_S)

    assert [fleet.books[uav].lives for uav in killed] == [2]
    assert_all_done(fleet)
