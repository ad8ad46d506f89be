"""Every rule of schema 2: what a file may say, and one exact line for what it may not."""

from __future__ import annotations

import pytest
from pydantic import BaseModel

from swarm.model import Base, BaseId, Origin, ZoneId
from swarm.model.frames import enu_from_wgs84
from swarm.scenario import edition, parse_scenario, shapes
from tests.support.small_scenario import VALID as SCHEMA_1
from tests.support.small_scenario import faults

VALID = """\
schema = 2
name = "field"

[mission]
horizon_s = 600.0
wind_m_s = [3.0, -1.0]
zone_margin_m = 5
band_m = [30.0, 110]

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
endurance_s = 1200
reserve_frac = 0.1
charge_frac = 0.9

[[uav]]
id = "u2"
position_m = [5.0, 0.0]
speed_m_s = 10.0

[[base]]
id = "b0"
position_m = [0.0, -20.0, 3.0]
swap_s = 120
slots = 2

[[base]]
id = "b1"
lat_deg = 47.001
lon_deg = 8.0

[[zone]]
id = "village"
polygon_m = [[100, 100], [200, 100, 7.0], [200, 200], [100, 200], [100, 100]]
holes_m = [[[120, 120], [180, 120], [150, 180]]]
floor_m = 10.0
ceiling_m = 120.0

[[zone]]
id = "county"
polygon = [[46.98, 7.98], [46.98, 8.02], [47.02, 8.02], [47.02, 7.98]]
inclusive = true

[[task]]
id = "t1"
position_m = [50.0, 0.0]
value = 1.0
due_s = 300
opens_s = 60.0
closes_s = 240.0
height_m = 60.0

[[task]]
id = "t2"
path_m = [[0.0, 50.0], [90.0, 50.0, 4.0]]
trigger_m = 20.0
value = 2.0

[[task]]
id = "t3"
path = [[47.003, 8.0], [47.003, 8.001], [47.004, 8.001]]
value = 3.0
"""

SHARE = "give a share within 0..1"
SECONDS = "give a number >= 0 and <= 1e9 [s]"
POSITIVE = "give a number > 0 and <= 1e6 [m/s²], such as 2.5"
CORNERS = "give corners [[east, north], …], each within -1e7..1e7 [m]"
RING = "give three corners or more, round a simple polygon"
BAND = "give [lowest, highest], heights >= 0 and <= 1e6 [m], such as [30.0, 110.0]"
WIND = "give [east, north], where the wind blows to, such as [3.0, -1.0] [m/s]"
OUT = "move it out of the zone, or change the zone"
AWAY = "move it away, or give a smaller margin"
SQUARE = "polygon_m = [[100, 100], [200, 100, 7.0], [200, 200], [100, 200], [100, 100]]"
HOLES = "holes_m = [[[120, 120], [180, 120], [150, 180]]]"

