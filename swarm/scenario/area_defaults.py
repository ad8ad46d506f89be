"""What areas of files are covered by where these do not say it, and what they are worth then.

Nothing of it is known better than by who flies: each assumption is told, and stands in the scenario
to be changed.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace

from swarm.model import Origin
from swarm.model.frames import enu_from_wgs84
from swarm.scenario.findings import number_of
from swarm.scenario.task_files import FileEntry

SPACING_M = 25.0
"""Between lines where nobody says anything [m]: footprints of usual cameras from 60 m, two thirds
of which overlap."""
SIDELAP_FRAC = 0.7
FRONTLAP_FRAC = 0.8
"""Overlaps with which pictures are put together to a map, where only the camera is known."""
_HECTARE_M2 = 10_000.0
_SPACING_KEYS = ("spacing_m", "camera")


@dataclass(frozen=True, slots=True)
class AreaDefaults:
    """What areas are covered by that name neither a distance between lines nor a camera."""

    spacing_m: float | None = None
    """Between lines [m]; None for `SPACING_M`, or for what the camera asks for."""
    camera: str | None = None
    """Name of a camera that is known."""
    height_m: float | None = None
    """Where lines are flown [m above home]; None: as the file says, else in the UAVs' layers."""


def complete_areas(
    areas: Sequence[FileEntry], home: Origin | None, defaults: AreaDefaults, value: float
) -> tuple[tuple[FileEntry, ...], list[str]]:
    """``areas`` with all that a scenario needs, and what has been assumed, a sentence each.

    An area without a value is worth ``value`` for every hectare of it.
    """
    found: list[FileEntry] = []
    guessed: list[str] = []
    valued = 0
    for area in areas:
        table = dict(area.table)
        if defaults.height_m is not None:
            table.setdefault("height_m", defaults.height_m)
        if not any(key in table for key in _SPACING_KEYS):
            if defaults.camera is not None and defaults.spacing_m is None:
                table["camera"] = defaults.camera
            else:
                table["spacing_m"] = defaults.spacing_m or SPACING_M
                if defaults.spacing_m is None:
                    guessed.append(str(table["id"]))
        if "camera" in table:
            table.setdefault("sidelap_frac", SIDELAP_FRAC)
            table.setdefault("frontlap_frac", FRONTLAP_FRAC)
        if "value" not in table:
            table["value"] = round(value * max(_hectares(table, home), 0.01), 2)
            valued += 1
        found.append(replace(area, table=table))
    notes = []
    if guessed:
        told = ", ".join(guessed[:3]) + ("…" if guessed[3:] else "")
        notes.append(
            f"{told}: lines {SPACING_M:g} m apart are a guess; --spacing-m M, or --camera NAME "
            "with --height-m H, says better"
        )
    if valued:
        notes.append(f"areas without a value are worth {value:g} for every hectare (--value)")
    return tuple(found), notes


def _hectares(table: Mapping[str, object], home: Origin | None) -> float:
    """How large an area is; 0 if it is none."""
    ring = table.get("polygon_m")
    if ring is None and home is not None:
        ring = [_local_m(corner, home) for corner in _list(table.get("polygon"))]
    holes = _list(table.get("holes_m"))
    return (_area_m2(_list(ring)) - sum(_area_m2(_list(hole)) for hole in holes)) / _HECTARE_M2


def _list(value: object) -> Sequence[object]:
    return value if isinstance(value, list) else ()


def _local_m(corner: object, home: Origin) -> list[float]:
    numbers = [number_of(each) for each in _list(corner)]
    match numbers:
        case [float(lat_deg), float(lon_deg)]:
            return list(enu_from_wgs84(home, lat_deg, lon_deg, home.alt_m)[:2])
        case _:
            return []


def _area_m2(ring: Iterable[object]) -> float:
    """What a ring encloses; 0 if one of its corners is none."""
    corners = [[number_of(each) for each in _list(corner)] for corner in ring]
    twice_m2 = 0.0
    for before, corner in zip(corners[-1:] + corners[:-1], corners, strict=True):
        match before, corner:
            case [float(x0), float(y0), *_], [float(x1), float(y1), *_]:
                twice_m2 += x0 * y1 - x1 * y0
            case _:
                return 0.0
    return abs(twice_m2) / 2.0
