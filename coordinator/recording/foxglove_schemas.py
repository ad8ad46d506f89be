"""Well-known schemas by which Foxglove shows maps, scenes and logs, and the messages that fit them.

Names, fields and meanings are Foxglove's: https://docs.foxglove.dev/docs/sdk/schemas. Fields that
are not needed here (lineage, message ids) are left out, as they may be.
"""

from __future__ import annotations

import json
import math
from collections.abc import Mapping, Sequence
from typing import Any, Final

Json = dict[str, Any]
Point = tuple[float, float, float]
Colour = tuple[float, float, float, float]
"""Red, green, blue and opacity within 0..1."""
LOCATION_FIX: Final = "foxglove.LocationFix"
SCENE_UPDATE: Final = "foxglove.SceneUpdate"
LOG: Final = "foxglove.Log"

# -- schemas -----------------------------------------------------------------------------

_NUMBER: Final[Json] = {"type": "number"}
_TEXT: Final[Json] = {"type": "string"}
_FLAG: Final[Json] = {"type": "boolean"}
_INDEX: Final[Json] = {"type": "integer", "minimum": 0}
_NANOSECONDS: Final[Json] = {"type": "integer", "minimum": 0, "maximum": 999_999_999}


def _object(title: str, properties: Json, optional: Mapping[str, Json] | None = None) -> Json:
    return {
        "title": title,
        "type": "object",
        "properties": {**properties, **(optional or {})},
        "required": list(properties),
    }


def _list(items: Json, length: int | None = None) -> Json:
    bounds = {} if length is None else {"minItems": length, "maxItems": length}
    return {"type": "array", "items": items, **bounds}


def _choice(title: str, *names: str) -> Json:
    return {"title": title, "oneOf": [{"title": name, "const": n} for n, name in enumerate(names)]}


_TIME: Final[Json] = {
    "type": "object",
    "title": "time",
    "properties": {"sec": _INDEX, "nsec": _NANOSECONDS},
}
_DURATION: Final[Json] = {
    "type": "object",
    "title": "duration",
    "properties": {"sec": {"type": "integer"}, "nsec": _NANOSECONDS},
}
_COLOUR: Final = _object("foxglove.Color", dict.fromkeys("rgba", _NUMBER))
_VECTOR: Final = _object("foxglove.Vector3", dict.fromkeys("xyz", _NUMBER))
_POINT: Final = _object("foxglove.Point3", dict.fromkeys("xyz", _NUMBER))
_QUATERNION: Final = _object("foxglove.Quaternion", dict.fromkeys("xyzw", _NUMBER))
_POSE: Final = _object("foxglove.Pose", {"position": _VECTOR, "orientation": _QUATERNION})
_PAIR: Final = _object("foxglove.KeyValuePair", {"key": _TEXT, "value": _TEXT})
_SOLID: Final[Json] = {"pose": _POSE, "size": _VECTOR, "color": _COLOUR}
_POINTS: Final[Json] = {
    "points": _list(_POINT),
    "color": _COLOUR,
    "colors": _list(_COLOUR),
    "indices": _list(_INDEX),
}
_PRIMITIVES: Final[Mapping[str, Json]] = {
    "arrows": _object(
        "foxglove.ArrowPrimitive",
        {
            "pose": _POSE,
            "shaft_length": _NUMBER,
            "shaft_diameter": _NUMBER,
            "head_length": _NUMBER,
            "head_diameter": _NUMBER,
            "color": _COLOUR,
        },
    ),
    "cubes": _object("foxglove.CubePrimitive", _SOLID),
    "spheres": _object("foxglove.SpherePrimitive", _SOLID),
    "cylinders": _object(
        "foxglove.CylinderPrimitive", {**_SOLID, "bottom_scale": _NUMBER, "top_scale": _NUMBER}
    ),
    "lines": _object(
        "foxglove.LinePrimitive",
        {
            "type": _choice("foxglove.LineType", "LINE_STRIP", "LINE_LOOP", "LINE_LIST"),
            "pose": _POSE,
            "thickness": _NUMBER,
            "scale_invariant": _FLAG,
            **_POINTS,
        },
    ),
    "triangles": _object("foxglove.TriangleListPrimitive", {"pose": _POSE, **_POINTS}),
    "texts": _object(
        "foxglove.TextPrimitive",
        {
            "pose": _POSE,
            "billboard": _FLAG,
            "font_size": _NUMBER,
            "scale_invariant": _FLAG,
            "color": _COLOUR,
            "text": _TEXT,
        },
    ),
    "models": _object(
        "foxglove.ModelPrimitive",
        {
            "pose": _POSE,
            "scale": _VECTOR,
            "color": _COLOUR,
            "override_color": _FLAG,
            "url": _TEXT,
            "media_type": _TEXT,
            "data": {**_TEXT, "contentEncoding": "base64"},
        },
    ),
}
_ENTITY: Final = _object(
    "foxglove.SceneEntity",
    {
        "timestamp": _TIME,
        "frame_id": _TEXT,
        "id": _TEXT,
        "lifetime": _DURATION,
        "frame_locked": _FLAG,
        "metadata": _list(_PAIR),
        **{name: _list(primitive) for name, primitive in _PRIMITIVES.items()},
    },
)
_DELETION: Final = _object(
    "foxglove.SceneEntityDeletion",
    {
        "timestamp": _TIME,
        "type": _choice("foxglove.SceneEntityDeletionType", "MATCHING_ID", "ALL"),
        "id": _TEXT,
    },
)
_LOCATION_FIX: Final = _object(
    LOCATION_FIX,
    {
        "timestamp": _TIME,
        "frame_id": _TEXT,
        "latitude": _NUMBER,
        "longitude": _NUMBER,
        "altitude": _NUMBER,
        "position_covariance": _list(_NUMBER, 9),
        "position_covariance_type": _choice(
            "foxglove.PositionCovarianceType", "UNKNOWN", "APPROXIMATED", "DIAGONAL_KNOWN", "KNOWN"
        ),
    },
    {"color": _COLOUR},
)
_LOG: Final = _object(
    LOG,
    {
        "timestamp": _TIME,
        "level": _choice(
            "foxglove.LogLevel", "UNKNOWN", "DEBUG", "INFO", "WARNING", "ERROR", "FATAL"
        ),
        "message": _TEXT,
        "name": _TEXT,
        "file": _TEXT,
        "line": _INDEX,
    },
)
FOXGLOVE_SCHEMAS: Final[Mapping[str, bytes]] = {
    name: json.dumps(schema, separators=(",", ":")).encode()
    for name, schema in {
        LOCATION_FIX: _LOCATION_FIX,
        SCENE_UPDATE: _object(
            SCENE_UPDATE, {"deletions": _list(_DELETION), "entities": _list(_ENTITY)}
        ),
        LOG: _LOG,
    }.items()
}

