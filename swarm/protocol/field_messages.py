"""What the field adds to what is said: bases, zones and areas, and the operator's word about them.

Zones of the brief are what a mission begins with. The operator's word about one counts before the
brief's, for the flight of the mission that it names; see swarm.protocol.operator_commands.
"""

from __future__ import annotations

import zlib
from dataclasses import asdict, dataclass
from functools import lru_cache
from typing import Annotated, ClassVar

from annotated_types import Ge, Gt, Le, Len
from pydantic import ConfigDict, Strict

from swarm.model import Area, AreaId, Base, BaseId, Camera, Zone, ZoneId
from swarm.model.terrain import MOST_HEIGHTS, Terrain
from swarm.protocol.fields import (
    MAX_COUNT,
    Checked,
    Count,
    Duration,
    Flag,
    FlatPoint,
    Height,
    Id,
    Instant,
    Metres,
    Point,
    Probability,
    Value,
    Words,
)

Slots = Annotated[int, Strict(), Ge(1), Le(MAX_COUNT)]
Millimetres = Annotated[float, Strict(), Gt(0.0), Le(1e5)]
Pixels = Annotated[int, Strict(), Ge(1), Le(MAX_COUNT)]
Spacing = Annotated[float, Strict(), Ge(1e-3), Le(1e8)]
Ring = Annotated[tuple[FlatPoint, ...], Len(3)]
"""Corners [m; east, north of the mission origin]."""


@dataclass(frozen=True, slots=True)
class BaseSpec(Checked):
    """One base as the brief describes it."""

    id: Id
    position_enu_m: Point
    """Place [m; mission origin]."""
    swap_s: Duration
    """From touch-down to ready [s]."""
    slots: Slots | None
    """UAVs served at a time; None: no limit."""

    def base(self) -> Base:
        """As missions have it."""
        return Base(BaseId(self.id), self.position_enu_m, self.swap_s, self.slots)

    @classmethod
    def of(cls, base: Base) -> BaseSpec:
        """``base`` as a brief describes it."""
        return cls(base.id, base.position_enu_m, base.swap_s, base.slots)


@dataclass(frozen=True, slots=True)
class ZoneSpec(Checked):
    """One zone as brief and operator describe it.

    Raises:
        ValueError: it is no zone that a mission could have.
    """

    id: Id
    polygon_enu_m: Ring
    holes_enu_m: tuple[Ring, ...]
    """Inside of these the zone is not."""
    floor_m: Metres | None
    """Lowest height [m above the mission origin]; None: from the ground up."""
    ceiling_m: Metres | None
    """Greatest height [m above the mission origin]; None: unlimited."""
    inclusive: Flag
    """Keeps out of all that is not inside, instead of what is."""

    def __post_init__(self) -> None:
        self.zone()

    def zone(self) -> Zone:
        """As missions have it."""
        return Zone(
            ZoneId(self.id),
            self.polygon_enu_m,
            self.holes_enu_m,
            self.floor_m,
            self.ceiling_m,
            self.inclusive,
        )

    @classmethod
    def of(cls, zone: Zone) -> ZoneSpec:
        """``zone`` as a brief describes it."""
        return cls(
            zone.id,
            zone.polygon_enu_m,
            zone.holes_enu_m,
            zone.floor_m,
            zone.ceiling_m,
            zone.inclusive,
        )


@dataclass(frozen=True, slots=True)
class CameraSpec(Checked):
    """The camera of an area, as missions have it."""

    sensor_width_mm: Millimetres
    sensor_height_mm: Millimetres
    focal_length_mm: Millimetres
    image_width_px: Pixels
    image_height_px: Pixels
    landscape: Flag
    exposure_s: Annotated[float, Strict(), Gt(0.0), Le(1e3)]


@dataclass(frozen=True, slots=True)
class AreaSpec(Checked):
    """One area as the brief describes it, for those who look on: its lines are tasks of the board.

    Raises:
        ValueError: it is no area that a mission could have.
    """

    id: Id
    polygon_enu_m: Ring
    value: Value
    holes_enu_m: tuple[Ring, ...]
    spacing_m: Spacing | None
    """Between lines [m]; None: by the camera."""
    trigger_m: Spacing | None
    camera: CameraSpec | None
    height_m: Metres | None
    """Of its lines [m above the mission origin]; None: in the UAV's layer."""
    sidelap_frac: Probability | None
    frontlap_frac: Probability | None
    heading_deg: Annotated[float, Strict(), Ge(-1e4), Le(1e4)] | None
    max_line_m: Spacing | None
    kind: Id | None
    service_s: Duration
    due_s: Instant | None
    opens_s: Instant
    closes_s: Instant | None
    appears_s: Instant
    lines: Annotated[int, Strict(), Ge(0), Le(100_000)]
    """How many it was cut into; their ids follow from its own."""

    def __post_init__(self) -> None:
        self.area()

    def area(self) -> Area:
        """As missions have it."""
        told = {name: getattr(self, name) for name in _OF_AREAS}
        camera = None if self.camera is None else Camera(**asdict(self.camera))
        return Area(id=AreaId(self.id), camera=camera, **told)

    @classmethod
    def of(cls, area: Area) -> AreaSpec:
        """``area`` as a brief describes it."""
        camera = None if area.camera is None else CameraSpec(**asdict(area.camera))
        return cls(id=area.id, camera=camera, **{name: getattr(area, name) for name in _OF_AREAS})


