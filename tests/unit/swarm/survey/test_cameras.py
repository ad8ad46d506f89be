"""Cameras: what they see from a height, by similar triangles, and how they are called."""

from __future__ import annotations

import re

import pytest

from swarm.model import Area, AreaId, Camera
from swarm.survey import cameras
from swarm.survey.cameras import CAMERAS, name_of

CAMERA = Camera(13.2, 8.8, 8.8, 5472, 3648, exposure_s=0.002)
SQUARE = ((0.0, 0.0), (100.0, 0.0), (100.0, 100.0), (0.0, 100.0))


def test_footprint_and_pixels_grow_with_the_height() -> None:
    assert CAMERA.footprint_m(88.0) == pytest.approx((132.0, 88.0))
    assert CAMERA.ground_sample_m(88.0) == pytest.approx(132.0 / 5472.0)
    assert CAMERA.ground_sample_m(44.0) == pytest.approx(66.0 / 5472.0)
    # 2 cm in 2 ms at 10 m/s.
    assert CAMERA.blur_px(88.0, 10.0) == pytest.approx(0.02 / (132.0 / 5472.0))


def test_overlaps_leave_so_much_of_the_footprint_between_lines_and_pictures() -> None:
    area = Area(
        AreaId("a"), SQUARE, 1.0, camera=CAMERA, height_m=88.0, sidelap_frac=0.6, frontlap_frac=0.75
    )

    assert area.apart_m == pytest.approx(0.4 * 132.0)
    assert area.picture_m == pytest.approx(0.25 * 88.0)


@pytest.mark.parametrize("name", CAMERAS)
def test_known_cameras_have_square_pixels_and_the_numbers_of_the_table(name: str) -> None:
    camera = CAMERAS[name]
    along = camera.sensor_height_mm / camera.image_height_px
    across = camera.sensor_width_mm / camera.image_width_px

    assert along == pytest.approx(across, rel=0.02)
    assert camera.sensor_width_mm > camera.sensor_height_mm
    assert name_of(camera) == name
    (row,) = re.findall(rf"^\| {name} \| (.*) \|$", cameras.__doc__ or "", re.MULTILINE)
    numbers = [float(number) for number in re.findall(r"[\d.]+", row.rpartition("|")[0])]
    assert numbers == [
        camera.sensor_width_mm,
        camera.sensor_height_mm,
        camera.focal_length_mm,
        camera.image_width_px,
        camera.image_height_px,
    ]


def test_a_camera_of_other_numbers_has_no_name() -> None:
    assert name_of(CAMERA) is None


@pytest.mark.parametrize(
    ("given", "said"),
    [
        ({}, "area a needs spacing_m, or a camera and a height_m > 0"),
        ({"spacing_m": 10.0, "camera": CAMERA}, "area a has both spacing_m and a camera"),
        ({"camera": CAMERA, "height_m": 50.0}, "sidelap_frac of area a must be within 0..1"),
        ({"spacing_m": 0.0}, "spacing_m of area a must be > 0, not 0.0"),
        ({"spacing_m": 10.0, "heading_deg": float("nan")}, "heading_deg of area a must be finite"),
        ({"spacing_m": 10.0, "due_s": -1.0}, "due_s of area a must be >= 0, not -1.0"),
        (
            {"camera": CAMERA, "height_m": 50.0, "trigger_m": 3.0},
            "trigger_m of area a goes with spacing_m",
        ),
    ],
)
def test_an_area_that_makes_no_sense_is_refused(given: dict[str, object], said: str) -> None:
    with pytest.raises(ValueError, match=said):
        Area(AreaId("a"), SQUARE, 1.0, **given)  # type: ignore[arg-type]


def test_a_camera_without_a_size_is_refused() -> None:
    with pytest.raises(ValueError, match="focal_length_mm of a camera must be > 0, not 0"):
        Camera(13.2, 8.8, 0.0, 5472, 3648)
