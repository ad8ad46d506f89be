"""Legs are read from a flight as they were flown, and other files are refused in one line."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from sim.bench.legs import leg_times, legs_flown, load_run
from swarm.runtime.errors import InputError
from swarm.scenario import load_scenario
from swarm.scenario.files import resolve_scenario

MEADOW = load_scenario(resolve_scenario("meadow"))
FLOWN = {
    "scenario": "meadow",
    "executed_routes": {"uav1": ["west-near", "west-far"], "uav2": [], "uav3": ["east-near"]},
    "executed_completion_s": {"west-near": 15.0, "west-far": 26.0, "east-near": 12.0},
}


def test_a_leg_lasts_from_the_end_of_a_task_to_the_next_ones_service() -> None:
    legs = legs_flown(MEADOW, FLOWN, "flight.json")

    assert [(leg.uav, leg.task, leg.flown_s) for leg in legs] == [
        ("uav1", "west-near", 12.0),  # 3 s of service
        ("uav1", "west-far", 11.0),
        ("uav3", "east-near", 12.0),
    ]
    assert legs[0].length_m == pytest.approx((60.0**2 + 30.0**2) ** 0.5)
    assert legs[0].excess_s == pytest.approx(12.0 - legs[0].length_m / 8.0)


def test_the_median_is_told_with_its_spread_and_beyond_the_ramps() -> None:
    legs = legs_flown(MEADOW, FLOWN, "flight.json")
    times = leg_times(legs, 2.0)

    excess_s = sorted(leg.excess_s for leg in legs)
    assert times is not None
    assert (times.legs, times.least_s, times.greatest_s) == (3, excess_s[0], excess_s[2])
    assert times.median_s == excess_s[1]
    assert times.beyond_ramps_s == pytest.approx(excess_s[1] - 4.0)
    assert leg_times([], 2.0) is None


@pytest.mark.parametrize(
    ("text", "problem"),
    [
        ("no json", "it is not JSON"),
        ("[]", "is missing"),
        (json.dumps({"scenario": "meadow", "executed_routes": {}}), "executed_completion_s"),
    ],
)
def test_what_is_no_flight_is_refused(tmp_path: Path, text: str, problem: str) -> None:
    path = tmp_path / "flight.json"
    path.write_text(text)
    with pytest.raises(InputError, match=problem):
        load_run(path)


def test_a_flight_of_another_scenario_is_refused() -> None:
    other = {**FLOWN, "executed_routes": {"uav1": ["nowhere"]}}
    with pytest.raises(InputError, match="'nowhere' is not in the scenario meadow"):
        legs_flown(MEADOW, other, "flight.json")