# What is replaced in VALID, by what, and the lines it takes.
WRONG: dict[str, tuple[str, str, list[str]]] = {
    # [mission]
    "wind of three numbers": (
        "[3.0, -1.0]",
        "[3.0, -1.0, 0.0]",
        [f"mission.wind_m_s: has 3 instead of 2 numbers; {WIND}"],
    ),
    "margin below 0": (
        "zone_margin_m = 5",
        "zone_margin_m = -5",
        ["mission.zone_margin_m: -5 is not >= 0; give a distance >= 0 and <= 1e6 [m]"],
    ),
    "band upside down": (
        "[30.0, 110]",
        "[110, 30.0]",
        [f"mission.band_m: does not grow from 110 to 30; {BAND}"],
    ),
    "band of one height": (
        "[30.0, 110]",
        "[30.0]",
        [f"mission.band_m: has 1 instead of 2 numbers; {BAND}"],
    ),
    # [[uav]]
    "no acceleration": (
        "acceleration_m_s2 = 2.5",
        "acceleration_m_s2 = 0",
        [f'uav[0] "u1".acceleration_m_s2: 0 is not > 0; {POSITIVE}'],
    ),
    "a wind as fast as the UAV": (
        "wind_m_s = [3.0, -1.0]",
        "wind_m_s = [12, 0.0]",
        [
            (
                'uav[0] "u1".airspeed_m_s: 12.0 is not more than the wind\'s 12 m/s; '
                "give a faster UAV or a weaker wind_m_s"
            )
        ],
    ),
    "endurance of nothing": (
        "endurance_s = 1200",
        "endurance_s = 0",
        [
            (
                'uav[0] "u1".endurance_s: 0 is not > 0; '
                "give a number > 0 and <= 1e9 [s], such as endurance_s = 1200.0"
            )
        ],
    ),
    "reserve in percent": (
        "reserve_frac = 0.1",
        "reserve_frac = 10",
        [f'uav[0] "u1".reserve_frac: 10 is not within 0..1; {SHARE}'],
    ),
    "charge below 0": (
        "charge_frac = 0.9",
        "charge_frac = -0.9",
        [f'uav[0] "u1".charge_frac: -0.9 is not within 0..1; {SHARE}'],
    ),
    # [[base]]
    "base id doubled": (
        'id = "b1"',
        'id = "b0"',
        ["base[1] \"b0\".id: 'b0' is already the id of base[0]; give every one an id of its own"],
    ),
    "base without a place": (
        "lat_deg = 47.001\nlon_deg = 8.0\n",
        "",
        [
            (
                'base[1] "b1".position_m: is missing; '
                "give position_m = [east, north], or lat_deg and lon_deg"
            )
        ],
    ),
    "swap before touch-down": (
        "swap_s = 120",
        "swap_s = -1",
        [f'base[0] "b0".swap_s: -1 is not >= 0; {SECONDS}'],
    ),
    "no slots": (
        "slots = 2",
        "slots = 0",
        ['base[0] "b0".slots: 0 is not >= 1; give an integer >= 1, or leave it out for no limit'],
    ),
    "half a slot": (
        "slots = 2",
        "slots = 2.5",
        [
            (
                'base[0] "b0".slots: 2.5 is not an integer; '
                "give an integer >= 1, or leave it out for no limit"
            )
        ],
    ),
    "base with a task's key": (
        "slots = 2",
        "value = 2.0",
        ['base[0] "b0".value: unknown key here; it belongs in [[task]]'],
    ),
    # [[zone]]
    "zone id doubled": (
        'id = "county"',
        'id = "village"',
        [
            (
                "zone[1] \"village\".id: 'village' is already the id of zone[0]; "
                "give every one an id of its own"
            )
        ],
    ),
    "zone without a polygon": (
        f"{SQUARE}\n{HOLES}\n",
        "",
        [
            (
                'zone[0] "village".polygon_m: is missing; '
                "give polygon_m = [[east, north], …], or polygon in degrees"
            )
        ],
    ),
    "zone with two polygons": (
        SQUARE,
        f"{SQUARE}\npolygon = [[47.1, 8.1], [47.1, 8.2], [47.2, 8.2]]",
        ['zone[0] "village".polygon: is given beside polygon_m; keep either polygon_m or polygon'],
    ),
    "polygon that crosses itself": (
        SQUARE,
        "polygon_m = [[100, 100], [200, 200], [200, 100], [100, 150]]",
        [f'zone[0] "village".polygon_m: crosses or touches itself near (133.333, 133.333); {RING}'],
    ),
    "polygon as a bow": (
        SQUARE,
        "polygon_m = [[100, 100], [200, 200], [200, 100], [100, 200]]",
        [f'zone[0] "village".polygon_m: encloses nothing; {RING}'],
    ),
    "polygon of two corners": (
        SQUARE,
        "polygon_m = [[100, 100], [200, 200]]",
        [
            'zone[0] "village".polygon_m: must have at least three corners, not 2; ' + RING,
        ],
    ),
    "corner of one number": (
        SQUARE,
        "polygon_m = [[100, 100], [200], [200, 200]]",
        [f'zone[0] "village".polygon_m[1]: has 1 instead of 2 or 3 numbers; {CORNERS}'],
    ),
    "corner beyond the pole": (
        "[46.98, 7.98]",
        "[96.98, 7.98]",
        [
            (
                'zone[1] "county".polygon[0]: 96.98, 7.98 is no latitude and longitude; '
                "give corners [[lat_deg, lon_deg], …]"
            )
        ],
    ),
    "hole that crosses itself": (
        HOLES,
        "holes_m = [[[120, 120], [180, 180], [180, 120], [120, 170]]]",
        [
            'zone[0] "village".holes_m[0]: crosses or touches itself near (147.273, 147.273); '
            + RING
        ],
    ),
    "hole outside": (
        HOLES,
        "holes_m = [[[220, 120], [280, 120], [250, 180]]]",
        [
            (
                'zone[0] "village".holes_m: a hole lies outside the polygon near (220, 120); '
                "give holes inside the polygon, apart from each other"
            )
        ],
    ),
    "floor above the ceiling": (
        "floor_m = 10.0",
        "floor_m = 120.0",
        [
            (
                'zone[0] "village".ceiling_m: 120.0 is not above floor_m = 120.0; '
                "give a ceiling above the floor"
            )
        ],
    ),
    # places and zones
    "start in a zone": (
        "position_m = [5.0, 0.0]",
        "position_m = [110.0, 150.0]",
        [f"uav[1] \"u2\".position_m: lies in zone 'village'; {OUT}"],
    ),
    "base nearer than the margin": (
        "position_m = [0.0, -20.0, 3.0]",
        "position_m = [150.0, 95.5, 3.0]",
        [f"base[0] \"b0\".position_m: is nearer than zone_margin_m = 5 to zone 'village'; {AWAY}"],
    ),
    "task outside of where to fly": (
        "position_m = [50.0, 0.0]",
        "position_m = [5000.0, 0.0]",
        [
            (
                "task[0] \"t1\".position_m: lies outside of zone 'county', "
                "the only place where to fly; move it into the zone, or change the zone"
            )
        ],
    ),
    "point of a line in a zone": (
        "[90.0, 50.0, 4.0]",
        "[110.0, 110.0, 4.0]",
        [f"task[1] \"t2\".path_m[1]: lies in zone 'village'; {OUT}"],
    ),
    "line across a zone": (
        "[90.0, 50.0, 4.0]",
        "[90.0, 50.0], [210.0, 250.0]",
        [
            (
                "task[1] \"t2\".path_m[2]: the line to it crosses zone 'village'; "
                "lead it round the zone, or make two tasks of it"
            )
        ],
    ),
    "line nearer than the margin": (
        "[90.0, 50.0, 4.0]",
        "[0.0, 96.0], [210.0, 94.0]",
        [
            (
                'task[1] "t2".path_m[2]: the line to it comes nearer than zone_margin_m = 5 '
                "to zone 'village'; lead it round, or give a smaller margin"
            )
        ],
    ),
    # [[task]]
    "due before the start": (
        "due_s = 300",
        "due_s = -1",
        [f'task[0] "t1".due_s: -1 is not >= 0; {SECONDS}'],
    ),
    "line of one point": (
        "path_m = [[0.0, 50.0], [90.0, 50.0, 4.0]]",
        "path_m = [[0.0, 50.0]]",
        [
            (
                'task[1] "t2".path_m: has 1 point instead of 2 or more; '
                "give two points or more, [[east, north], …], each within -1e7..1e7 [m]"
            )
        ],
    ),
    "line beside a place": (
        'id = "t2"\n',
        'id = "t2"\nposition_m = [0.0, 50.0]\n',
        [
            (
                'task[1] "t2".path_m: is given beside position_m; '
                "keep path_m for a line, or position_m for a place"
            )
        ],
    ),
    "line in metres and degrees": (
        'id = "t3"\n',
        'id = "t3"\npath_m = [[0.0, 50.0], [9.0, 50.0]]\n',
        ['task[2] "t3".path: is given beside path_m; keep either path_m or path'],
    ),
    "point of a line beyond the pole": (
        "[47.003, 8.001]",
        "[97.003, 8.001]",
        [
            (
                'task[2] "t3".path[1]: 97.003, 8.001 is no latitude and longitude; '
                "give two points or more, [[lat_deg, lon_deg], …]"
            )
        ],
    ),
    "misspelled window": (
        "opens_s = 60.0",
        "open_s = 60.0",
        ["task[0] \"t1\".open_s: unknown key; did you mean 'opens_s'?"],
    ),
    "pictures of a place": (
        'id = "t1"\n',
        'id = "t1"\ntrigger_m = 20.0\n',
        ['task[0] "t1".trigger_m: is of lines, not of places; give path_m, or leave it out'],
    ),
    "pictures on the spot": (
        "trigger_m = 20.0",
        "trigger_m = 0.0",
        ['task[1] "t2".trigger_m: 0.0 is not >= 0.1; give a distance within 0.1..1e6 [m]'],
    ),
    "separation": (
        "zone_margin_m = 5",
        "zone_margin_m = 5\nseparation_m = 0.0",
        [
            (
                "mission.separation_m: 0.0 is not >= 0.1; "
                "give a distance within 0.1..1e6 [m], such as 10.0"
            )
        ],
    ),
}


