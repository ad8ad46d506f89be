"""[terrain] of a scenario: heights from tiles and GeoTIFFs, and one line for whatever is wrong."""

from __future__ import annotations

import gzip
import zipfile
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from rasterio import Affine
from rasterio.warp import transform

from swarm.allocation.legs.ground import ground_of
from swarm.model import Mission
from swarm.model.frames import Origin, enu_from_wgs84, wgs84_from_enu
from swarm.model.terrain import MOST_HEIGHTS
from swarm.runtime.errors import InputError
from swarm.scenario import format_scenario, load_scenario, parse_scenario
from tests.support.ground_files import geotiff

ORIGIN = Origin(47.4, 8.5, 488.0)
SCENARIO = """\
schema = 2
name = "hills"
[mission]
horizon_s = 600.0
[origin]
lat_deg = 47.4
lon_deg = 8.5
alt_m = 488.0
[terrain]
file = "{file}"
clearance_m = 20.0
[[uav]]
id = "u1"
position_m = [0.0, 0.0]
speed_m_s = 10.0
[[task]]
id = "t1"
position_m = [{east}, 100.0]
value = 1.0
"""


def load(folder: Path, file: str, east_m: float = 400.0, more: str = "") -> Mission:
    path = folder / "hills.toml"
    path.write_text(SCENARIO.format(file=file, east=east_m) + more)
    return load_scenario(path)


def fault(folder: Path, file: str, east_m: float = 400.0, more: str = "") -> str:
    with pytest.raises(InputError) as caught:
        load(folder, file, east_m, more)
    lines = str(caught.value).splitlines()
    assert len(lines) == 1
    return lines[0]


def slope_m(lat_deg: Any, lon_deg: Any) -> Any:
    return 500.0 + 20_000.0 * (np.asarray(lon_deg) - 8.5) + 5_000.0 * (np.asarray(lat_deg) - 47.4)


def tile(void: bool = False) -> bytes:
    lat_deg = 48.0 - np.arange(1201)[:, None] / 1200.0
    lon_deg = 8.0 + np.arange(1201)[None, :] / 1200.0
    heights_m = np.clip(np.round(slope_m(lat_deg, lon_deg)), -400, 9000).astype(">i2")
    if void:
        heights_m[700:740, 590:620] = -32768
    return bytes(heights_m.tobytes())


def wgs84_slope(side: int = 80) -> Any:
    lat_deg = 47.41 - 0.0005 * (np.arange(side)[:, None] + 0.5)
    lon_deg = 8.49 + 0.0005 * (np.arange(side)[None, :] + 0.5)
    return slope_m(lat_deg, lon_deg)


def off_m(mission: Mission, east_m: float = 400.0) -> float:
    """How far a place's height is from the slope."""
    lat_deg, lon_deg, _ = wgs84_from_enu(ORIGIN, (east_m, 100.0, 0.0))
    return mission.tasks[0].position_enu_m[2] - float(slope_m(lat_deg, lon_deg)) + ORIGIN.alt_m


def zipped(path: Path, name: str, data: bytes) -> None:
    with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED) as archive:
        archive.writestr(name, data)


def test_places_stand_on_the_ground_of_a_tile_packed_or_not(tmp_path: Path) -> None:
    (tmp_path / "N47E008.hgt").write_bytes(tile())
    (tmp_path / "N47E008.hgt.gz").write_bytes(gzip.compress(tile(), 1))
    zipped(tmp_path / "N47E008.hgt.zip", "N47E008.hgt", tile())

    plain, packed, archived = (
        load(tmp_path, f"N47E008.hgt{suffix}") for suffix in ("", ".gz", ".zip")
    )

    assert plain == packed == archived
    assert abs(off_m(plain)) <= 0.7  # tiles have whole metres
    assert plain.uavs[0].position_enu_m[2] == pytest.approx(12.0, abs=0.7)
    assert plain.terrain is not None
    assert plain.terrain.clearance_m == 20.0


def test_a_geotiff_in_degrees_is_taken_as_it_is(tmp_path: Path) -> None:
    geotiff(tmp_path / "hills.tif", wgs84_slope())
    mission = load(tmp_path, "hills.tif")
    assert 0.0 <= off_m(mission) <= 0.11
    assert mission.terrain is not None
    assert mission.terrain.east_step_m == pytest.approx(37.7, abs=0.1)


def test_no_pixel_of_a_projected_or_fine_geotiff_rises_above_the_ground(tmp_path: Path) -> None:
    rng = np.random.default_rng(3)
    x, y = transform("EPSG:4326", "EPSG:32632", [8.5], [47.4])
    side = 700
    heights_m = 500.0 + rng.uniform(0.0, 4.0, (side, side))
    heights_m[470:480, 330:340] += 60.0
    where = Affine(2.0, 0.0, x[0] - 300.0, 0.0, -2.0, y[0] + 1000.0)
    geotiff(tmp_path / "utm.tif", heights_m, crs="EPSG:32632", transform=where)

    mission = load(tmp_path, "utm.tif")

    assert mission.terrain is not None
    assert len(mission.terrain.steps) <= 2 * MOST_HEIGHTS
    row, column = np.mgrid[460:490, 320:350]
    x_m, y_m = where.c + 2.0 * (column.ravel() + 0.5), where.f - 2.0 * (row.ravel() + 0.5)
    lon_deg, lat_deg = transform("EPSG:32632", "EPSG:4326", x_m, y_m)
    places = zip(lat_deg, lon_deg, strict=True)
    flat_m = np.array([enu_from_wgs84(ORIGIN, *place, 0.0)[:2] for place in places])
    ground_m = ground_of(mission.terrain).up_m(flat_m)
    assert (ground_m - (heights_m[460:490, 320:350].ravel() - 488.0)).min() >= -0.3