_OF_AREAS = tuple(name for name in AreaSpec.__dataclass_fields__ if name not in ("id", "camera"))
"""What is said of an area as it is."""


@dataclass(frozen=True, slots=True)
class TerrainSpec(Checked):
    """The ground as a brief describes it.

    Raises:
        ValueError: it is no ground that a mission could have.
    """

    # Recordings are JSON; what is packed is no text.
    __pydantic_config__: ClassVar[ConfigDict] = {
        **Checked.__pydantic_config__,
        "ser_json_bytes": "base64",
        "val_json_bytes": "base64",
    }

    clearance_m: Height
    """No path comes closer to the ground [m]."""
    west_m: Metres
    south_m: Metres
    """Of the first height [m; mission origin]."""
    east_step_m: Metres
    north_step_m: Metres
    """Between heights [m]."""
    columns: Annotated[int, Strict(), Ge(2), Le(MOST_HEIGHTS)]
    lowest_m: Metres
    """What all heights are above [m; mission origin]."""
    packed: Annotated[bytes, Strict(), Len(1, 2 * MOST_HEIGHTS + 4096)]
    """By zlib: the differences of all steps of the terrain from the ones before, modulo 65536, the
    lower bytes of all of them and then the higher ones."""

    def __post_init__(self) -> None:
        self.terrain()

    def terrain(self) -> Terrain:
        """As missions have it."""
        return _terrain_of(
            self.clearance_m,
            *(self.west_m, self.south_m, self.east_step_m, self.north_step_m),
            self.columns,
            self.lowest_m,
            self.packed,
        )

    @classmethod
    def of(cls, terrain: Terrain) -> TerrainSpec:
        """``terrain`` as a brief describes it."""
        return cls(
            terrain.clearance_m,
            *(terrain.west_m, terrain.south_m, terrain.east_step_m, terrain.north_step_m),
            terrain.columns,
            terrain.lowest_m,
            _packed(terrain.steps),
        )


@lru_cache(maxsize=4)
def _packed(steps: bytes) -> bytes:
    import numpy as np  # only where there is a terrain

    heights = np.frombuffer(steps, dtype="<u2")
    differences = np.diff(heights, prepend=np.zeros(1, dtype="<u2")).astype("<u2")
    return zlib.compress(differences.view(np.uint8).reshape(-1, 2).T.tobytes(), 9)


@lru_cache(maxsize=4)
def _terrain_of(
    clearance_m: float,
    west_m: float,
    south_m: float,
    east_step_m: float,
    north_step_m: float,
    columns: int,
    lowest_m: float,
    packed: bytes,
) -> Terrain:
    import numpy as np

    try:
        data = zlib.decompressobj().decompress(packed, 2 * MOST_HEIGHTS + 1)
    except zlib.error as error:
        raise ValueError("the heights of a terrain are not packed by zlib") from error
    if not data or len(data) % 2:
        raise ValueError(f"{len(data)} bytes are no heights")
    differences = np.frombuffer(data, dtype=np.uint8).reshape(2, -1).T
    steps = np.cumsum(np.ascontiguousarray(differences).view("<u2").ravel(), dtype="<u2")
    return Terrain(
        clearance_m,
        *(west_m, south_m, east_step_m, north_step_m),
        columns,
        lowest_m,
        steps.tobytes(),
    )


@dataclass(frozen=True, slots=True)
class ZoneEdit(Checked):
    """Register ``operator/zone/<zone>``: a zone that the operator draws, or takes away.

    For a zone that the brief has, too, the operator's word counts.
    """

    zone: ZoneSpec
    withdrawn: Flag
    run: Count
    """The flight of the mission that it is meant for, as in the brief; it counts in no other."""
    reason: Words
    """Why, in the operator's words; empty when there are none."""


@dataclass(frozen=True, slots=True)
class UavReady(Checked):
    """Register ``operator/ready/<uav>``: a person has seen to a UAV on the ground.

    Its battery is changed and it may start again. It counts once; a later swap needs another.
    """

    uav: Id
    run: Count
    """The flight of the mission that it is meant for, as in the brief; it counts in no other."""
    reason: Words
    """Why, in the operator's words; empty when there are none."""