@pytest.mark.parametrize("case", WRONG)
def test_one_wrong_place_takes_its_exact_line(case: str) -> None:
    old, new, lines = WRONG[case]
    assert old in VALID

    assert faults(VALID.replace(old, new, 1)) == [f"s.toml: {line}" for line in lines]


def test_valid_file_becomes_its_mission() -> None:
    mission = parse_scenario(VALID.encode(), "s.toml")
    origin = Origin(47.0, 8.0, 400.0)
    u1, u2 = mission.uavs
    t1, t2, t3 = mission.tasks
    village, county = mission.zones

    assert (mission.wind_enu_m_s, mission.zone_margin_m, mission.band_m) == (
        (3.0, -1.0),
        5.0,
        (30.0, 110.0),
    )
    assert (u1.acceleration_m_s2, u1.airspeed_m_s, u1.endurance_s) == (2.5, 12.0, 1200.0)
    assert (u1.reserve_frac, u1.charge_frac) == (0.1, 0.9)
    assert (u2.acceleration_m_s2, u2.airspeed_m_s, u2.endurance_s) == (None, None, None)
    assert (u2.reserve_frac, u2.charge_frac) == (0.2, 1.0)
    assert mission.bases == (
        Base(BaseId("b0"), (0.0, -20.0, 3.0), 120.0, 2),
        Base(BaseId("b1"), enu_from_wgs84(origin, 47.001, 8.0, 400.0), 0.0, None),
    )
    assert village.id == ZoneId("village")
    assert village.polygon_enu_m == ((100.0, 100.0), (200.0, 100.0), (200.0, 200.0), (100.0, 200.0))
    assert village.holes_enu_m == (((120.0, 120.0), (180.0, 120.0), (150.0, 180.0)),)
    assert (village.floor_m, village.ceiling_m, village.inclusive) == (10.0, 120.0, False)
    assert county.polygon_enu_m[0] == enu_from_wgs84(origin, 46.98, 7.98, 400.0)[:2]
    assert (county.floor_m, county.ceiling_m, county.inclusive) == (None, None, True)
    assert (t1.due_s, t1.opens_s, t1.closes_s, t1.height_m) == (300.0, 60.0, 240.0, 60.0)
    assert (t2.due_s, t2.opens_s, t2.closes_s, t2.height_m) == (None, 0.0, None, None)
    assert (t1.path_enu_m, t2.path_enu_m) == ((), ((0.0, 50.0, 0.0), (90.0, 50.0, 4.0)))
    assert (t1.trigger_m, t2.trigger_m, t3.trigger_m) == (None, 20.0, None)
    assert t2.position_enu_m == (0.0, 50.0, 0.0)
    assert t3.path_enu_m[2] == enu_from_wgs84(origin, 47.004, 8.001, 400.0)


