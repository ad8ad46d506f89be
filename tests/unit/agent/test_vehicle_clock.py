"""How fast a vehicle's clock runs beside ours."""

from __future__ import annotations

import pytest

from agent.links.vehicle_clock import VehicleClock


def test_it_is_told_over_all_the_time_since_the_vehicle_booted() -> None:
    clock = VehicleClock()
    assert clock.frac is None
    for second in range(31):
        clock.note(100.0 + 0.98 * second, float(second))
    assert clock.frac == pytest.approx(0.98)

    clock.note(0.1, 31.0)  # it has booted again
    assert clock.frac is None
    clock.note(20.1, 51.0)
    assert clock.frac == pytest.approx(1.0)
