"""Settings of the bridge."""

from __future__ import annotations

import math
from dataclasses import fields, replace
from typing import Any

import pytest

from agent.vehicle.config import BridgeConfig
from tests.support.bridge_flight import ORIGIN

CONFIG = BridgeConfig(1, ORIGIN)
NUMBERS = [
    each.name
    for each in fields(CONFIG)
    if (each.type == "float" or each.name.endswith("_tries")) and each.name != "zone_margin_m"
]


@pytest.mark.parametrize("system_id", [0, -1, 256])
def test_system_id_must_be_one_of_mavlink(system_id: int) -> None:
    with pytest.raises(ValueError, match="system_id must be a whole number within"):
        BridgeConfig(system_id, ORIGIN)


@pytest.mark.parametrize("value", [0.0, -1.0, math.nan, math.inf])
@pytest.mark.parametrize("name", NUMBERS)
def test_every_number_must_be_positive_and_finite(name: str, value: float) -> None:
    changed: dict[str, Any] = {name: value}
    with pytest.raises(ValueError, match=name):
        replace(CONFIG, **changed)


@pytest.mark.parametrize("value", [-1.0, math.nan, math.inf])
def test_a_margin_is_not_negative(value: float) -> None:
    with pytest.raises(ValueError, match="zone_margin_m"):
        replace(CONFIG, zone_margin_m=value)
    assert replace(CONFIG, zone_margin_m=0.0).zone_margin_m == 0.0


@pytest.mark.parametrize("value", [0.0, 1.0, -0.1, math.nan])
def test_battery_reserve_is_a_share_or_left_to_the_autopilot(value: float) -> None:
    with pytest.raises(ValueError, match="battery_reserve_frac"):
        replace(CONFIG, battery_reserve_frac=value)
    assert replace(CONFIG, battery_reserve_frac=None).battery_reserve_frac is None


def test_fast_vehicle_time_leaves_wall_time_for_answers() -> None:
    fast = CONFIG.for_speedup(60.0)
    assert fast.commands.ack_timeout_s / 60.0 >= 0.5
    assert fast.silence_timeout_s / 60.0 >= 3.0
    assert fast.acceptance_radius_m == CONFIG.acceptance_radius_m
    assert fast.mission_patience_s >= 20.0 * fast.commands.ack_timeout_s
    assert CONFIG.for_speedup(1.0) == CONFIG
    with pytest.raises(ValueError, match="speedup"):
        CONFIG.for_speedup(0.0)