def test_a_mission_is_written_with_the_file_of_its_ground(tmp_path: Path) -> None:
    geotiff(tmp_path / "hills.tif", wgs84_slope())
    field = "polygon_m = [[100.0, 0.0], [300.0, 0.0], [300.0, 200.0], [100.0, 200.0]]"
    mission = load(
        tmp_path,
        "hills.tif",
        more=f'[[base]]\nid = "b"\nposition_m = [0.0, 50.0]\n[[area]]\nid = "hay"\n{field}\n'
        'value = 9.0\nspacing_m = 25.0\nheight_m = 60.0\n[[task]]\nid = "line"\n'
        "path_m = [[0.0, 200.0], [400.0, 300.0]]\nvalue = 2.0\n",
    )
    assert {base.position_enu_m[2] for base in mission.bases} != {0.0}

    text = format_scenario(mission)

    assert text.count("[[area]]") == 1
    assert text.count("[[task]]") == 2
    away = tmp_path / "elsewhere"
    away.mkdir()
    (away / "again.toml").write_text(text)
    again = load_scenario(away / "again.toml")
    assert again == mission
    assert again.terrain is not None
    assert again.terrain.file == str((tmp_path / "hills.tif").resolve())


def test_a_band_and_a_separation_over_hills_are_read_and_written(tmp_path: Path) -> None:
    geotiff(tmp_path / "hills.tif", wgs84_slope())
    flat = format_scenario(load(tmp_path, "hills.tif"))
    shared = "[mission]\nseparation_m = 10.0\nband_m = [30.0, 55.0]\n"
    (tmp_path / "shared.toml").write_text(flat.replace("[mission]\n", shared, 1))
    mission = load_scenario(tmp_path / "shared.toml")

    assert (mission.separation_m, mission.band_m) == (10.0, (30.0, 55.0))
    assert mission.terrain is not None
    assert parse_scenario(format_scenario(mission).encode(), "again.toml") == mission
    low = shared.replace("30.0, 55.0", "20.0, 55.0")
    (tmp_path / "low.toml").write_text(flat.replace("[mission]\n", low, 1))
    with pytest.raises(InputError, match=r"mission\.band_m: begins 20\.0 above the ground"):
        load_scenario(tmp_path / "low.toml")


def test_a_mission_whose_file_is_not_known_is_written_as_high_as_it_is(tmp_path: Path) -> None:
    geotiff(tmp_path / "hills.tif", wgs84_slope())
    mission = load(tmp_path, "hills.tif")
    assert mission.terrain is not None
    heard = replace(mission, terrain=replace(mission.terrain, file=None))

    again = parse_scenario(format_scenario(heard).encode(), "again.toml")

    assert again == replace(mission, terrain=None)


def test_what_is_wrong_with_a_tile_is_one_line(tmp_path: Path) -> None:
    assert "no such file" in fault(tmp_path, "N47E008.hgt")
    assert "of no kind" in fault(tmp_path, "hills.asc")
    (tmp_path / "N46E008.hgt").write_bytes(tile())
    assert "has no height at 47." in fault(tmp_path, "N46E008.hgt")
    (tmp_path / "hills.hgt").write_bytes(tile())
    assert "does not say where it lies" in fault(tmp_path, "hills.hgt")
    (tmp_path / "N47E008.hgt").write_bytes(tile()[:-2])
    assert "are no SRTM tile" in fault(tmp_path, "N47E008.hgt")
    (tmp_path / "N47E008.hgt").write_bytes(tile(void=True))
    assert "has no height at 47." in fault(tmp_path, "N47E008.hgt")


def test_hostile_archives_are_one_line(tmp_path: Path) -> None:
    zipped(tmp_path / "N47E008.hgt.zip", "N47E008.hgt", bytes(200_000_000))
    assert "unpacks to more than 24 MiB" in fault(tmp_path, "N47E008.hgt.zip")
    zipped(tmp_path / "N47E009.hgt.zip", "readme.txt", b"")
    assert "0 tiles" in fault(tmp_path, "N47E009.hgt.zip")
    with zipfile.ZipFile(tmp_path / "N47E011.hgt.zip", "w", zipfile.ZIP_LZMA) as archive:
        archive.writestr("N47E011.hgt", tile())
    assert "is packed by method 14; pack it by deflate" in fault(tmp_path, "N47E011.hgt.zip")
    newer = (
        (tmp_path / "N47E009.hgt.zip")
        .read_bytes()
        .replace(b"PK\x01\x02\x14\x03\x14", b"PK\x01\x02\x14\x03\xff")
    )
    (tmp_path / "N47E012.hgt.zip").write_bytes(newer)
    assert "is no plain zip archive: zip file version" in fault(tmp_path, "N47E012.hgt.zip")
    (tmp_path / "N47E010.hgt.zip").write_bytes(b"PK\x03\x04 no archive")
    assert "is no zip archive that can be read" in fault(tmp_path, "N47E010.hgt.zip")
    (tmp_path / "N47E011.hgt.gz").write_bytes(gzip.compress(tile())[:-20])
    assert "cannot be read" in fault(tmp_path, "N47E011.hgt.gz")


