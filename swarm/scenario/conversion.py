"""A scenario in which nothing is wrong becomes a mission: places in metres, data of the model.

Leaves out: every check, and which lines areas are cut into (swarm.scenario.area_faults).
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import TYPE_CHECKING

from swarm.model import (
    Area,
    AreaId,
    Base,
    BaseId,
    Camera,
    Mission,
    Origin,
    Task,
    TaskId,
    Uav,
    UavId,
    Zone,
    ZoneId,
)
from swarm.model.frames import enu_from_wgs84
from swarm.model.rings import Ring
from swarm.model.vehicles import turning_acceleration_m_s2

if TYPE_CHECKING:
    from swarm.scenario.shapes import (
        AreaTable,
        BaseTable,
        Scenario,
        TaskTable,
        UavTable,
        ZoneTable,
    )

_Point = tuple[float, float, float]


def mission_of(scenario: Scenario) -> Mission:
    """The mission that a checked ``scenario`` describes."""
    origin = None
    if (table := scenario.origin) is not None:
        origin = Origin(table.lat_deg, table.lon_deg, table.alt_m)
    rules = scenario.mission
    east_m_s, north_m_s = rules.wind_m_s or (0.0, 0.0)
    return Mission(
        name=scenario.name,
        horizon_s=rules.horizon_s,
        uavs=tuple(_uav(uav, origin) for uav in scenario.uav),
        tasks=tuple(_task(task, origin) for task in scenario.task),
        success_default=rules.success_default,
        survival_default=rules.survival_default,
        reattempt_failed=rules.reattempt_failed,
        origin=origin,
        bases=tuple(_base(base, origin) for base in scenario.base),
        zones=tuple(_zone(zone, origin) for zone in scenario.zone),
        wind_enu_m_s=(east_m_s, north_m_s),
        zone_margin_m=rules.zone_margin_m,
        separation_m=rules.separation_m,
        band_m=None if rules.band_m is None else (rules.band_m[0], rules.band_m[1]),
        areas=tuple(_area(area, origin) for area in scenario.area),
        schema=scenario.version,
    )


def _uav(uav: UavTable, origin: Origin | None) -> Uav:
    return Uav(
        id=UavId(uav.id),
        position_enu_m=_place_enu_m(uav, origin),
        speed_m_s=uav.speed_m_s,
        success=uav.success,
        survival=uav.survival,
        kind=uav.kind,
        acceleration_m_s2=_acceleration_m_s2(uav),
        airspeed_m_s=uav.airspeed_m_s,
        endurance_s=uav.endurance_s,
        reserve_frac=uav.reserve_frac,
        charge_frac=uav.charge_frac,
        vehicle=uav.vehicle,
        landing_heading_rad=_heading_rad(uav),
    )


def _acceleration_m_s2(uav: UavTable) -> float | None:
    if uav.turn_radius_m is None:
        return uav.acceleration_m_s2
    return turning_acceleration_m_s2(uav.speed_m_s, uav.turn_radius_m)


def _heading_rad(uav: UavTable) -> float | None:
    heading_deg = uav.landing_heading_deg
    return None if heading_deg is None else math.radians(heading_deg)


def _base(base: BaseTable, origin: Origin | None) -> Base:
    return Base(
        id=BaseId(base.id),
        position_enu_m=_place_enu_m(base, origin),
        swap_s=base.swap_s,
        slots=base.slots,
    )


def _zone(zone: ZoneTable, origin: Origin | None) -> Zone:
    polygon, holes = _rings_enu_m(zone, origin)
    return Zone(
        id=ZoneId(zone.id),
        polygon_enu_m=polygon,
        holes_enu_m=holes,
        floor_m=zone.floor_m,
        ceiling_m=zone.ceiling_m,
        inclusive=zone.inclusive,
    )


def _area(area: AreaTable, origin: Origin | None) -> Area:
    polygon, holes = _rings_enu_m(area, origin)
    camera = None if area.camera is None else Camera(**area.camera.model_dump())
    return Area(
        id=AreaId(area.id),
        polygon_enu_m=polygon,
        value=area.value,
        holes_enu_m=holes,
        spacing_m=area.spacing_m,
        trigger_m=area.trigger_m,
        camera=camera,
        height_m=area.height_m,
        sidelap_frac=area.sidelap_frac,
        frontlap_frac=area.frontlap_frac,
        heading_deg=area.heading_deg,
        max_line_m=area.max_line_m,
        kind=area.kind,
        service_s=area.service_s,
        due_s=area.due_s,
        opens_s=area.opens_s,
        closes_s=area.closes_s,
        appears_s=area.appears_s,
    )


def _rings_enu_m(
    table: ZoneTable | AreaTable, origin: Origin | None
) -> tuple[Ring, tuple[Ring, ...]]:
    """Border and holes."""
    if table.polygon_m is not None:
        corners = [_point_enu_m(corner) for corner in table.polygon_m]
    else:
        corners = _on_ground_enu_m(table.polygon or (), origin)
    holes = [[_point_enu_m(corner) for corner in hole] for hole in table.holes_m]
    polygon = tuple(corner[:2] for corner in corners)
    return polygon, tuple(tuple(corner[:2] for corner in hole) for hole in holes)


def _task(task: TaskTable, origin: Origin | None) -> Task:
    line: tuple[_Point, ...] = ()
    if task.path_m is not None:
        line = tuple(_point_enu_m(point) for point in task.path_m)
    elif task.path is not None:
        line = tuple(_on_ground_enu_m(task.path, origin))
    return Task(
        id=TaskId(task.id),
        position_enu_m=line[0] if line else _place_enu_m(task, origin),
        value=task.value,
        service_s=task.service_s,
        kind=task.kind,
        appears_s=task.appears_s,
        due_s=task.due_s,
        opens_s=task.opens_s,
        closes_s=task.closes_s,
        path_enu_m=line,
        trigger_m=task.trigger_m,
        height_m=task.height_m,
    )


def _place_enu_m(table: UavTable | BaseTable | TaskTable, origin: Origin | None) -> _Point:
    if table.position_m is not None:
        return _point_enu_m(table.position_m)
    if origin is None or table.lat_deg is None or table.lon_deg is None:
        raise ValueError("a table without a position has passed the checks")
    alt_m = origin.alt_m if table.alt_m is None else table.alt_m
    return enu_from_wgs84(origin, table.lat_deg, table.lon_deg, alt_m)


def _point_enu_m(numbers: Sequence[float]) -> _Point:
    east_m, north_m, *up_m = numbers
    return east_m, north_m, up_m[0] if up_m else 0.0


def _on_ground_enu_m(points_deg: Sequence[Sequence[float]], origin: Origin | None) -> list[_Point]:
    """Points given by latitude and longitude alone, at the height of the origin."""
    if origin is None:
        raise ValueError("places in degrees without an origin have passed the checks")
    return [
        enu_from_wgs84(origin, lat_deg, lon_deg, origin.alt_m) for lat_deg, lon_deg in points_deg
    ]
