"""A scenario of schema 2, read from the dict that its TOML is.

Leaves out: most faults of a file (`faults` of `tests.support.field_oracle.faults` knows those
of section 11), areas and terrain.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from swarm.model.frames import Origin, enu_from_wgs84

LOWEST_LAYER_M = 10.0
LAYER_SPACING_M = 3.0

Point = tuple[float, float]
"""East, north [m]."""

Table = Mapping[str, Any]
"""A table of the TOML."""


@dataclass(frozen=True, slots=True)
class Stop:
    """An end of a leg."""

    name: str
    """Says which, without doubt: of a line each end has its own."""
    at: Point
    up_m: float
    """The given height above the origin."""
    in_layer: bool
    """Flown in the UAV's layer above it; otherwise (height_m) at just that height."""

    def flown_m(self, layer_m: float) -> float:
        """Height above the origin at which a UAV of that layer passes."""
        return self.up_m + layer_m if self.in_layer else self.up_m


@dataclass(frozen=True, slots=True)
class FieldUav:
    """A UAV; what is absent is infinite or None."""

    id: str
    kind: str | None
    start: Stop
    speed_m_s: float
    success: Mapping[str, float]
    survival: Mapping[str, float]
    acceleration_m_s2: float | None
    airspeed_m_s: float | None
    endurance_s: float
    reserve_frac: float
    charge_frac: float
    layer_m: float

    @property
    def first_budget_s(self) -> float:
        """Airborne time of the sortie that begins at mission time 0."""
        if self.endurance_s == math.inf:
            return math.inf
        return self.charge_frac * self.endurance_s - self.reserve_frac * self.endurance_s

    @property
    def full_budget_s(self) -> float:
        """Airborne time of a sortie that begins with a swap."""
        if self.endurance_s == math.inf:
            return math.inf
        return self.endurance_s - self.reserve_frac * self.endurance_s


@dataclass(frozen=True, slots=True)
class FieldBase:
    """Where batteries are swapped."""

    id: str
    stop: Stop
    swap_s: float
    slots: int | None


@dataclass(frozen=True, slots=True)
class FieldZone:
    """A keep-out polygon, or with ``inclusive`` the only place where to fly."""

    id: str
    rings: tuple[tuple[Point, ...], ...]
    """The border, then the holes; each without its first point again at the end."""
    floor_m: float
    ceiling_m: float
    inclusive: bool


@dataclass(frozen=True, slots=True)
class FieldTask:
    """A place or a line to visit."""

    id: str
    kind: str | None
    stops: tuple[Stop, ...]
    """One of a place, at least two of a line."""
    value: float
    service_s: float
    appears_s: float
    due_s: float | None
    opens_s: float
    closes_s: float

    @property
    def is_line(self) -> bool:
        """Whether it is flown from one end to the other."""
        return len(self.stops) > 1

    def way(self, *, backwards: bool) -> tuple[Stop, ...]:
        """Its points in the order in which they are flown."""
        return self.stops[::-1] if backwards else self.stops


@dataclass(frozen=True, slots=True)
class FieldScenario:
    """All that a plan depends on."""

    name: str
    horizon_s: float
    success_default: float
    survival_default: float
    wind_m_s: Point
    margin_m: float
    band_m: tuple[float, float] | None
    uavs: tuple[FieldUav, ...]
    bases: tuple[FieldBase, ...]
    zones: tuple[FieldZone, ...]
    tasks: tuple[FieldTask, ...]
    """Pop-ups included, which no plan knows."""

    @property
    def known(self) -> tuple[FieldTask, ...]:
        """The tasks that a plan knows."""
        return tuple(task for task in self.tasks if task.appears_s == 0.0)

    def uav(self, name: str) -> FieldUav:
        """The UAV of that id."""
        return next(uav for uav in self.uavs if uav.id == name)

    def base(self, name: str) -> FieldBase:
        """The base of that id."""
        return next(base for base in self.bases if base.id == name)

    def task(self, name: str) -> FieldTask:
        """The task of that id."""
        return next(task for task in self.tasks if task.id == name)

    def success(self, uav: FieldUav, task: FieldTask) -> float:
        """The p of eq. 1."""
        return _chance(uav.success, task, self.success_default)

    def survival(self, uav: FieldUav, task: FieldTask) -> float:
        """The factor of S for all tasks after this one."""
        return _chance(uav.survival, task, self.survival_default)

    def worth_until_s(self, task: FieldTask) -> float:
        """What its end is subtracted from: due_s, else D."""
        return self.horizon_s if task.due_s is None else task.due_s


