"""Missions in the field, flown in virtual time, held against the independent reading of the text.

Faultless ones, and those with losses, pop-ups and a coordinator that dies: what was executed keeps
to windows, due times, zones and energy, and in the end nothing is left that somebody could do.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import Any

import pytest

from coordinator.terminal.report import MissionReport
from sim.world.simulation import SimulatedMission, simulate_mission
from sim.world.uncertainty import Uncertainty
from tests.support.field_end import as_flown, leftovers
from tests.support.field_missions import mission_of
from tests.support.field_oracle.checker import check_simulation
from tests.support.field_oracle.made_up import KINDS, made_up

METHODS = ("greedy", "lookahead", "guided")
TROUBLE = Uncertainty(loss=0.3, popup=0.3)
PATIENCE_S = 1.0
CONSTRAINED = tuple(
    kind for kind in KINDS if kind not in ("plain", "acceleration", "survival", "popups")
)
KINDS_WITH_BASES = ("energy", "slots", "all", "all-but-margin")


def complaints(flown: SimulatedMission, draft: Mapping[str, Any]) -> list[str]:
    """What the checker says of a flight's JSON, by the scenario as it came about."""
    report = MissionReport(
        mission=flown.world.mission,
        plan=flown.world.mission_state.plan,
        result=flown.result,
        story=(),
        executed_schedule=flown.world.executed_schedule(),
        closest_approach=flown.world.closest_approach(),
    )
    return check_simulation(as_flown(draft, flown.world.mission), report.as_json())


def judged(
    kind: str, seed: int, method: str, size: tuple[int, int], lost_s: float | None
) -> list[str]:
    """Everything that is wrong with one flight with troubles."""
    draft = made_up(seed, kind, *size)
    flown = simulate_mission(
        replace(mission_of(draft), schema=2),
        method=method,
        seed=seed,
        uncertainty=TROUBLE,
        coordinator_lost_s=lost_s,
    )
    left = leftovers(as_flown(draft, flown.world.mission), flown.world, PATIENCE_S)
    found = [f"{kind} {seed} {method}: {text}" for text in complaints(flown, draft)]
    found += [f"{kind} {seed} {method}: {each}" for each in left]
    return found if flown.in_time else [*found, f"{kind} {seed} {method}: was broken off"]


@pytest.mark.parametrize("kind", KINDS)
def test_what_is_flown_without_faults_is_feasible(kind: str) -> None:
    for seed in range(2):
        draft = made_up(seed, kind)
        known = replace(mission_of(draft), schema=2).known_at_start()
        flown = simulate_mission(known, method="greedy", seed=seed, uncertainty=Uncertainty())
        scenario = {**draft, "task": [t for t in draft["task"] if not t.get("appears_s")]}
        assert complaints(flown, scenario) == []
        assert flown.in_time


@pytest.mark.parametrize("lost_s", [None, 0.0])
@pytest.mark.parametrize("kind", KINDS_WITH_BASES)
def test_with_losses_nothing_is_left_in_the_end_that_somebody_could_do(
    kind: str, lost_s: float | None
) -> None:
    found = [
        text
        for seed in range(3)
        for method in METHODS
        for text in judged(kind, seed, method, (2, 4), lost_s)
    ]
    assert found == []


@pytest.mark.slow
@pytest.mark.parametrize("size", [(2, 4), (3, 6)])
@pytest.mark.parametrize("kind", CONSTRAINED)
def test_with_losses_nothing_is_left_in_the_end_of_many_missions(
    kind: str, size: tuple[int, int]
) -> None:
    found = [
        text
        for seed in range(20)
        for method in METHODS
        for text in judged(kind, seed, method, size, (None, 0.0, 20.0)[seed % 3])
    ]
    assert found == []


def test_who_waited_beside_the_slots_was_not_in_the_air_meanwhile() -> None:
    """Its sortie ends when it comes down there, and its swap is told by itself."""
    draft = made_up(9, "slots", 3, 6)
    flown = simulate_mission(
        mission_of(draft), method="lookahead", seed=9, uncertainty=TROUBLE, coordinator_lost_s=0.0
    )
    entries = flown.world.executed_schedule()[flown.world.mission.uavs[0].id]

    stays = [entry for entry in entries if entry.go == "base:b0"]
    down, swap = stays[:2]
    assert down.arrive_s == down.begin_s == down.end_s
    assert swap.depart_s == swap.begin_s
    assert swap.begin_s > down.end_s + 10.0
    assert complaints(flown, draft) == []
