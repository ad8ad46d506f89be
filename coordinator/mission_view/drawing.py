"""What drawings of a mission in three dimensions have in common, whatever tool shows them."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Final

from coordinator.mission_view.presentation import uav_colour
from coordinator.mission_view.scene import LEFT_OUT, TAKEN, Scene
from coordinator.mission_view.uav_state import Point
from swarm.model import UavId
from swarm.protocol.board import TaskState

Colour = tuple[float, float, float, float]
"""Red, green, blue and opacity, 0 to 1."""
GREY: Final = (0.6, 0.6, 0.6, 0.5)
WHITE: Final = (1.0, 1.0, 1.0, 1.0)
ZONE_COLOUR: Final = (0.84, 0.37, 0.0, 0.9)
AREA_COLOUR: Final = (0.0, 0.45, 0.7, 0.9)
BASE_COLOUR: Final = (0.8, 0.47, 0.65, 0.9)
# Okabe and Ito's colours; states differ in shape and opacity, too.
STATE_COLOURS: Final[Mapping[str, Colour]] = {
    TaskState.OPEN.value: (0.9, 0.62, 0.0, 1.0),
    TAKEN: (0.34, 0.71, 0.91, 1.0),
    LEFT_OUT: (0.9, 0.62, 0.0, 0.4),
    TaskState.DONE.value: (0.0, 0.62, 0.45, 0.6),
    TaskState.FAILED.value: (0.84, 0.37, 0.0, 1.0),
    TaskState.WITHDRAWN.value: GREY,
}
"""By how a task stands."""
UNENDED: Final = (TaskState.OPEN.value, TAKEN, LEFT_OUT)
"""How tasks stand that nobody has ended: they are drawn as balls, the others as boxes."""
STILL_M_S: Final = 0.1
"""Who is slower points nowhere."""
_SMALLEST_M: Final = 0.05
_OF_MISSION: Final = 1.0 / 60.0
"""Size of a task, as a part of the mission's extent."""


def drawn_size_m(scene: Scene) -> float:
    """Size of what is drawn in the mission [m]."""
    places = [*(uav.start_enu_m for uav in scene.uavs), *(t.position_enu_m for t in scene.tasks)]
    if not places:
        return 1.0
    spans_m = [max(axis) - min(axis) for axis in zip(*places, strict=True)]
    return float(max(_SMALLEST_M, _OF_MISSION * max(spans_m)))


def raised(at: Point, up_m: float) -> Point:
    """A place so much higher."""
    return at[0], at[1], at[2] + up_m


def colour_of(number: int) -> Colour:
    """Of the UAV that has that place in the fleet."""
    code = uav_colour(number)
    red, green, blue = (int(code[i : i + 2], 16) / 255.0 for i in (1, 3, 5))
    return round(red, 3), round(green, 3), round(blue, 3), 1.0


def ways_ahead(scene: Scene) -> dict[UavId, tuple[Point, ...]]:
    """What each UAV's list still holds: places in order; in the field, the way that it flies.

    Those of the field are at the height of the UAV's start.
    """
    places = {task.id: task.position_enu_m for task in scene.tasks}
    ahead: dict[UavId, tuple[Point, ...]] = {}
    for view in scene.uavs:
        points = tuple(places[task] for task in view.planned if task in places)
        if view.ways is not None:
            flat_m = (*view.ways.leg[1:], *view.ways.ahead[1:])
            points = tuple((east_m, north_m, view.start_enu_m[2]) for east_m, north_m in flat_m)
        ahead[view.id] = points
    return ahead