def read(table: Table) -> FieldScenario:
    """The scenario that a TOML of this content describes.

    Raises:
        ValueError: it has areas or a terrain, of which this oracle knows nothing.
    """
    if "area" in table or "terrain" in table:
        raise ValueError("areas and terrain are not part of this oracle")
    mission = table["mission"]
    origin = Origin(**table["origin"]) if "origin" in table else None
    wind = mission.get("wind_m_s", (0.0, 0.0))
    band = mission.get("band_m")
    return FieldScenario(
        name=table["name"],
        horizon_s=float(mission["horizon_s"]),
        success_default=float(mission.get("success_default", 1.0)),
        survival_default=float(mission.get("survival_default", 1.0)),
        wind_m_s=(float(wind[0]), float(wind[1])),
        margin_m=float(mission.get("zone_margin_m", 0.0)),
        band_m=None if band is None else (float(band[0]), float(band[1])),
        uavs=tuple(_uav(row, index, origin) for index, row in enumerate(table.get("uav", ()))),
        bases=tuple(_base(row, origin) for row in table.get("base", ())),
        zones=tuple(_zone(row, origin) for row in table.get("zone", ())),
        tasks=tuple(_task(row, origin) for row in table.get("task", ())),
    )


def _chance(by_name: Mapping[str, float], task: FieldTask, default: float) -> float:
    if task.id in by_name:
        return by_name[task.id]
    if task.kind is not None and task.kind in by_name:
        return by_name[task.kind]
    return default


def _uav(row: Table, index: int, origin: Origin | None) -> FieldUav:
    return FieldUav(
        id=row["id"],
        kind=row.get("kind"),
        start=_stop(f"start:{row['id']}", _place_m(row, origin), None),
        speed_m_s=float(row["speed_m_s"]),
        success=dict(row.get("success", {})),
        survival=dict(row.get("survival", {})),
        acceleration_m_s2=_maybe(row, "acceleration_m_s2"),
        airspeed_m_s=_maybe(row, "airspeed_m_s"),
        endurance_s=float(row.get("endurance_s", math.inf)),
        reserve_frac=float(row.get("reserve_frac", 0.2)),
        charge_frac=float(row.get("charge_frac", 1.0)),
        layer_m=LOWEST_LAYER_M + index * LAYER_SPACING_M,
    )


def _base(row: Table, origin: Origin | None) -> FieldBase:
    return FieldBase(
        id=row["id"],
        stop=_stop(f"base:{row['id']}", _place_m(row, origin), None),
        swap_s=float(row.get("swap_s", 0.0)),
        slots=row.get("slots"),
    )


def _zone(row: Table, origin: Origin | None) -> FieldZone:
    border = row["polygon_m"] if "polygon_m" in row else _corners_m(row["polygon"], origin)
    rings = [border, *row.get("holes_m", ())]
    return FieldZone(
        id=row["id"],
        rings=tuple(_ring(ring) for ring in rings),
        floor_m=float(row.get("floor_m", -math.inf)),
        ceiling_m=float(row.get("ceiling_m", math.inf)),
        inclusive=bool(row.get("inclusive", False)),
    )


def _ring(corners: Iterable[Sequence[float]]) -> tuple[Point, ...]:
    ring = tuple((float(corner[0]), float(corner[1])) for corner in corners)
    return ring[:-1] if ring[0] == ring[-1] else ring


def _task(row: Table, origin: Origin | None) -> FieldTask:
    if "path_m" in row:
        points = [list(map(float, point)) for point in row["path_m"]]
    elif "path" in row:
        points = _corners_m(row["path"], origin)
    else:
        points = [list(_place_m(row, origin))]
    height_m = _maybe(row, "height_m")
    return FieldTask(
        id=row["id"],
        kind=row.get("kind"),
        stops=tuple(
            _stop(f"task:{row['id']}:{index}", point, height_m)
            for index, point in enumerate(points)
        ),
        value=float(row["value"]),
        service_s=float(row.get("service_s", 0.0)),
        appears_s=float(row.get("appears_s", 0.0)),
        due_s=_maybe(row, "due_s"),
        opens_s=float(row.get("opens_s", 0.0)),
        closes_s=float(row.get("closes_s", math.inf)),
    )


def _stop(name: str, point_m: Sequence[float], height_m: float | None) -> Stop:
    at = (float(point_m[0]), float(point_m[1]))
    if height_m is not None:
        return Stop(name, at, height_m, in_layer=False)
    return Stop(name, at, float(point_m[2]) if len(point_m) > 2 else 0.0, in_layer=True)


def _place_m(row: Table, origin: Origin | None) -> Sequence[float]:
    if "position_m" in row:
        return tuple(map(float, row["position_m"]))
    if origin is None:
        raise ValueError("degrees need an origin")
    alt_m = row.get("alt_m", origin.alt_m)
    return enu_from_wgs84(origin, row["lat_deg"], row["lon_deg"], alt_m)


def _corners_m(corners: Iterable[Sequence[float]], origin: Origin | None) -> list[list[float]]:
    if origin is None:
        raise ValueError("degrees need an origin")
    return [list(enu_from_wgs84(origin, lat, lon, origin.alt_m)[:2]) for lat, lon in corners]


def _maybe(row: Table, key: str) -> float | None:
    return float(row[key]) if key in row else None
