"""Cases with positions that are off and losses all along: what they are, and how judged."""

from __future__ import annotations

import math
from collections import Counter
from dataclasses import replace

import pytest

from sim.faults.case import (
    FIRST_ASTRAY,
    FIRST_OF_MANY,
    Case,
    format_case,
    most_of,
    parse_case,
    play,
)
from sim.faults.generator import ASTRAY_M, random_case
from sim.faults.invariants import InvariantChecker
from sim.faults.soak import shrink
from sim.world.field_vehicle import FieldVehicle
from sim.world.virtual_world import World
from swarm.protocol.timing import PRESETS, LinkKind

MANY = range(FIRST_ASTRAY, FIRST_ASTRAY + 400)
SEEDS = MANY[:40]


def test_fleets_are_small_as_a_rule_and_large_at_times() -> None:
    uavs = Counter(most_of(seed)[0] for seed in MANY)

    assert set(uavs) <= set(range(2, 41))
    assert all(uavs[count] >= 10 for count in range(2, 7))
    assert 20 <= sum(number for count, number in uavs.items() if count > 6) <= 100
    assert any(count > 15 for count in uavs)


def test_two_of_three_lose_messages_and_all_positions_are_off() -> None:
    cases = [random_case(seed) for seed in SEEDS]
    lost = [case.loss_frac for case in cases]

    assert all(case.astray_m == ASTRAY_M == 1.0 for case in cases)
    assert max(lost) <= 0.2
    assert all(case.uavs == most_of(case.seed)[0] for case in cases)
    assert sum(share > 0.1 for share in lost) >= 4
    assert 5 <= lost.count(0.0) <= 20
    before = random_case(FIRST_OF_MANY + 5)
    assert (before.loss_frac, before.astray_m) == (0.0, 0.0)


def test_timers_are_those_for_so_many_losses() -> None:
    good, bad = (Case(1, 2, 3, loss_frac=share).link() for share in (0.05, 0.06))

    assert (good.lease_s, good.timing.silence_s) == (1.5, 5.0)
    assert bad == replace(
        PRESETS[LinkKind.BAD], timing=replace(PRESETS[LinkKind.BAD].timing, status_s=2.0)
    )


def test_vehicles_are_beside_where_they_tell_to_be_by_a_metre_at_most() -> None:
    offsets_m, changes = list[float](), set[tuple[str, float]]()
    for seed in (FIRST_ASTRAY + 5, FIRST_ASTRAY + 9):
        world = play(replace(random_case(seed), schedule=())).world
        for uav, vehicle in world._vehicles.items():
            assert isinstance(vehicle, FieldVehicle)
            off_m = vehicle._astray_m
            offsets_m.append(math.hypot(*off_m))
            changes.add((uav, off_m[2]))
    assert max(offsets_m) <= ASTRAY_M
    assert min(offsets_m) > 0.0
    assert len(changes) == len(offsets_m)


def test_a_case_with_them_is_read_as_it_was_written_and_made_plainer() -> None:
    for seed in SEEDS:
        case = random_case(seed)
        assert parse_case(format_case(case).splitlines(), "case") == case

    small = shrink(random_case(FIRST_ASTRAY + 3), lambda case: case.astray_m > 0.0)
    assert (small.loss_frac, small.astray_m) == (0.0, ASTRAY_M)


@pytest.mark.parametrize("words", ["loss=1.5", "astray=-1", "astray=inf", "loss=nan"])
def test_what_cannot_be_is_refused(words: str) -> None:
    key, value = words.split("=")
    named = {"loss": "loss_frac", "astray": "astray_m"}[key]
    with pytest.raises(ValueError, match="loss must be within"):
        Case(1, 2, 3, **{named: float(value)})  # type: ignore[arg-type]  # a float for either


@pytest.mark.parametrize(("least_m", "is_broken"), [(-0.01, False), (0.01, True)])
def test_who_is_nearer_than_the_separation_less_the_error_breaks_it(
    monkeypatch: pytest.MonkeyPatch, least_m: float, is_broken: bool
) -> None:
    """The separation asked for is raised afterwards, to that much above what was kept and 1 m."""
    judges = list[InvariantChecker]()
    conclude = InvariantChecker.conclude

    def stricter(judge: InvariantChecker) -> None:
        judges.append(judge)
        world: World = judge._world
        kept_m = world.closest_approach_m()
        assert kept_m is not None
        world.mission = replace(world.mission, separation_m=kept_m + ASTRAY_M + least_m)
        conclude(judge)

    monkeypatch.setattr(InvariantChecker, "conclude", stricter)
    done = play(replace(random_case(FIRST_ASTRAY + 9), schedule=()))

    assert len(judges) == 1
    assert (done.broken is not None and done.broken.invariant == "too near") == is_broken
