"""Times of takeovers, and the mission they are measured in."""

from __future__ import annotations

from sim.bench.fleets import far_mission
from sim.bench.takeover import FailureMode, Takeovers
from sim.fleet.layout import BusKind
from swarm.protocol.timing import LinkKind


def takeovers(*times_s: float, missed: int = 0) -> Takeovers:
    return Takeovers(FailureMode.KILL, LinkKind.NORMAL, BusKind.ROUTER, times_s, missed)


def test_quantiles_are_times_that_were_measured() -> None:
    hundred = takeovers(*(float(number) for number in range(100, 0, -1)))

    assert [hundred.quantile_s(share) for share in (0.01, 0.5, 0.99, 1.0)] == [1.0, 50.0, 99.0, 100]
    assert takeovers(3.0).quantile_s(0.5) == 3.0
    assert takeovers().quantile_s(0.5) is None


def test_missed_ones_count_as_the_longest() -> None:
    assert takeovers(1.0, 2.0, 3.0, missed=1).quantile_s(0.75) == 3.0
    assert takeovers(1.0, 2.0, 3.0, missed=1).quantile_s(0.99) is None


def test_nobody_gets_anywhere_in_the_mission() -> None:
    mission = far_mission(3, 2)

    nearest_m = min(abs(task.position_enu_m[1]) for task in mission.tasks)
    assert nearest_m / max(uav.speed_m_s for uav in mission.uavs) > 3600.0
