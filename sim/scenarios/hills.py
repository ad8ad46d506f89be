"""Makes the hills of the scenario ``ridge``: an SRTM tile that no satellite has seen.

    python -m sim.scenarios.hills

writes it beside this module. A ridge runs from south to north, higher in the south, and a round
hill stands behind it.
"""

from __future__ import annotations

import zipfile
from pathlib import Path

import numpy as np
import numpy.typing as npt

from swarm.model.frames import DEFAULT_ORIGIN, enu_from_wgs84

FILE = Path(__file__).with_name("N47E008.hgt.zip")
_SIDE = 3601
_ALONG = np.arange(_SIDE) / (_SIDE - 1)


def hills_m(rows: slice = slice(None), columns: slice = slice(None)) -> npt.NDArray[np.float64]:
    """Heights above mean sea level of these of 3601 rows and columns [m].

    Rows go from north to south, columns from west to east.
    """
    origin = DEFAULT_ORIGIN
    degree_m = enu_from_wgs84(origin, origin.lat_deg + 1.0, origin.lon_deg + 1.0, 0.0)
    east_m = (8.0 + _ALONG[columns] - origin.lon_deg)[None, :] * degree_m[0]
    north_m = (48.0 - _ALONG[rows] - origin.lat_deg)[:, None] * degree_m[1]
    crest_m = 300.0 + 60.0 * np.sin(north_m / 200.0)
    falls = 1.0 + np.exp(np.clip(north_m / 150.0, -50.0, 50.0))
    high_m = (25.0 + 65.0 / falls) * np.exp(-((north_m / 2_000.0) ** 4))
    ridge_m = high_m * np.exp(-(((east_m - crest_m) / 110.0) ** 2))
    hill_m = 40.0 * np.exp(-((east_m - 520.0) ** 2 + (north_m - 150.0) ** 2) / 120.0**2)
    up_m: npt.NDArray[np.float64] = origin.alt_m + ridge_m + hill_m
    return up_m


def main() -> None:
    """Write the tile."""
    tile = np.round(hills_m()).astype(">i2").tobytes()
    entry = zipfile.ZipInfo(FILE.name.removesuffix(".zip"), date_time=(2000, 1, 1, 0, 0, 0))
    entry.compress_type = zipfile.ZIP_DEFLATED
    with zipfile.ZipFile(FILE, "w") as archive:
        archive.writestr(entry, tile, compresslevel=9)


if __name__ == "__main__":
    main()
