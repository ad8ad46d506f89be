"""Heights of the ground from files: GeoTIFF by rasterio, and SRTM tiles (.hgt, zipped or not).

Everything that is wrong with a file is one line. What is given is the file's own grid where that
is small enough and goes by latitude and longitude, as the mission's frame does; else a grid that
no height of the file rises above. Leaves out: which places a mission needs (swarm.scenario.ground).

SRTM: https://lpdaac.usgs.gov/documents/179/SRTM_User_Guide_V3.pdf
"""

from __future__ import annotations

import gzip
import math
import re
import warnings
import zlib
from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path
from typing import IO

import numpy as np
import numpy.typing as npt

from swarm.model import Origin
from swarm.model.frames import enu_from_wgs84, wgs84_from_enu
from swarm.model.terrain import MOST_HEIGHTS, MOST_STEPS, STEP_M, Terrain
from swarm.runtime.errors import Fault, InputError
from swarm.scenario.findings import printable
from swarm.scenario.task_files.archive import members_of

FloatArray = npt.NDArray[np.float64]
Box = tuple[float, float, float, float]
"""West, south, east, north [m]."""

_MOST_PIXELS = 16_000_000
"""Of a file, that a mission may need."""
_MOST_BLOCK = 2**28
"""Bytes of a block, which is read as a whole."""
_HIGHEST_M = 12_000.0
"""Nothing on Earth is farther from the sea level."""
_HGT_SIDES = (1201, 3601)
_MOST_BYTES = 2 * _HGT_SIDES[-1] ** 2
"""Of a tile, packed or not."""
_HGT_VOID = -32768
_TILE = re.compile(r"([NS])(\d\d)([EW])(\d\d\d)", re.IGNORECASE)
_SUFFIXES = (".tif", ".tiff", ".hgt", ".hgt.gz", ".hgt.zip")
_LATTICE = 9
_BULGE_FRAC = 0.01
"""By how much of its size, and more, the edge of a grid may be curved between its places."""
_FRAME_M = 100.0
"""What is kept around the places of a mission, as far as the file reaches [m]."""


class _UnusableError(Exception):
    """Why a file gives no heights, and what would."""

    def __init__(self, problem: str, remedy: str) -> None:
        super().__init__(problem)
        self.problem, self.remedy = problem, remedy


@dataclass(frozen=True, slots=True)
class _Raster:
    """A part of a file: heights of its pixels, NaN where there are none."""

    up_m: FloatArray
    """(rows, columns) [m above mean sea level]."""
    pixel: Callable[[FloatArray, FloatArray], tuple[FloatArray, FloatArray]]
    """Latitude and longitude [deg] to column and row, whole at the middle of pixels."""
    is_geographic: bool
    """Columns are meridians, and rows parallels."""

    def at(self, lat_deg: FloatArray, lon_deg: FloatArray) -> FloatArray:
        """Heights at (n,) places, bilinear; NaN where the file has none."""
        column, row = self.pixel(lat_deg, lon_deg)
        rows, columns = self.up_m.shape
        near = 1e-6  # of a pixel
        inside = (column >= -near) & (row >= -near)
        inside &= (column <= columns - 1 + near) & (row <= rows - 1 + near)
        column, row = (np.where(inside, each, 0.0) for each in (column, row))
        if self.is_geographic:  # a place that is on a meridian but for its rounding is on it
            column, row = (
                np.where(np.abs(each - np.round(each)) < near, np.round(each), each)
                for each in (column, row)
            )
        left = np.clip(np.floor(column), 0, columns - 2).astype(int)
        top = np.clip(np.floor(row), 0, rows - 2).astype(int)
        x, y = column - left, row - top
        parts = [
            (self.up_m[top, left], (1 - x) * (1 - y)),
            (self.up_m[top, left + 1], x * (1 - y)),
            (self.up_m[top + 1, left], (1 - x) * y),
            (self.up_m[top + 1, left + 1], x * y),
        ]
        # A pixel without a height that has no share is of no concern.
        found = sum(np.where(share > 0.0, height_m * share, 0.0) for height_m, share in parts)
        return np.where(inside, found, np.nan)


