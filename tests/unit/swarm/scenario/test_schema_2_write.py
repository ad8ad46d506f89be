"""Missions of schema 2 survive being written and read; those that schema 1 holds stay in it."""

from __future__ import annotations

from dataclasses import replace

from hypothesis import given, settings
from hypothesis import strategies as st

from swarm.model import Base, BaseId, Mission, Task, TaskId, Uav, UavId, Zone, ZoneId
from swarm.scenario import format_scenario, parse_scenario
from tests.support.small_scenario import VALID as SCHEMA_1
from tests.support.small_scenario import faults
from tests.unit.swarm.scenario.test_schema_2_read import VALID as SCHEMA_2
from tests.unit.swarm.scenario.test_write import IDS, POINTS, SECONDS
from tests.unit.swarm.scenario.test_write import missions as plain_missions

SHARES = st.floats(0.0, 1.0)
SPEEDS = st.none() | st.floats(1e-6, 1e6)
HEIGHTS = st.none() | st.floats(-1e7, 1e7)
EAST_M = 9e6
"""Zones lie beyond, places before it."""


@st.composite
def zones(draw: st.DrawFn) -> list[Zone]:
    found = []
    for number, name in enumerate(draw(st.lists(IDS, unique=True, max_size=3))):
        east_m, north_m = EAST_M + 100.0 * number, draw(st.floats(-1e6, 1e6))
        side_m = draw(st.floats(3.0, 90.0))
        floor_m, ceiling_m = draw(HEIGHTS), draw(HEIGHTS)
        if floor_m is not None and ceiling_m is not None and floor_m >= ceiling_m:
            floor_m = None
        hole = ((1.0, 1.0), (2.0, 1.0), (1.0, 2.0))
        found.append(
            Zone(
                id=ZoneId(name),
                polygon_enu_m=tuple(
                    (east_m + x * side_m, north_m + y * side_m)
                    for x, y in ((0, 0), (1, 0), (1, 1), (0, 1))
                ),
                holes_enu_m=(tuple((east_m + x, north_m + y) for x, y in hole),)
                if draw(st.booleans())
                else (),
                floor_m=floor_m,
                ceiling_m=ceiling_m,
            )
        )
    return found


@st.composite
def missions(draw: st.DrawFn) -> Mission:
    points = POINTS.filter(lambda point: point[0] < EAST_M - 1e5)
    plain = draw(plain_missions())
    wind_m_s = draw(st.tuples(*[st.floats(-20.0, 20.0)] * 2))
    uavs = [
        replace(
            uav,
            position_enu_m=draw(points),
            acceleration_m_s2=draw(SPEEDS),
            airspeed_m_s=draw(st.none() | st.floats(30.0, 1e6)),
            endurance_s=draw(st.none() | st.floats(1e-3, 1e9)),
            reserve_frac=draw(st.just(0.2) | SHARES),
            charge_frac=draw(st.just(1.0) | SHARES),
        )
        for uav in plain.uavs
    ]
    tasks = []
    for task in plain.tasks:
        line = draw(st.just([]) | st.lists(points, min_size=2, max_size=4))
        tasks.append(
            replace(
                task,
                position_enu_m=line[0] if line else draw(points),
                path_enu_m=tuple(line),
                due_s=draw(st.none() | SECONDS),
                opens_s=draw(SECONDS),
                closes_s=draw(st.none() | SECONDS),
                height_m=draw(HEIGHTS),
            )
        )
    bases = [
        Base(BaseId(name), draw(points), draw(SECONDS), draw(st.none() | st.integers(1, 1000)))
        for name in draw(st.lists(IDS, unique=True, max_size=3))
    ]
    return replace(
        plain,
        uavs=tuple(uavs),
        tasks=tuple(tasks),
        bases=tuple(bases),
        zones=tuple(draw(zones())),
        wind_enu_m_s=wind_m_s,
        zone_margin_m=draw(st.just(0.0) | st.floats(0.0, 1e4)),
        band_m=draw(st.none() | st.tuples(st.floats(0.0, 100.0), st.floats(100.5, 1e6))),
    )


