"""Options of `swarm task add` for what the field asks of a task: when, how high, along what."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Final

from coordinator.operator.points import points_of
from swarm.runtime.errors import Fault, InputError
from swarm.runtime.option_groups import option

if TYPE_CHECKING:
    from coordinator.operator.task_edits import Wgs84
    from swarm.protocol.fields import Point

_LONGEST_S: Final = 1e9


@dataclass(frozen=True)
class TaskLimits:
    """When a task may be done, how high, and along which line."""

    due_s: float | None = option(
        None,
        "--due-s",
        min=0.0,
        max=_LONGEST_S,
        metavar="S",
        help="Mission time by which it ends, or it is worth nothing; it may be left out then.",
    )
    opens_s: float = option(
        0.0,
        "--opens-s",
        min=0.0,
        max=_LONGEST_S,
        metavar="S",
        help="Mission time before which work on the spot does not begin.",
    )
    closes_s: float | None = option(
        None,
        "--closes-s",
        min=0.0,
        max=_LONGEST_S,
        metavar="S",
        help="Mission time after which it does not begin.",
    )
    path: str | None = option(
        None,
        "--path",
        metavar="E,N E,N …",
        help="A line instead of a place: its points in metres, flown whichever way is better.",
    )
    path_deg: str | None = option(
        None, "--path-deg", metavar="LAT,LON …", help="The same in degrees, WGS84."
    )
    height_m: float | None = option(
        None,
        "--height-m",
        min=-1e7,
        max=1e7,
        metavar="M",
        help="Height above the mission's origin to fly at. Default: the UAV's own layer.",
    )

    @property
    def points(self) -> tuple[Point | Wgs84, ...]:
        """Points of the line; empty of a place.

        Raises:
            InputError: they are no points, too few, or given twice.
        """

        if self.path is None and self.path_deg is None:
            return ()
        if self.path is not None and self.path_deg is not None:
            remedy = "give either --path or --path-deg"
            raise InputError(Fault("swarm task add", "", "two lines were given", remedy))
        if self.path_deg is not None:
            source, found = "--path-deg", points_of("--path-deg", self.path_deg, in_degrees=True)
            points: tuple[Point | Wgs84, ...] = tuple(_on_earth(each) for each in found)
        else:
            source, found = "--path", points_of("--path", self.path or "", in_degrees=False)
            points = tuple((each[0], each[1], each[2] if each[2:] else 0.0) for each in found)
        if len(points) < 2:
            remedy = "give two points or more, such as --path 0,0 200,0"
            raise InputError(Fault(source, "", f"{len(points)} point is no line", remedy))
        return points


def _on_earth(point: tuple[float, ...]) -> Wgs84:
    from coordinator.operator.task_edits import Wgs84

    try:
        return Wgs84(point[0], point[1])
    except ValueError as fault:
        remedy = "give latitude and longitude, such as 47.3981,8.5470"
        raise InputError(Fault("--path-deg", "", str(fault), remedy)) from fault


NO_LIMITS: Final = TaskLimits()