def test_what_is_wrong_with_a_geotiff_is_one_line(tmp_path: Path) -> None:
    (tmp_path / "text.tif").write_text("<VRTDataset rasterXSize='1' rasterYSize='1'/>")
    assert "is no GeoTIFF that can be read" in fault(tmp_path, "text.tif")
    geotiff(tmp_path / "bare.tif", wgs84_slope(), crs=None)
    assert "does not say how it is projected" in fault(tmp_path, "bare.tif")
    geotiff(tmp_path / "rgb.tif", np.zeros((3, 80, 80)), dtype="uint8")
    assert "has 3 bands" in fault(tmp_path, "rgb.tif")
    geotiff(tmp_path / "far.tif", wgs84_slope(), crs="EPSG:32632")
    assert "does not reach to the mission" in fault(tmp_path, "far.tif")
    geotiff(tmp_path / "small.tif", wgs84_slope())
    assert "has no height at 47." in fault(tmp_path, "small.tif", east_m=3_000.0)
    geotiff(tmp_path / "sky.tif", np.full((80, 80), 1e30))
    assert "has a height of 1e+30 m" in fault(tmp_path, "sky.tif")
    geotiff(tmp_path / "void.tif", np.full((80, 80), -9999.0), nodata=-9999.0)
    assert "has no height at 47." in fault(tmp_path, "void.tif")


@pytest.mark.parametrize(
    ("file", "told"),
    [
        (
            {"transform": Affine(5e-4, 0.0, 8.49, 5e-4, 0.0, 47.41)},
            "does not say where its heights",
        ),
        ({"transform": Affine(1e-300, 0.0, 8.49, 0.0, -1e-300, 47.41)}, "does not say where its"),
        ({"transform": Affine(np.nan, 0.0, 8.49, 0.0, -5e-4, 47.41)}, "does not say where its"),
        ({"crs": "EPSG:4979"}, "its heights are above the ellipsoid; give them above the sea"),
        ({"scales": np.nan}, "has no height at 47."),
        ({"offsets": np.inf}, "has no height at 47."),
        ({"scales": 1e300}, "has a height of"),
    ],
)
def test_a_geotiff_that_says_nonsense_of_its_heights_is_one_line(
    tmp_path: Path, file: dict[str, Any], told: str
) -> None:
    geotiff(tmp_path / "odd.tif", wgs84_slope(), **file)
    assert told in fault(tmp_path, "odd.tif")


def test_heights_are_what_scale_and_offset_make_of_pixels(tmp_path: Path) -> None:
    decimetres = np.round((wgs84_slope() - 400.0) * 10.0)
    geotiff(tmp_path / "dm.tif", decimetres, dtype="int16", scales=0.1, offsets=400.0)
    assert abs(off_m(load(tmp_path, "dm.tif"))) <= 0.2


def test_pixels_that_are_no_numbers_are_no_heights(tmp_path: Path) -> None:
    heights_m = wgs84_slope()
    heights_m[15:25, 15:60] = np.inf
    geotiff(tmp_path / "inf.tif", heights_m)
    assert "has no height at 47." in fault(tmp_path, "inf.tif")


def test_a_truncated_geotiff_is_one_line(tmp_path: Path) -> None:
    geotiff(tmp_path / "hills.tif", wgs84_slope())
    data = (tmp_path / "hills.tif").read_bytes()
    (tmp_path / "cut.tif").write_bytes(data[:600])
    assert "is no GeoTIFF that can be read" in fault(tmp_path, "cut.tif")


@pytest.mark.parametrize(
    ("more", "told"),
    [
        ('[[task]]\nid = "t2"\nposition_m = [1.0, 2.0, 3.0]\nvalue = 1.0\n', "stand on the ground"),
        (
            '[[task]]\nid = "t2"\nlat_deg = 47.4\nlon_deg = 8.5\nalt_m = 1.0\nvalue = 1.0\n',
            "stand on the ground",
        ),
        (
            '[[task]]\nid = "t2"\nposition_m = [1.0, 2.0]\nvalue = 1.0\nheight_m = 21.0\n',
            "too near to clearance_m; give 23 or more",
        ),
    ],
)
def test_what_does_not_go_with_a_terrain_is_a_fault_of_the_file(
    tmp_path: Path, more: str, told: str
) -> None:
    assert told in fault(tmp_path, "N47E008.hgt", more=more)
