"""Plans of areas: lines are flown either way, whichever is better, as the optimum has it."""

from __future__ import annotations

import numpy as np
import pytest

from coordinator.planner.options import after_evaluations
from coordinator.planner.plan import make_plan
from swarm.model import Area, AreaId, Mission, Uav, UavId
from swarm.runtime.clock import SystemClock
from swarm.scenario.area_faults import with_lines


def field(seed: int) -> Mission:
    """A field of about eight lines with slanted borders, and two UAVs beside it."""
    rng = np.random.default_rng(seed)
    north_m, far_m = rng.uniform(-40.0, 40.0), rng.uniform(90.0, 130.0)
    outline = ((0.0, 0.0), (200.0, float(north_m)), (220.0, 110.0), (10.0, float(far_m)))
    area = Area(AreaId("a"), outline, 10.0, spacing_m=24.0, max_line_m=150.0 if seed % 2 else None)
    uavs = tuple(
        Uav(UavId(f"u{number}"), (float(east_m), -30.0, 0.0), 10.0, acceleration_m_s2=2.5)
        for number, east_m in enumerate(rng.uniform(-50.0, 250.0, 2))
    )
    mission, findings = with_lines(Mission("field", 300.0, uavs, (), areas=(area,)))
    assert findings == []
    return mission


@pytest.mark.parametrize("seed", range(4))
def test_guided_lists_of_a_small_area_are_the_optimum_with_lines_flown_both_ways(seed: int) -> None:
    mission = field(seed)
    clock = SystemClock()

    exact = make_plan(mission, "exact", clock=clock, bound_s=None)
    guided = make_plan(mission, "guided", clock=clock, stop=after_evaluations(3000), bound_s=None)

    assert guided.objective == pytest.approx(exact.objective, rel=1e-9)
    ways = {e.is_reversed for entries in (guided.schedule or {}).values() for e in entries[:-1]}
    assert ways == {False, True}
