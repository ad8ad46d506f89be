"""What reports are told of areas: coverage planned and flown, pictures, and how sharp they are."""

from __future__ import annotations

import pytest

from coordinator.mission_view.area_report import areas_as_json, areas_in_words
from swarm.model import Mission, TaskId
from swarm.scenario import parse_scenario
from swarm.survey.facts import area_facts, pictures

TEXT = """\
schema = 2
name = "survey"
task = []

[mission]
horizon_s = 600.0

[[uav]]
id = "u1"
position_m = [0.0, 0.0]
speed_m_s = 8.0

[[uav]]
id = "u2"
position_m = [0.0, 0.0]
speed_m_s = 10.0

[[area]]
id = "field"
polygon_m = [[0, 0], [400, 0], [400, 108], [0, 108]]
value = 40.0
camera = "dji-phantom-4-pro"
height_m = 60.0
sidelap_frac = 0.7
frontlap_frac = 0.8
max_line_m = 200.0
"""
LINES = [TaskId(f"field-{number:02d}") for number in range(1, 9)]


def mission(text: str = TEXT) -> Mission:
    return parse_scenario(text.encode(), "s.toml")


def test_facts_are_those_of_the_lines_and_of_the_fastest_uav() -> None:
    (facts,) = area_facts(mission(), planned=LINES, flown=LINES[:4])

    assert (facts.lines, facts.lines_planned, facts.lines_flown) == (8, 8, 4)
    assert facts.length_m == pytest.approx(1600.0)
    assert facts.apart_m == pytest.approx(27.0)
    assert facts.picture_m == pytest.approx(12.0)
    assert facts.to_cover_m2 == pytest.approx(43_200.0)
    # A picture at the beginning of a line of 200 m and one every 12 m.
    assert facts.pictures == 8 * 17
    assert facts.ground_sample_m == pytest.approx(13.2 / 5472 * 60.0 / 8.8)
    assert facts.blur_px == pytest.approx(0.01 / (13.2 / 5472 * 60.0 / 8.8))
    assert facts.every_s == pytest.approx(1.2)
    assert facts.coverage_planned == 1.0
    # The lower half of its four strips, and the metre that counts as well.
    assert facts.coverage_flown == pytest.approx((54.0 + 1.0) / 108.0, abs=1e-3)


def test_nothing_is_known_of_a_flight_before_it_nor_of_pictures_without_a_camera() -> None:
    camera = TEXT[TEXT.index("camera") : TEXT.index("max_line_m")]
    (facts,) = area_facts(mission(TEXT.replace(camera, "spacing_m = 27.0\n")), planned=LINES)

    assert (facts.lines_flown, facts.coverage_flown) == (None, None)
    assert (facts.pictures, facts.ground_sample_m, facts.blur_px, facts.every_s) == (None,) * 4


def test_an_area_of_which_too_little_is_covered_is_told_as_bad() -> None:
    whole, about = areas_in_words(mission(), LINES, LINES)
    half, _ = areas_in_words(mission(), LINES, LINES[:4])
    planned, _ = areas_in_words(mission(), LINES)

    assert whole.shown() == (
        "100.00 % covered by 8 of 8 lines, 100.00 % planned; 8 lines, 1.6 km, 27 m apart at most"
    )
    assert about.shown() == (
        "136 pictures, one every 12 m (1.2 s), 1.6 cm a pixel, blur 0.61 px, "
        "overlap 80 % ahead, 70 % aside"
    )
    assert planned.shown().startswith("covers 100.00 % of 4.3 ha; 8 lines")
    assert [whole.bad, half.bad, planned.bad] == [False, True, False]


def test_an_area_that_appears_later_is_in_no_plan_and_no_fault_of_it() -> None:
    later = mission(TEXT.replace("max_line_m", "appears_s = 60.0\nmax_line_m"))

    planned, _ = areas_in_words(later, ())
    flown, _ = areas_in_words(later, (), LINES[:1])

    assert [planned.bad, flown.bad] == [False, True]


def test_programs_are_told_of_areas_where_there_are_some() -> None:
    told = areas_as_json(mission(), LINES, LINES)

    areas = told["areas"]
    assert isinstance(areas, dict)
    assert areas.keys() == {"field"}
    assert areas["field"]["coverage_flown"] == 1.0
    assert areas["field"]["ground_sample_m"] == pytest.approx(0.01645, abs=1e-5)
    bare = TEXT[: TEXT.index("[[area]]")]
    assert areas_as_json(mission(bare), ()) == {}


def test_the_last_picture_of_a_line_is_not_lost_to_rounding() -> None:
    assert pictures([0.0, 11.9, 12.0, 3 * 0.1 * 120.0], 12.0) == 1 + 1 + 2 + 4
