"""Areas of a scenario file: what it may say, what becomes of it, and a line for what it may not."""

from __future__ import annotations

import re
from dataclasses import replace

import pytest

from swarm.model import Mission, TaskId
from swarm.scenario import format_scenario, parse_scenario
from swarm.survey.cameras import CAMERAS
from tests.support.small_scenario import faults

VALID = """\
schema = 2
name = "survey"

[mission]
horizon_s = 600.0
zone_margin_m = 5.0

[origin]
lat_deg = 47.0
lon_deg = 8.0
alt_m = 400.0

[[uav]]
id = "u1"
position_m = [0.0, -50.0]
speed_m_s = 10.0
success = { meadow-02 = 0.9, photograph = 0.8 }

[[zone]]
id = "barn"
polygon_m = [[80, 40], [120, 40], [120, 60], [80, 60]]

[[area]]
id = "meadow"
polygon_m = [[0, 0], [200, 0], [200, 100], [0, 100]]
holes_m = [[[20, 20], [60, 20], [60, 80], [20, 80]]]
value = 40.0
spacing_m = 20.0
trigger_m = 15.0
heading_deg = 90.0
max_line_m = 120.0

[[area]]
id = "slope"
polygon = [[47.002, 8.0], [47.002, 8.002], [47.003, 8.002]]
value = 10.0
camera = "dji-phantom-4-pro"
height_m = 60.0
sidelap_frac = 0.7
frontlap_frac = 0.8
kind = "photograph"
service_s = 2.0
due_s = 500.0
opens_s = 10.0
closes_s = 400.0
appears_s = 20.0
"""
AREA = VALID[VALID.index('[[area]]\nid = "meadow"') : VALID.index('[[area]]\nid = "slope"')]
SPACING = "give spacing_m, or camera with height_m, sidelap_frac and frontlap_frac"
RING = "give three corners or more, round a simple polygon"
BOTH = "keep either spacing_m or camera with its overlaps"
SQUARE = "[[0, 0], [200, 0], [200, 100], [0, 100]]"
CAMERA = (
    f"give one of {', '.join(CAMERAS)}, or a table of sensor_width_mm, sensor_height_mm, "
    "focal_length_mm, image_width_px and image_height_px"
)
NUMBERS = (
    "{ sensor_width_mm = 13.2, sensor_height_mm = 8.8, focal_length_mm = 8.8, "
    "image_width_px = 5472, image_height_px = 3648"
)

