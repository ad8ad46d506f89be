"""Files of heights, written as surveyors' programs write them."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import rasterio
from rasterio import Affine


def geotiff(path: Path, heights_m: Any, **given: Any) -> None:
    """A GeoTIFF of heights, half a thousandth of a degree apart unless told otherwise."""
    heights = np.asarray(heights_m, dtype=given.pop("dtype", "float32"))
    heights = heights.reshape(-1, *heights.shape[-2:])
    profile = {
        "driver": "GTiff",
        "count": len(heights),
        "height": heights.shape[1],
        "width": heights.shape[2],
        "dtype": heights.dtype,
        "crs": "EPSG:4326",
        "transform": Affine(0.0005, 0.0, 8.49, 0.0, -0.0005, 47.41),
        **given,
    }
    about = {name: profile.pop(name) for name in ("units", "scales", "offsets") if name in profile}
    with rasterio.open(path, "w", **profile) as file:
        file.write(heights)
        for name, value in about.items():
            setattr(file, name, (value,))
