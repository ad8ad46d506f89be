"""What surveyors have, from a map and a GeoTIFF to a flight over the hills."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from rasterio import Affine

from swarm.cli import main
from swarm.model import Mission, Origin
from swarm.model.frames import enu_from_wgs84, wgs84_from_enu
from swarm.scenario import load_scenario
from tests.support.ground_files import geotiff

HOME = Origin(47.4, 8.5, 488.0)
STEP_DEG = 0.0005
MAP = """<?xml version="1.0" encoding="UTF-8"?>
<kml xmlns="http://www.opengis.net/kml/2.2"><Document>
<Placemark><name>meadow</name><Polygon><outerBoundaryIs><LinearRing><coordinates>
8.5040,47.4000 8.5070,47.4000 8.5070,47.4020 8.5040,47.4020 8.5040,47.4000
</coordinates></LinearRing></outerBoundaryIs></Polygon></Placemark>
<Placemark><name>pipe</name><LineString><altitudeMode>relativeToGround</altitudeMode>
<coordinates>8.5010,47.4005,40 8.5030,47.4010,40 8.5035,47.4030,40</coordinates></LineString>
</Placemark>
<Placemark><name>well</name><Point><altitudeMode>absolute</altitudeMode>
<coordinates>8.5020,47.3990,505</coordinates></Point></Placemark>
</Document></kml>
"""


def above_sea_m(lat_deg: Any, lon_deg: Any) -> Any:
    """A hillside that rises to the east, with furrows across it."""
    east = np.asarray(lon_deg) - 8.5
    north = np.asarray(lat_deg) - 47.4
    return 490.0 + 9_000.0 * east + 6.0 * np.sin(east * 1_500.0) + 2_000.0 * north


@pytest.fixture(name="survey")
def _survey(tmp_path: Path) -> Path:
    (tmp_path / "map.kml").write_text(MAP)
    lat_deg = 47.41 - STEP_DEG * (np.arange(40)[:, None] + 0.5)
    lon_deg = 8.49 + STEP_DEG * (np.arange(60)[None, :] + 0.5)
    geotiff(tmp_path / "hills.tif", above_sea_m(lat_deg, lon_deg))
    return tmp_path


def run(survey: Path, *arguments: str) -> int:
    home = f"{HOME.lat_deg},{HOME.lon_deg},{HOME.alt_m}"
    out = str(survey / "out.toml")
    files = [str(survey / "map.kml"), "--terrain", str(survey / "hills.tif")]
    return main(["import", *files, "--home", home, *arguments, "-o", out])


def height_of_file_m(east_m: float, north_m: float) -> float:
    """Of the ground above the origin, bilinear between the pixels of the file."""
    lat_deg, lon_deg, _ = wgs84_from_enu(HOME, (east_m, north_m, 0.0))
    column, row = (lon_deg - 8.49) / STEP_DEG - 0.5, (47.41 - lat_deg) / STEP_DEG - 0.5
    left, top = int(column), int(row)
    corners = [
        (above_sea_m(47.41 - STEP_DEG * (y + 0.5), 8.49 + STEP_DEG * (x + 0.5)), share)
        for x, of_x in ((left, left + 1 - column), (left + 1, column - left))
        for y, of_y in ((top, top + 1 - row), (top + 1, row - top))
        for share in [of_x * of_y]
    ]
    return float(sum(height * share for height, share in corners)) - HOME.alt_m


def told(capsys: pytest.CaptureFixture[str], *arguments: str) -> dict[str, Any]:
    assert main([*arguments, "--json"]) == 0
    found: dict[str, Any] = json.loads(capsys.readouterr().out)
    return found


def assert_heights(mission: Mission, entries: list[dict[str, Any]]) -> None:
    """Lines are followed as high above the ground as they were asked for."""
    tasks = {str(task.id): task for task in mission.tasks}
    for entry in entries:
        task = tasks.get(entry["go"])
        if task is None:
            continue
        begin_m, up_m = entry["via_m"][-1], entry["up_m"][-1]
        above_m = up_m - height_of_file_m(*begin_m)
        expected_m = 10.0 if task.height_m is None else task.height_m
        at_least, at_most = (23.0, 32.0) if task.height_m is None else (expected_m, expected_m + 1)
        assert at_least - 0.2 <= above_m <= at_most + 0.2, entry["go"]


def test_a_map_and_a_geotiff_become_a_flight_over_the_hills(
    survey: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    options = ("--camera", "dji-phantom-4-pro", "--height-m", "60", "--speed-m-s", "10")
    assert run(survey, *options, "--clearance-m", "20") == 0
    said = capsys.readouterr().err
    assert "heights of 1 tasks are left out, as they stand on the ground now" in said

    mission = load_scenario(survey / "out.toml")

    assert mission.terrain is not None
    assert mission.terrain.clearance_m == 20.0
    heights_m = {str(task.id): task.height_m for task in mission.tasks}
    assert heights_m.pop("well") is None
    assert heights_m.pop("pipe") == 40.0
    assert set(heights_m.values()) == {60.0}
    for task in mission.tasks:
        for place in (task.position_enu_m, *task.path_enu_m):
            assert place[2] == pytest.approx(height_of_file_m(*place[:2]), abs=0.11)
    (meadow,) = mission.areas
    corner = enu_from_wgs84(HOME, 47.4, 8.504, HOME.alt_m)
    assert meadow.polygon_enu_m[0] == pytest.approx(corner[:2], abs=1e-3)

    plan = told(capsys, "plan", str(survey / "out.toml"), "--method", "greedy")

    assert plan["left_out"] == {}
    for entries in plan["schedule"].values():
        assert_heights(mission, entries)
    flown = told(capsys, "simulate", str(survey / "out.toml"), "--method", "greedy")
    assert sorted(flown["done"]) == sorted(heights_m | {"well": None, "pipe": None})
    assert flown["lowest_clearance_m"] >= 20.0
    assert flown["areas"]["meadow"]["coverage_flown"] >= 0.995


@pytest.mark.parametrize(
    ("file", "problem"),
    [
        ("none.tif", "no such file"),
        ("text.tif", "is no GeoTIFF that can be read"),
        ("small.tif", "does not reach to the mission"),
        ("feet.tif", "its heights are in feet"),
        ("map.kml", "is of no kind whose heights are known here"),
        ("nan.tif", "has no height at 47."),
        ("huge.tif", "heights around the mission"),
    ],
)
def test_a_terrain_that_gives_no_heights_is_one_line(
    survey: Path, capsys: pytest.CaptureFixture[str], file: str, problem: str
) -> None:
    (survey / "text.tif").write_bytes(b"II*\0" + b"\xff" * 2000)
    geotiff(survey / "small.tif", np.full((4, 4), 500.0))
    geotiff(survey / "feet.tif", np.full((60, 60), 500.0), units="feet")
    geotiff(survey / "nan.tif", np.full((60, 60), np.nan))
    fine = {"transform": Affine(1e-6, 0.0, 8.4995, 0.0, -1e-6, 47.4035), "compress": "deflate"}
    geotiff(survey / "huge.tif", np.zeros((5000, 9000), "uint8"), dtype="uint8", **fine)

    options = ("--spacing-m", "30", "--height-m", "60", "--terrain", str(survey / file))
    assert run(survey, *options) == 2

    said = capsys.readouterr().err.strip()
    assert len(said.splitlines()) == 1
    assert problem in said
    assert not (survey / "out.toml").exists()
