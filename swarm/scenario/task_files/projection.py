"""Coordinates of a map's projection as latitudes and longitudes of WGS84, by PROJ.

The projection is what the ``.prj`` of a Shapefile says in the well-known text of ESRI or OGC. One
that is missing or unknown is refused, and so are places outside of where the projection holds:
most often the ``.prj`` is another file's. No grid is ever fetched from the network.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
import numpy.typing as npt

from swarm.runtime.errors import Fault, InputError
from swarm.scenario.findings import printable

if TYPE_CHECKING:
    from pyproj import CRS, Transformer

_LONGEST_TEXT = 65_536
_WGS84 = 4326
_SURE = 20
"""Least confidence [%] with which PROJ is to tell the EPSG number that a text means."""
_BEYOND_DEG = 1.0
"""How far outside of where a projection is made for it may still be used [deg]."""
_COARSE_M = 2.0
"""Worse accuracies are told [m]."""
_GIVE = "save it in EPSG:4326, with its .prj"


@dataclass(frozen=True, slots=True)
class Projection:
    """Where coordinates of a file are on Earth."""

    name: str
    note: str
    """What a person should know of it; empty if nothing."""
    _transformer: Transformer
    _bounds_deg: tuple[float, float, float, float] | None
    """West, south, east and north of where it holds."""
    _is_geographic: bool

    @classmethod
    def of(cls, prj: bytes | None, source: str) -> Projection:
        """The projection that a ``.prj`` file names.

        Raises:
            InputError: it is missing, or names none that is known.
        """
        from pyproj import CRS, Transformer
        from pyproj.exceptions import ProjError

        if prj is None:
            problem = "has no .prj beside it, so nobody knows its projection"
            raise InputError(Fault(source, "", problem, _GIVE))
        text = prj[:_LONGEST_TEXT].decode("utf-8", "replace").lstrip("\ufeff").strip()
        try:
            crs = CRS.from_wkt(text)
            if not (crs.is_geographic or crs.is_projected):
                raise InputError(
                    Fault(source, ".prj", f"{_named(crs)} is no projection of the Earth", _GIVE)
                )
            transformer = Transformer.from_crs(crs, _WGS84, always_xy=True)
        except ProjError as error:
            problem = f"{printable(text[:40])!r} is no projection that is known"
            raise InputError(Fault(source, ".prj", problem, _GIVE)) from error
        accuracy_m = transformer.accuracy
        note = ""
        if accuracy_m > _COARSE_M:
            note = f"places in {_named(crs)} are known to {accuracy_m:g} m in WGS84"
        return cls(_named(crs), note, transformer, _bounds_deg(crs), crs.is_geographic)

    @property
    def remedy(self) -> str:
        """What to do about places that are none."""
        return f"save it with the right .prj, or in EPSG:{_WGS84}"

    def places(
        self, x: npt.NDArray[np.float64], y: npt.NDArray[np.float64]
    ) -> Sequence[tuple[float, float]] | str:
        """(n,) coordinates as latitudes and longitudes [deg], or what is wrong with them."""
        if not (np.isfinite(x).all() and np.isfinite(y).all()):
            return "has a coordinate that is no number"
        if self._is_geographic and (np.abs(y) > 90.0).any():
            wrong = int(np.argmax(np.abs(y) > 90.0))
            return f"{x[wrong]:g}, {y[wrong]:g} is no longitude and latitude of {self.name}"
        lon_deg, lat_deg = (np.asarray(each) for each in self._transformer.transform(x, y))
        outside = ~(np.isfinite(lon_deg) & np.isfinite(lat_deg))
        if self._bounds_deg is not None:
            west, south, east, north = self._bounds_deg
            outside |= (lat_deg < south - _BEYOND_DEG) | (lat_deg > north + _BEYOND_DEG)
            east_deg = np.where(outside, 0.0, lon_deg - west + _BEYOND_DEG) % 360.0
            outside |= east_deg > (east - west) + 2.0 * _BEYOND_DEG
        if outside.any():
            wrong = int(np.argmax(outside))
            return f"{x[wrong]:g}, {y[wrong]:g} lies outside of where {self.name} holds"
        return list(zip(lat_deg.tolist(), lon_deg.tolist(), strict=True))


def _named(crs: CRS) -> str:
    return printable(crs.name[:60])


def _bounds_deg(crs: CRS) -> tuple[float, float, float, float] | None:
    """Where a projection holds, if it is one of the EPSG register."""
    from pyproj import CRS

    number = crs.to_epsg(_SURE)
    area = None if number is None else CRS.from_epsg(number).area_of_use
    if area is None:
        return None
    west, south, east, north = area.bounds
    return west, south, east if east >= west else east + 360.0, north