@settings(deadline=None)
@given(missions())
def test_written_mission_reads_back_the_same(mission: Mission) -> None:
    assert parse_scenario(format_scenario(mission).encode(), "s.toml") == mission


@given(plain_missions())
def test_a_mission_of_schema_1_is_written_in_it(mission: Mission) -> None:
    assert format_scenario(mission).startswith("schema = 1\n")


def test_what_has_no_effect_yet_is_written_all_the_same() -> None:
    """A margin without zones and a reserve without endurance, for who adds them later."""
    plain = parse_scenario(SCHEMA_1.encode(), "s.toml")
    thrifty = replace(plain.uavs[0], reserve_frac=0.3)

    for mission in (
        replace(plain, zone_margin_m=5.0),
        replace(plain, uavs=(thrifty, *plain.uavs[1:])),
    ):
        text = format_scenario(mission)
        assert text.startswith("schema = 2\n")
        assert parse_scenario(text.encode(), "s.toml") == mission


def test_a_task_that_nobody_can_do_takes_schema_2() -> None:
    """Schema 1 refuses it, so that the file would not be read again."""
    mission = Mission(
        "tiny",
        60.0,
        (Uav(UavId("u1"), (0.0, 0.0, 0.0), 10.0),),
        (Task(TaskId("t1"), (1.0, 2.0, 0.0), 5.0),),
        success_default=0.0,
    )
    text = format_scenario(mission)

    assert parse_scenario(text.encode(), "s.toml") == mission
    assert len(faults(text.replace("schema = 2", "schema = 1"))) == 1


def test_mission_is_written_with_defaults_left_out() -> None:
    mission = parse_scenario(SCHEMA_2.encode(), "s.toml")
    county = ", ".join(
        f"[{east_m!r}, {north_m!r}]" for east_m, north_m in mission.zones[1].polygon_enu_m
    )
    line = ", ".join(
        f"[{east_m!r}, {north_m!r}]" for east_m, north_m, _ in mission.tasks[2].path_enu_m
    )
    north_m = mission.bases[1].position_enu_m[1]

    assert (
        format_scenario(mission)
        == f"""\
schema = 2
name = "field"

[mission]
horizon_s = 600.0
success_default = 1.0
survival_default = 1.0
reattempt_failed = false
wind_m_s = [3.0, -1.0]
zone_margin_m = 5.0
band_m = [30.0, 110.0]

[origin]
lat_deg = 47.0
lon_deg = 8.0
alt_m = 400.0

[[uav]]
id = "u1"
position_m = [0.0, 0.0]
speed_m_s = 10.0
acceleration_m_s2 = 2.5
airspeed_m_s = 12.0
endurance_s = 1200.0
reserve_frac = 0.1
charge_frac = 0.9

[[uav]]
id = "u2"
position_m = [5.0, 0.0]
speed_m_s = 10.0

[[base]]
id = "b0"
position_m = [0.0, -20.0, 3.0]
swap_s = 120.0
slots = 2

[[base]]
id = "b1"
position_m = [0.0, {north_m!r}]

[[zone]]
id = "village"
polygon_m = [[100.0, 100.0], [200.0, 100.0], [200.0, 200.0], [100.0, 200.0]]
holes_m = [[[120.0, 120.0], [180.0, 120.0], [150.0, 180.0]]]
floor_m = 10.0
ceiling_m = 120.0

[[zone]]
id = "county"
polygon_m = [{county}]
inclusive = true

[[task]]
id = "t1"
position_m = [50.0, 0.0]
value = 1.0
due_s = 300.0
opens_s = 60.0
closes_s = 240.0
height_m = 60.0

[[task]]
id = "t2"
path_m = [[0.0, 50.0], [90.0, 50.0, 4.0]]
value = 2.0
trigger_m = 20.0

[[task]]
id = "t3"
path_m = [{line}]
value = 3.0
"""
    )