def read_terrain(path: Path, origin: Origin, around: Box, clearance_m: float) -> Terrain:
    """The ground around the places of a mission.

    Args:
        path: of the file.
        origin: of the mission.
        around: a box in which every path lies; the file must have heights all over it.
        clearance_m: for `Terrain`.

    Raises:
        InputError: one line, about the file.
    """
    source = printable(str(path))
    try:
        raster = _raster(path, origin, _grown(around, _FRAME_M))
        frame, count = _frame(raster, origin, around)
        terrain = _terrain(raster, origin, around, frame, count, clearance_m)
        return replace(terrain, file=str(path.resolve()))
    except _UnusableError as error:
        raise InputError(Fault(source, "", error.problem, error.remedy)) from error
    except (OSError, EOFError, zlib.error) as error:
        reason = (error.strerror if isinstance(error, OSError) else None) or str(error)
        fault = Fault(source, "", f"cannot be read: {printable(reason)}", "give a readable file")
        raise InputError(fault) from error


def _raster(path: Path, origin: Origin, box: Box) -> _Raster:
    name = path.name.lower()
    if not name.endswith(_SUFFIXES):
        remedy = f"give a GeoTIFF or an SRTM tile: {', '.join(_SUFFIXES)}"
        raise _UnusableError("is of no kind whose heights are known here", remedy)
    if not path.is_file():
        raise _UnusableError("no such file", "give the path of a file, beside the scenario or not")
    if name.endswith((".tif", ".tiff")):
        return _geotiff(path, origin, box)
    return _hgt(path)


# -- SRTM tiles ---------------------------------------------------------------------------