# -- messages ----------------------------------------------------------------------------

_LEVELS: Final = ("unknown", "debug", "info", "warning", "error", "critical")


def _time(time_ns: int) -> Json:
    seconds, nanoseconds = divmod(time_ns, 1_000_000_000)
    return {"sec": seconds, "nsec": nanoseconds}


def _colour(colour: Colour) -> Json:
    return dict(zip("rgba", colour, strict=True))


def _vector(point: Point) -> Json:
    return {axis: round(each, 3) for axis, each in zip("xyz", point, strict=True)}


def _pose(at: Point, yaw_rad: float = 0.0) -> Json:
    """Place, and which way east then points [rad, counter-clockwise]."""
    turn = {"x": 0.0, "y": 0.0, "z": math.sin(yaw_rad / 2.0), "w": math.cos(yaw_rad / 2.0)}
    return {"position": _vector(at), "orientation": turn}


def sphere(at: Point, size_m: float, colour: Colour) -> Json:
    """A ball."""
    size = _vector((size_m, size_m, size_m))
    return {"pose": _pose(at), "size": size, "color": _colour(colour)}


def cube(at: Point, size_m: float, colour: Colour) -> Json:
    """A box."""
    return sphere(at, size_m, colour)


def arrow(at: Point, yaw_rad: float, length_m: float, colour: Colour) -> Json:
    """An arrow from ``at``."""
    return {
        "pose": _pose(at, yaw_rad),
        "shaft_length": 0.6 * length_m,
        "shaft_diameter": 0.2 * length_m,
        "head_length": 0.4 * length_m,
        "head_diameter": 0.5 * length_m,
        "color": _colour(colour),
    }


def line_strip(points: Sequence[Point], colour: Colour, width_px: float) -> Json:
    """A line through all points."""
    return {
        "type": 0,
        "pose": _pose((0.0, 0.0, 0.0)),
        "thickness": width_px,
        "scale_invariant": True,
        "points": [_vector(point) for point in points],
        "color": _colour(colour),
        "colors": [],
        "indices": [],
    }


def text(at: Point, words: str, colour: Colour) -> Json:
    """A label that faces whoever looks."""
    return {
        "pose": _pose(at),
        "billboard": True,
        "font_size": 12.0,
        "scale_invariant": True,
        "color": _colour(colour),
        "text": words,
    }


def entity(
    name: str, frame: str, time_ns: int, facts: Mapping[str, str], **primitives: list[Json]
) -> Json:
    """A thing in a scene; it takes the place of an earlier one of that name."""
    return {
        "timestamp": _time(time_ns),
        "frame_id": frame,
        "id": name,
        "lifetime": {"sec": 0, "nsec": 0},
        "frame_locked": False,
        "metadata": [{"key": key, "value": value} for key, value in facts.items()],
        **{kind: primitives.get(kind, []) for kind in _PRIMITIVES},
    }


def scene_update(entities: Sequence[Json]) -> Json:
    """Things that are new or have changed."""
    return {"deletions": [], "entities": list(entities)}


def location_fix(
    frame: str, time_ns: int, lat_deg: float, lon_deg: float, alt_m: float, colour: Colour
) -> Json:
    """A place on Earth."""
    return {
        "timestamp": _time(time_ns),
        "frame_id": frame,
        "latitude": lat_deg,
        "longitude": lon_deg,
        "altitude": alt_m,
        "position_covariance": [0.0] * 9,
        "position_covariance_type": 0,
        "color": _colour(colour),
    }


def log(name: str, message: str, level: str, time_ns: int) -> Json:
    """A line of a log; an unknown level is none."""
    number = _LEVELS.index(level) if level in _LEVELS else 0
    return {
        "timestamp": _time(time_ns),
        "level": number,
        "message": message,
        "name": name,
        "file": "",
        "line": 0,
    }
