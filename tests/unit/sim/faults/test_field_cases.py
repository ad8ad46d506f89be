"""Cases in the field: sound missions with every constraint, and what can go wrong only there."""

from __future__ import annotations

from functools import partial

import numpy as np
import pytest

from coordinator.planner.field_plan import is_field
from sim.faults.case import FIRST_IN_FIELD, Case, play
from sim.faults.drawn_zones import zone_over
from sim.faults.field_missions import fair_drain_frac
from sim.faults.generator import random_case
from sim.faults.schedule import FIELD_KINDS, PLAIN_KINDS, Disturbance, DisturbanceKind
from swarm.allocation.legs import Airspace

SEEDS = range(FIRST_IN_FIELD, FIRST_IN_FIELD + 30)


def largest(seed: int) -> Case:
    return Case(seed, 6, 15, popups=3)


def test_a_smaller_mission_is_a_part_of_the_larger_one() -> None:
    for seed in SEEDS[:5]:
        small, large = Case(seed, 2, 4, popups=3).flown(), largest(seed).flown()

        assert (small.uavs, small.tasks) == (large.uavs[:2], large.tasks[:4])
        assert (small.bases, small.zones, small.wind_enu_m_s) == (
            large.bases,
            large.zones,
            large.wind_enu_m_s,
        )


def test_every_place_is_outside_of_all_zones() -> None:
    for seed in SEEDS:
        mission = largest(seed).flown()
        places = [uav.position_enu_m for uav in mission.uavs]
        places += [base.position_enu_m for base in mission.bases]
        places += [
            point for task in mission.tasks for point in task.path_enu_m or (task.position_enu_m,)
        ]
        planner = Airspace(mission.zones, mission.zone_margin_m).concerning(-1e6, 1e6)

        assert is_field(mission)
        assert planner.free(np.array(places)[:, :2]).all()


def test_all_constraints_are_drawn() -> None:
    missions = [largest(seed).flown() for seed in SEEDS]
    tasks = [task for mission in missions for task in mission.tasks]
    uavs = [uav for mission in missions for uav in mission.uavs]

    assert any(mission.zones for mission in missions)
    assert any(mission.zone_margin_m > 0.0 for mission in missions)
    assert any(mission.wind_enu_m_s != (0.0, 0.0) for mission in missions)
    assert {base.slots for mission in missions for base in mission.bases} == {None, 1, 2}
    for name in ("due_s", "closes_s", "height_m"):
        assert 0 < sum(getattr(task, name) is not None for task in tasks) < len(tasks)
    for name in ("endurance_s", "acceleration_m_s2", "airspeed_m_s"):
        assert 0 < sum(getattr(uav, name) is not None for uav in uavs) < len(uavs)
    assert any(task.path_enu_m for task in tasks)
    assert any(task.opens_s > 0.0 for task in tasks)


def test_what_goes_wrong_elsewhere_stays_what_it_was() -> None:
    for seed in SEEDS:
        both = random_case(seed).schedule

        plain = tuple(each for each in both if each.kind not in FIELD_KINDS)
        assert plain == random_case(seed, PLAIN_KINDS).schedule
        assert 1 <= len(both) - len(plain) <= 3
    assert random_case(7).schedule == random_case(7, PLAIN_KINDS).schedule
    assert random_case(7, FIELD_KINDS).schedule == ()


def test_no_battery_drains_faster_than_its_reserve_allows() -> None:
    drains = [
        (fair_drain_frac(case.flown(), each.names[0]), each.amount or 0.0)
        for case in map(random_case, SEEDS)
        for each in case.schedule
        if each.kind is DisturbanceKind.DRAIN
    ]

    assert drains
    assert all(0.0 < amount <= max(0.01, most + 0.005) for most, amount in drains)
    assert max(amount for _, amount in drains) > 0.5


def test_a_zone_is_drawn_over_a_uav_in_the_air_but_over_no_start_or_base(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    world = play(Case(FIRST_IN_FIELD + 3, 3, 15)).world
    tracks = {uav: list(track.flights_s) for uav, track in world.tracks.items()}
    drawn = 0
    for uav in tracks:
        for at_s in np.arange(2.0, 60.0, 4.0).tolist():
            monkeypatch.setattr(world.queue, "now_s", partial(float, at_s))
            wish = zone_over(world, uav, 1.0, "drawn")
            place = world.tracks[uav].position_enu_m(at_s)
            if wish is None:
                continue
            drawn += 1
            assert place is not None
            zone = wish.spec(None).zone()
            margin_m = world.mission.zone_margin_m
            planner = Airspace((zone,), margin_m).concerning(-1e6, 1e6)
            landings = [uav.position_enu_m[:2] for uav in world.mission.uavs]
            landings += [base.position_enu_m[:2] for base in world.mission.bases]
            assert planner.free(np.array(landings)).all()
            assert not planner.free(np.array([place[:2]]))[0]
    assert drawn > 0


@pytest.mark.parametrize("lasts_s", [None, 3.0])
def test_a_drawn_zone_reaches_everybody_and_is_taken_away(lasts_s: float | None) -> None:
    over = Disturbance(20.0, DisturbanceKind.ZONE, ("u0",), lasts_s=lasts_s, amount=0.5)
    done = play(Case(FIRST_IN_FIELD + 3, 3, 15, schedule=(over,)))

    assert done.broken is None
    told = " ".join(line.text for line in done.world.mission_state.story)
    assert "draws zone drawn-0" in told
    assert ("takes zone drawn-0 away" in told) == (lasts_s is not None)


def test_a_battery_drains_faster_from_then_on() -> None:
    seed = FIRST_IN_FIELD + 3
    mission = Case(seed, 3, 15).flown()
    uav = next(str(each.id) for each in mission.uavs if each.endurance_s is not None)
    drain = Disturbance(5.0, DisturbanceKind.DRAIN, (uav,), amount=1.0)
    worlds = [play(Case(seed, 3, 15, schedule=each)).world for each in ((), (drain,))]
    seen = [world.flight_log.last_seen[uav].battery_frac for world in worlds]

    assert seen[0] != seen[1]