# What is replaced in VALID, by what, and the lines it takes.
WRONG: dict[str, tuple[str, str, list[str]]] = {
    "schema 1": (
        "schema = 2",
        "schema = 1",
        ["schema: is 1, and [[zone]], [[area]] and zone_margin_m are of schema 2; give schema = 2"],
    ),
    "id of another": (
        'id = "slope"',
        'id = "meadow"',
        [
            (
                "area[1] \"meadow\".id: 'meadow' is already the id of area[0]; "
                "give every one an id of its own"
            )
        ],
    ),
    "id too long for a number after it": (
        'id = "slope"',
        f'id = "{"s" * 57}"',
        [
            (
                f'area[1] "{"s" * 47}…".id: \'{"s" * 46}… is too long; give an id of 1 to 64 '
                "letters, "
                "digits, '_', '-' or '.', beginning with a letter or digit, but 56 at most"
            )
        ],
    ),
    "crossing itself": (
        SQUARE,
        "[[0, 0], [200, 100], [200, 0], [0, 80]]",
        [f'area[0] "meadow".polygon_m: crosses or touches itself near (88.8889, 44.4444); {RING}'],
    ),
    "no number": (
        SQUARE,
        "[[0, 0], [nan, 0], [200, 100]]",
        [
            (
                'area[0] "meadow".polygon_m[1][0]: nan is not a finite number; '
                "give corners [[east, north], …], each within -1e7..1e7 [m]"
            )
        ],
    ),
    "two corners": (
        SQUARE,
        "[[0, 0], [200, 0]]",
        [f'area[0] "meadow".polygon_m: must have at least three corners, not 2; {RING}'],
    ),
    "hole outside": (
        "[[[20, 20], [60, 20], [60, 80], [20, 80]]]",
        "[[[320, 20], [360, 20], [360, 80]]]",
        [
            (
                'area[0] "meadow".holes_m: a hole lies outside the polygon near (320, 20); '
                "give holes inside the polygon, apart from each other"
            )
        ],
    ),
    "degrees beside metres": (
        f"polygon_m = {SQUARE}",
        f"polygon_m = {SQUARE}\npolygon = [[47.0, 8.0], [47.0, 8.1], [47.1, 8.0]]",
        ['area[0] "meadow".polygon: is given beside polygon_m; keep either polygon_m or polygon'],
    ),
    "nothing about spacing": (
        "spacing_m = 20.0\ntrigger_m = 15.0\n",
        "",
        [f'area[0] "meadow".spacing_m: is missing; {SPACING}'],
    ),
    "spacing and camera": (
        "spacing_m = 20.0\ntrigger_m = 15.0\n",
        'spacing_m = 20.0\ncamera = "sony-rx1r-ii"\nsidelap_frac = 0.5\n',
        [
            f'area[0] "meadow".camera: is given beside spacing_m; {BOTH}',
            f'area[0] "meadow".sidelap_frac: is given beside spacing_m; {BOTH}',
        ],
    ),
    "camera and trigger": (
        'camera = "dji-phantom-4-pro"',
        'camera = "dji-phantom-4-pro"\ntrigger_m = 5.0',
        [
            (
                'area[1] "slope".trigger_m: is given beside a camera; '
                "leave it out: frontlap_frac tells how far apart pictures are"
            )
        ],
    ),
    "camera alone": (
        "height_m = 60.0\nsidelap_frac = 0.7\nfrontlap_frac = 0.8\n",
        "",
        [
            f'area[1] "slope".{key}: is missing; give {key} beside camera'
            for key in ("height_m", "sidelap_frac", "frontlap_frac")
        ],
    ),
    "camera below the ground": (
        "height_m = 60.0",
        "height_m = -60.0",
        [
            (
                'area[1] "slope".height_m: -60.0 is no height from which a camera sees the ground; '
                "give a height > 0 [m]"
            )
        ],
    ),
    "misspelled camera": (
        '"dji-phantom-4-pro"',
        '"phantom-4-pro"',
        [
            (
                "area[1] \"slope\".camera: 'phantom-4-pro' is no camera that is known "
                f"(did you mean 'dji-phantom-4-pro'?); {CAMERA}"
            )
        ],
    ),
    "camera of no kind": (
        '"dji-phantom-4-pro"',
        "7",
        [f'area[1] "slope".camera: 7 is not a table; {CAMERA}'],
    ),
    "camera without a lens": (
        '"dji-phantom-4-pro"',
        NUMBERS.replace("focal_length_mm = 8.8, ", "") + " }",
        [
            (
                'area[1] "slope".camera.focal_length_mm: is missing; '
                "give a length within 0.01..10000 [mm]"
            )
        ],
    ),
    "camera with another key": (
        '"dji-phantom-4-pro"',
        NUMBERS + ", lens_mm = 3.0 }",
        [
            (
                'area[1] "slope".camera.lens_mm: unknown key; the keys here are sensor_width_mm, '
                "sensor_height_mm, focal_length_mm, image_width_px, image_height_px, landscape, "
                "exposure_s"
            )
        ],
    ),
    "all overlap": (
        "sidelap_frac = 0.7",
        "sidelap_frac = 1.0",
        [
            (
                'area[1] "slope".sidelap_frac: 1.0 is not <= 0.99; '
                "give a share within 0..0.99, such as 0.7"
            )
        ],
    ),
    "tiny spacing": (
        "spacing_m = 20.0",
        "spacing_m = 0.000001",
        ['area[0] "meadow".spacing_m: 1e-06 is not >= 0.1; give a distance within 0.1..1e6 [m]'],
    ),
    "a hundred thousand lines": (
        SQUARE + "\nholes_m = [[[20, 20], [60, 20], [60, 80], [20, 80]]]\nvalue = 40.0\n"
        "spacing_m = 20.0",
        "[[0, 0], [9e6, 0], [9e6, 10000], [0, 10000]]\nvalue = 40.0\nspacing_m = 0.1",
        [
            (
                'area[0] "meadow".spacing_m: 0.1 m between lines take 7499999876 lines, '
                "and 5000 are the most; set them further apart, or make several missions of it"
            )
        ],
    ),
    "wholly in a zone": (
        "polygon_m = [[80, 40], [120, 40], [120, 60], [80, 60]]",
        "polygon_m = [[-2, -2], [300, -2], [300, 98], [-2, 98]]",
        [
            (
                'area[0] "meadow".polygon_m: zones with their margin leave nothing of it; '
                "move it out of zones, or change these"
            )
        ],
    ),
    "line with the id of a task": (
        'name = "survey"\n',
        'name = "survey"\ntask = [{ id = "meadow-03", position_m = [0.0, 0.0], value = 1.0 }]\n',
        [
            (
                "area[0] \"meadow\".id: its line 'meadow-03' has the id of task[0]; "
                "give the area another id"
            )
        ],
    ),
    "chance at a line that is not there": (
        "meadow-02 = 0.9",
        "meadow-99 = 0.9",
        [
            (
                'uav[0] "u1".success.meadow-99: no area has this line; '
                "give the id of a line that swarm plan tells"
            )
        ],
    ),
    "chance at nothing": (
        "photograph = 0.8",
        "photography = 0.8",
        [
            (
                'uav[0] "u1".success.photography: no task has this id or kind; '
                "did you mean 'photograph'?"
            )
        ],
    ),
    "misspelled key": (
        "heading_deg",
        "headin_deg",
        ["area[0] \"meadow\".headin_deg: unknown key; did you mean 'heading_deg'?"],
    ),
}