def _hgt(path: Path) -> _Raster:
    found = _TILE.match(path.name)
    if found is None:
        remedy = "name it by its south-west corner, such as N47E008.hgt"
        raise _UnusableError("its name does not say where it lies", remedy)
    data = _hgt_bytes(path)
    side = math.isqrt(len(data) // 2)
    if side not in _HGT_SIDES or len(data) != 2 * side * side:
        remedy = f"give a tile of {' or '.join(f'{n} × {n}' for n in _HGT_SIDES)} heights"
        raise _UnusableError(f"{len(data)} bytes are no SRTM tile", remedy)
    up_m = np.frombuffer(data, dtype=">i2").reshape(side, side).astype(np.float64)
    up_m[up_m == _HGT_VOID] = np.nan
    south_deg = int(found[2]) * (1 if found[1].upper() == "N" else -1)
    west_deg = int(found[4]) * (1 if found[3].upper() == "E" else -1)

    def pixel(lat_deg: FloatArray, lon_deg: FloatArray) -> tuple[FloatArray, FloatArray]:
        east_deg = (lon_deg - west_deg + 180.0) % 360.0 - 180.0
        return east_deg * (side - 1), (south_deg + 1 - lat_deg) * (side - 1)

    return _Raster(up_m, pixel, is_geographic=True)


def _hgt_bytes(path: Path) -> bytes:
    """All bytes of a tile, and one more at most."""
    name = path.name.lower()
    if name.endswith(".hgt"):
        with path.open("rb") as file:
            return _some(file)
    if name.endswith(".gz"):
        with gzip.open(path, "rb") as unzipped:
            return _some(unzipped)
    with path.open("rb") as file:
        packed = _some(file)
    tiles = members_of(packed, [".hgt"], printable(str(path)), _MOST_BYTES)
    if len(tiles) != 1:
        raise _UnusableError(f"has {len(tiles)} tiles in it", "give one with one .hgt in it")
    return next(iter(tiles.values()))


def _some(file: IO[bytes] | gzip.GzipFile) -> bytes:
    return file.read(_MOST_BYTES + 1)


# -- GeoTIFF ------------------------------------------------------------------------------


def _geotiff(path: Path, origin: Origin, box: Box) -> _Raster:
    try:
        import rasterio
        from rasterio._err import CPLE_BaseError
        from rasterio.errors import RasterioError
    except ImportError as error:
        remedy = "pip install 'peckorder[terrain]', or give an SRTM tile (.hgt)"
        raise _UnusableError("a GeoTIFF is read by rasterio, which is not here", remedy) from error
    try:
        with (
            warnings.catch_warnings(),
            rasterio.Env(GDAL_DISABLE_READDIR_ON_OPEN="EMPTY_DIR", GDAL_NUM_THREADS="1"),
        ):
            warnings.simplefilter("ignore")
            return _window(str(path.resolve()), origin, box)
    except (RasterioError, CPLE_BaseError, ValueError, MemoryError) as error:
        told = printable(str(error).partition("\n")[0].replace(str(path.resolve()), "it"))
        problem = f"is no GeoTIFF that can be read: {told}"
        raise _UnusableError(problem, "give a GeoTIFF of heights in metres") from error


def _window(name: str, origin: Origin, box: Box) -> _Raster:
    import rasterio
    from rasterio.warp import transform
    from rasterio.windows import Window

    with rasterio.open(name, driver="GTiff") as file:
        if file.crs is None:
            remedy = "give it one, such as gdal_translate -a_srs EPSG:4326"
            raise _UnusableError("does not say how it is projected", remedy)
        if file.count != 1 or np.dtype(file.dtypes[0]).kind not in "iuf":
            remedy = "give a file of one band with heights in metres"
            raise _UnusableError(f"has {file.count} bands, or none of heights", remedy)
        unit = (file.units[0] or "m").lower()
        if unit not in ("m", "metre", "meter", "metres", "meters"):
            problem = f"its heights are in {printable(unit)}"
            raise _UnusableError(problem, "give them in metres")
        if not abs(file.transform.determinant) > 0.0:
            remedy = "give it a place, such as gdal_translate -a_ullr"
            raise _UnusableError("does not say where its heights lie", remedy)
        if "ellipsoidal height" in file.crs.to_wkt(version="WKT2_2019").lower():
            remedy = "give them above the sea, such as gdalwarp -t_srs EPSG:4326+5773"
            raise _UnusableError("its heights are above the ellipsoid", remedy)
        block = math.prod(file.block_shapes[0]) * np.dtype(file.dtypes[0]).itemsize
        if block > _MOST_BLOCK:
            remedy = "write it in smaller ones: gdal_translate -co TILED=YES"
            raise _UnusableError(f"has blocks of {block // 2**20} MiB", remedy)
        crs, inverse = file.crs, ~file.transform

        def whole(lat_deg: FloatArray, lon_deg: FloatArray) -> tuple[FloatArray, FloatArray]:
            x, y = transform("EPSG:4326", crs, lon_deg, lat_deg)
            x_m, y_m = np.asarray(x), np.asarray(y)
            a, b, c, d, e, f = tuple(inverse)[:6]
            return a * x_m + b * y_m + c - 0.5, d * x_m + e * y_m + f - 0.5

        column, row = whole(*_lattice_deg(origin, box))
        if not (np.isfinite(column).all() and np.isfinite(row).all()):
            raise _UnusableError(
                "its projection does not reach to the mission", "give another file"
            )
        left, top = (max(0, math.floor(each.min()) - 1) for each in (column, row))
        right = min(file.width, math.ceil(column.max()) + 2)
        bottom = min(file.height, math.ceil(row.max()) + 2)
        if right - left < 2 or bottom - top < 2:
            raise _UnusableError("does not reach to the mission", "give a file of that place")
        if (right - left) * (bottom - top) > _MOST_PIXELS:
            problem = f"has {right - left} × {bottom - top} heights around the mission"
            remedy = f"give at most {_MOST_PIXELS} of them: gdalwarp -tr makes them fewer"
            raise _UnusableError(problem, remedy)
        part = file.read(1, window=Window(left, top, right - left, bottom - top), masked=True)
        up_m = np.ma.filled(part.astype(np.float64), np.nan) * file.scales[0] + file.offsets[0]
        up_m[~np.isfinite(up_m)] = np.nan
        is_geographic = bool(crs.is_geographic) and file.transform.is_rectilinear

    def pixel(lat_deg: FloatArray, lon_deg: FloatArray) -> tuple[FloatArray, FloatArray]:
        column, row = whole(lat_deg, lon_deg)
        return column - left, row - top

    return _Raster(up_m, pixel, is_geographic)


# -- the mission's grid -------------------------------------------------------------------


@dataclass(frozen=True, slots=True)
class _Frame:
    """Where the heights of a grid are."""

    west_m: float
    south_m: float
    east_step_m: float
    north_step_m: float

    def places_m(self, columns: int, rows: int) -> tuple[FloatArray, FloatArray]:
        """(rows · columns,) east and north [m]."""
        east_m = self.west_m + np.arange(columns) * self.east_step_m
        north_m = self.south_m + np.arange(rows) * self.north_step_m
        return np.tile(east_m, rows), np.repeat(north_m, columns)


def _frame(raster: _Raster, origin: Origin, around: Box) -> tuple[_Frame, tuple[int, int]]:
    """The grid on which a mission keeps the ground, with its columns and rows."""
    box = _grown(around, _FRAME_M)
    corner, others = (0.0, 0.0), np.array([[0.0, 0.0], [1.0, 0.0], [0.0, 1.0]])
    column, row = raster.pixel(*_deg(origin, others[:, 0], others[:, 1]))
    # Pixels per metre to the east and to the north.
    east, north = (math.hypot(column[k] - column[0], row[k] - row[0]) for k in (1, 2))
    step_m = [1.0 / each for each in (east, north)]
    if not raster.is_geographic:
        step_m = [min(step_m)] * 2
    size_m = box[2] - box[0], box[3] - box[1]
    columns, rows = (2 + math.ceil(size_m[k] / step_m[k]) for k in (0, 1))
    if columns * rows > MOST_HEIGHTS:
        more = 1.01 * math.sqrt(columns * rows / MOST_HEIGHTS)
        step_m = [more * each for each in step_m]
        columns, rows = (2 + math.ceil(size_m[k] / step_m[k]) for k in (0, 1))
        corner = box[0], box[1]
    elif raster.is_geographic:  # its own meridians and parallels
        to_east, to_north = column[1] - column[0], row[2] - row[0]
        to_pixel_m = -column[0] / to_east, -row[0] / to_north
        corner = (
            to_pixel_m[0] + step_m[0] * math.floor((box[0] - to_pixel_m[0]) / step_m[0]),
            to_pixel_m[1] + step_m[1] * math.floor((box[1] - to_pixel_m[1]) / step_m[1]),
        )
        columns, rows = columns + 1, rows + 1
    else:
        corner = box[0], box[1]
    return _Frame(*corner, *step_m), (columns, rows)


def _terrain(
    raster: _Raster,
    origin: Origin,
    around: Box,
    frame: _Frame,
    count: tuple[int, int],
    clearance_m: float,
) -> Terrain:
    columns, rows = count
    east_m, north_m = frame.places_m(columns, rows)
    up_m = raster.at(*_deg(origin, east_m, north_m))
    near = (frame.east_step_m, frame.north_step_m)
    needed = (east_m > around[0] - near[0]) & (east_m < around[2] + near[0])
    needed &= (north_m > around[1] - near[1]) & (north_m < around[3] + near[1])
    lacking = np.flatnonzero(needed & np.isnan(up_m))
    if len(lacking):
        at = lacking[0]
        lat_deg, lon_deg, _ = wgs84_from_enu(origin, (float(east_m[at]), float(north_m[at]), 0.0))
        problem = f"has no height at {lat_deg:.6f}, {lon_deg:.6f}, where paths may lead"
        raise _UnusableError(problem, "give a file that has heights all over the mission")
    known_m = up_m[~np.isnan(up_m)]
    if np.abs(known_m).max() > _HIGHEST_M:
        problem = f"has a height of {known_m[np.abs(known_m).argmax()]:g} m"
        raise _UnusableError(problem, "give heights in metres above the sea level")
    # Where nobody should fly and nothing is known, the ground is as high as it gets.
    up_m = np.where(np.isnan(up_m), known_m.max(), up_m).reshape(rows, columns)
    up_m += _lift_m(raster, origin, frame, up_m) - origin.alt_m
    lowest_m = float(up_m.min())
    steps = np.ceil((up_m - lowest_m) / STEP_M - 1e-6).astype(np.int64)
    if steps.max() > MOST_STEPS:
        raise _UnusableError(f"rises by {np.ptp(up_m):g} m", "give a file of the Earth")
    return Terrain(
        clearance_m,
        *(frame.west_m, frame.south_m, frame.east_step_m, frame.north_step_m),
        columns,
        lowest_m,
        steps.astype("<u2").tobytes(),
    )


def _lift_m(raster: _Raster, origin: Origin, frame: _Frame, up_m: FloatArray) -> FloatArray:
    """(rows, columns) how much higher the grid must be for no pixel to rise above it [m]."""
    place, (first_column, last_column), (first_row, last_row) = _places_of_pixels(
        raster, origin, frame, up_m.shape
    )
    rows, columns = up_m.shape
    excess_m = np.zeros((rows - 1) * (columns - 1))
    at_once = max(1, 1_000_000 // (last_column - first_column + 1))
    for top in range(first_row, last_row + 1, at_once):
        part_m = raster.up_m[top : min(top + at_once, last_row + 1), first_column : last_column + 1]
        row, column = (each.ravel() for each in np.indices(part_m.shape, dtype=np.float64))
        east_m, north_m = place(column + first_column, row + top)
        u = (east_m - frame.west_m) / frame.east_step_m
        v = (north_m - frame.south_m) / frame.north_step_m
        inside = (u >= 0) & (v >= 0) & (u <= columns - 1) & (v <= rows - 1)
        inside &= ~np.isnan(part_m.ravel())
        u, v, pixel_m = u[inside], v[inside], part_m.ravel()[inside]
        left = np.minimum(u.astype(int), columns - 2)
        below = np.minimum(v.astype(int), rows - 2)
        x, y = u - left, v - below
        south_m = up_m[below, left] * (1 - x) + up_m[below, left + 1] * x
        north_up_m = up_m[below + 1, left] * (1 - x) + up_m[below + 1, left + 1] * x
        over_m = pixel_m - (south_m * (1 - y) + north_up_m * y)
        np.maximum.at(excess_m, below * (columns - 1) + left, over_m)
    excess_m = np.where(excess_m > STEP_M / 10.0, excess_m, 0.0).reshape(rows - 1, columns - 1)
    padded_m = np.pad(excess_m, 1)
    corners = padded_m[:-1, :-1], padded_m[:-1, 1:], padded_m[1:, :-1], padded_m[1:, 1:]
    lift_m: FloatArray = np.maximum.reduce(corners)
    return lift_m


def _places_of_pixels(
    raster: _Raster, origin: Origin, frame: _Frame, shape: tuple[int, ...]
) -> tuple[
    Callable[[FloatArray, FloatArray], tuple[FloatArray, FloatArray]],
    tuple[int, int],
    tuple[int, int],
]:
    """Column and row to east and north [m], by a parabola through a lattice of places.

    Beside it the first and last column, and the first and last row, between which all pixels on
    the grid are. A tile of one degree has a thousand times as many.
    """
    rows, columns = shape
    east_m, north_m = (
        frame.west_m + np.linspace(0.0, (columns - 1) * frame.east_step_m, _LATTICE),
        frame.south_m + np.linspace(0.0, (rows - 1) * frame.north_step_m, _LATTICE),
    )
    places_m = np.stack(np.meshgrid(east_m, north_m), axis=-1).reshape(-1, 2)
    column, row = raster.pixel(*_deg(origin, places_m[:, 0], places_m[:, 1]))
    middle = column.mean(), row.mean()
    size = np.ptp(column) or 1.0, np.ptp(row) or 1.0

    def terms(column: FloatArray, row: FloatArray) -> FloatArray:
        c, r = (column - middle[0]) / size[0], (row - middle[1]) / size[1]
        return np.stack([np.ones_like(c), c, r, c * c, c * r, r * r], axis=-1)

    factors = np.linalg.lstsq(terms(column, row), places_m)[0]

    def place(column: FloatArray, row: FloatArray) -> tuple[FloatArray, FloatArray]:
        found_m = terms(column, row) @ factors
        return found_m[:, 0], found_m[:, 1]

    def span(index: FloatArray, count: int) -> tuple[int, int]:
        spare = 2.0 + _BULGE_FRAC * np.ptp(index)
        return (
            max(math.floor(index.min() - spare), 0),
            min(math.ceil(index.max() + spare), count - 1),
        )

    pixel_rows, pixel_columns = raster.up_m.shape
    return place, span(column, pixel_columns), span(row, pixel_rows)


def _deg(origin: Origin, east_m: FloatArray, north_m: FloatArray) -> tuple[FloatArray, FloatArray]:
    """(n,) latitudes and longitudes [deg]; the frame is linear in both."""
    east_1_m, north_1_m, _ = enu_from_wgs84(
        origin, origin.lat_deg + 1.0, origin.lon_deg + 1.0, origin.alt_m
    )
    return origin.lat_deg + north_m / north_1_m, origin.lon_deg + east_m / east_1_m


def _lattice_deg(origin: Origin, box: Box) -> tuple[FloatArray, FloatArray]:
    """Latitudes and longitudes of a lattice all over a box [deg]."""
    east_m = np.linspace(box[0], box[2], _LATTICE)
    north_m = np.linspace(box[1], box[3], _LATTICE)
    return _deg(origin, np.tile(east_m, _LATTICE), np.repeat(north_m, _LATTICE))


def _grown(box: Box, by_m: float) -> Box:
    west_m, south_m, east_m, north_m = box
    return west_m - by_m, south_m - by_m, east_m + by_m, north_m + by_m