def test_a_border_is_outside_and_the_margin_is_inclusive() -> None:
    at_margin = VALID.replace("[5.0, 0.0]", "[150.0, 95.0]")
    on_border = at_margin.replace("zone_margin_m = 5\n", "").replace("95.0]", "100.0]")

    assert faults(at_margin) == []
    assert faults(on_border) == []


def test_a_place_in_a_hole_of_a_zone_is_right() -> None:
    assert faults(VALID.replace("[5.0, 0.0]", "[150.0, 140.0]")) == []


def test_a_place_in_a_zone_is_wrong_at_any_height() -> None:
    """Floor and ceiling say where to fly, not where to stand."""
    high = VALID.replace("floor_m = 10.0", "floor_m = 115.0").replace("[5.0, 0.0]", "[110, 150]")

    assert faults(high) == [f"s.toml: uav[1] \"u2\".position_m: lies in zone 'village'; {OUT}"]


def test_what_can_never_be_done_is_no_fault() -> None:
    """A window that closes before it opens, and a task that nobody can do, are left out."""
    assert faults(VALID.replace("closes_s = 240.0", "closes_s = 10.0")) == []
    assert faults(VALID.replace("horizon_s", "success_default = 0\nhorizon_s")) == []


def test_schema_2_without_its_words_is_the_mission_of_schema_1() -> None:
    again = SCHEMA_1.replace("schema = 1", "schema = 2")

    assert parse_scenario(again.encode(), "s.toml") == parse_scenario(SCHEMA_1.encode(), "s.toml")