@pytest.mark.parametrize("case", WRONG)
def test_one_wrong_place_takes_its_exact_line(case: str) -> None:
    old, new, lines = WRONG[case]
    assert old in VALID

    assert faults(VALID.replace(old, new, 1)) == [f"s.toml: {line}" for line in lines]


def test_outline_of_too_many_corners_is_refused_before_anything_is_cut() -> None:
    corners = [[0.01 * number, 0.0] for number in range(10_001)] + [[50.0, 80.0]]

    assert faults(VALID.replace(SQUARE, str(corners)).replace("holes_m", "#"))[0] == (
        's.toml: area[0] "meadow".polygon_m: has 10002 corners with its holes, and lines are made '
        "of 10000; simplify its outline"
    )


def read(text: str = VALID) -> Mission:
    return parse_scenario(text.encode(), "s.toml")


def test_lines_of_areas_follow_the_tasks_and_share_the_value_by_length() -> None:
    own = 'task = [{ id = "t1", position_m = [0.0, -20.0], value = 1.0 }]'
    mission = read(VALID.replace("\n\n", f"\n{own}\n\n", 1))
    meadow, slope = mission.areas
    lines = {task.id: task for task in mission.tasks}

    assert list(lines) == ["t1", *meadow.line_ids, *slope.line_ids]
    assert meadow.line_ids[:2] == (TaskId("meadow-01"), TaskId("meadow-02"))
    for area in (meadow, slope):
        of_area = [lines[name] for name in area.line_ids]
        assert sum(line.value for line in of_area) == pytest.approx(area.value)
        assert {line.trigger_m for line in of_area} == {area.picture_m}
        assert {line.height_m for line in of_area} == {area.height_m}
    of_slope = lines[slope.line_ids[0]]
    assert (of_slope.kind, of_slope.service_s, of_slope.due_s) == ("photograph", 2.0, 500.0)
    assert (of_slope.opens_s, of_slope.closes_s, of_slope.appears_s) == (10.0, 400.0, 20.0)
    assert mission.known_at_start().areas == mission.areas


def test_a_known_camera_is_that_of_its_numbers() -> None:
    named, numbered = read(), read(VALID.replace('"dji-phantom-4-pro"', NUMBERS + " }"))
    turned = read(VALID.replace('"dji-phantom-4-pro"', NUMBERS + ", landscape = false }"))

    assert numbered == named
    # 60 m over 8.8 mm: 90 m across and 60 m along, of which 30 and 20 % are new.
    assert named.areas[1].apart_m == pytest.approx(27.0)
    assert named.areas[1].picture_m == pytest.approx(12.0)
    assert turned.areas[1].apart_m == pytest.approx(18.0)
    assert turned.areas[1].picture_m == pytest.approx(18.0)


def test_what_is_written_is_read_as_the_same_mission_with_its_areas() -> None:
    for mission in (read(), read(VALID.replace('"dji-phantom-4-pro"', NUMBERS + " }"))):
        text = format_scenario(mission)
        assert parse_scenario(text.encode(), "again.toml") == mission
        assert text.count("[[area]]") == 2
        assert text.count("[[task]]") == 0
        assert 'camera = "dji-phantom-4-pro"' in text


def test_a_camera_of_nobody_elses_is_written_by_its_numbers() -> None:
    numbers = NUMBERS.replace("13.2", "13.1") + ", landscape = false, exposure_s = 0.002 }"
    mission = read(VALID.replace('"dji-phantom-4-pro"', numbers))

    assert f"camera = {numbers}" in format_scenario(mission)
    assert parse_scenario(format_scenario(mission).encode(), "again.toml") == mission


def test_an_area_of_which_a_line_is_gone_is_written_as_its_other_lines() -> None:
    mission = read()
    left = replace(mission, tasks=mission.tasks[1:])

    text = format_scenario(left)

    assert text.count("[[area]]") == 1
    again = parse_scenario(text.encode(), "again.toml")
    assert {task.id: task for task in again.tasks} == {task.id: task for task in left.tasks}
    assert re.findall(r'id = "(meadow-\d+)"', text) == list(mission.areas[0].line_ids[1:])