@pytest.mark.parametrize(
    ("old", "new", "words"),
    [
        ("success_default", "wind_m_s = [0.0, 0.0]\nsuccess_default", "wind_m_s is"),
        ('kind = "quad"', "reserve_frac = 0.2", "reserve_frac is"),
        ("appears_s = 20.0", "due_s = 9.0\nopens_s = 1.0", "due_s and opens_s are"),
        ("[[uav]]", '[[base]]\nid = "b"\nposition_m = [0, 0]\n\n[[uav]]', "[[base]] is"),
    ],
)
def test_schema_1_with_a_word_of_schema_2_takes_one_line(old: str, new: str, words: str) -> None:
    text = SCHEMA_1.replace(old, new, 1)

    assert faults(text) == [f"s.toml: schema: is 1, and {words} of schema 2; give schema = 2"]
    assert faults(text.replace("schema = 1", "schema = 2")) == []


def test_a_separation_is_of_schema_2() -> None:
    text = SCHEMA_1.replace("[mission]\n", "[mission]\nseparation_m = 10.0\n", 1)

    assert faults(text) == [
        "s.toml: schema: is 1, and separation_m is of schema 2; give schema = 2",
    ]


def test_every_key_is_of_one_edition() -> None:
    """A key that `edition` forgets would be taken from a file of schema 1 in silence."""
    old = {
        "mission": {"horizon_s", "success_default", "survival_default", "reattempt_failed"},
        "uav": {"id", "position_m", "lat_deg", "lon_deg", "alt_m", "speed_m_s"}
        | {"success", "survival", "kind"},
        "task": {"id", "position_m", "lat_deg", "lon_deg", "alt_m", "value", "service_s"}
        | {"kind", "appears_s"},
    }
    tables: dict[str, type[BaseModel]] = {
        "mission": shapes.MissionTable,
        "uav": shapes.UavTable,
        "task": shapes.TaskTable,
    }
    for name, table in tables.items():
        assert set(table.model_fields) - old[name] == set(edition.NEW_KEYS[name])
    top = {"version", "name", "mission", "origin", "uav", "task", "tasks_from"}
    assert set(shapes.Scenario.model_fields) - top == set(edition.NEW_TABLES)


def test_twelve_faults_take_twelve_lines_in_the_order_of_the_file() -> None:
    text = VALID
    for old, new in (
        ("[3.0, -1.0]", "[30.0, -1.0]"),
        ("[30.0, 110]", "[30.0]"),
        ("endurance_s = 1200", "endurance_s = -1"),
        ("position_m = [5.0, 0.0]", "position_m = [110.0, 150.0]"),
        ("slots = 2", "slots = 0"),
        ('id = "b1"', 'id = "b0"'),
        (HOLES, "holes_m = [[[120, 120]]]"),
        ("ceiling_m = 120.0", "ceiling_m = 0.0"),
        ("inclusive = true", 'inclusive = "yes"'),
        ("closes_s = 240.0", "closes_s = nan"),
        ('id = "t2"\n', 'id = "t2"\nposition_m = [0.0, 50.0]\n'),
        ("trigger_m = 20.0", "trigger_m = -1"),
    ):
        assert old in text
        text = text.replace(old, new, 1)

    assert [line.split(": ")[1] for line in faults(text)] == [
        "mission.band_m",
        'uav[0] "u1".airspeed_m_s',
        'uav[0] "u1".endurance_s',
        'base[0] "b0".slots',
        'base[1] "b0".id',
        'zone[0] "village".holes_m[0]',
        'zone[0] "village".ceiling_m',
        'zone[1] "county".inclusive',
        'task[0] "t1".closes_s',
        'task[1] "t2".path_m',
        'task[1] "t2".trigger_m',
    ]
