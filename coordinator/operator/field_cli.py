"""The commands `swarm zone add|remove` and `swarm ready`."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from coordinator.operator.cli import ReasonOption, TimeoutOption, UavArgument, submit
from coordinator.operator.points import PointsCommand, points_of
from swarm.bus.connection import DEFAULT_CONNECTION, ConnectionOptions
from swarm.runtime.errors import Fault, InputError
from swarm.runtime.option_groups import with_options
from swarm.runtime.options import JsonOption, SomeMissionOption, SpeedupOption

if TYPE_CHECKING:
    from swarm.scenario.zone_files import ZoneDrawing

_ADD_HELP = """Draw a zone where nobody may fly from now on.

The fleet leaves it by the shortest way and flies round it; tasks and bases in it are out of reach.
Corners go round either way, in metres east and north of the mission's origin, in degrees, or as a
file has them: a table [[zone]] of a scenario (.toml), or a Polygon in GeoJSON. Works without a
coordinator. Exit status 1: somebody who is there was not seen to know of it, and the line says who.

\b
Examples:
    swarm zone add helipad --polygon 10,10 60,12 40,80
    swarm zone add helipad --polygon-deg 47.398,8.545 47.399,8.547 47.397,8.548 --ceiling-m 90
    swarm zone add village --file village.geojson --reason "crowd" --keys keys/operator
"""
_REMOVE_HELP = """Take a zone away: one that was drawn in flight, or one of the scenario.

Works without a coordinator. Exit status 1: somebody was not seen to know of it.

\b
Examples:
    swarm zone remove helipad
"""
zone = typer.Typer(
    help="Draw a zone where nobody may fly, or take one away.",
    rich_markup_mode=None,
    no_args_is_help=True,
)
ZoneArgument = Annotated[str, typer.Argument(metavar="ID", help="Id of the zone.")]


@zone.command("add", help=_ADD_HELP, short_help="Draw a zone.", cls=PointsCommand)
@with_options
def add(
    name: ZoneArgument,
    polygon: Annotated[
        str | None,
        typer.Option(
            "--polygon",
            metavar="E,N E,N E,N …",
            help="Corners in metres east and north of the mission's origin.",
            show_default=False,
        ),
    ] = None,
    polygon_deg: Annotated[
        str | None,
        typer.Option(
            "--polygon-deg",
            metavar="LAT,LON …",
            help="Corners in degrees, WGS84.",
            show_default=False,
        ),
    ] = None,
    file: Annotated[
        Path | None,
        typer.Option(
            "--file", metavar="FILE", help="Where the zone is: .toml, .geojson.", show_default=False
        ),
    ] = None,
    floor_m: Annotated[
        float | None,
        typer.Option(
            "--floor-m",
            metavar="M",
            help="Lowest height above the mission's origin. Default: from the ground up.",
            show_default=False,
        ),
    ] = None,
    ceiling_m: Annotated[
        float | None,
        typer.Option(
            "--ceiling-m",
            metavar="M",
            help="Greatest height above the mission's origin. Default: unlimited.",
            show_default=False,
        ),
    ] = None,
    inclusive: Annotated[
        bool, typer.Option("--inclusive", help="Fly nowhere but in it.", show_default=False)
    ] = False,
    replace: Annotated[
        bool,
        typer.Option(
            "--replace", help="Draw the zone of that id anew, if there is one.", show_default=False
        ),
    ] = False,
    reason: ReasonOption = "",
    mission: SomeMissionOption = None,
    timeout_s: TimeoutOption = 10.0,
    seat: ConnectionOptions = DEFAULT_CONNECTION,
    speedup: SpeedupOption = 1.0,
    json: JsonOption = False,
) -> int:
    """Draw a zone where nobody may fly."""
    from coordinator.operator.submission import MissionConnection, check_reason_and_ids
    from coordinator.operator.zone_edits import NewZone, UnsoundZoneError

    check_reason_and_ids(reason, ("--mission", mission), ("ID", name))
    source, drawn = _drawn(name, polygon, polygon_deg, file)
    heights_m = (
        drawn.floor_m if floor_m is None else floor_m,
        drawn.ceiling_m if ceiling_m is None else ceiling_m,
    )
    try:
        wish = NewZone(
            *(name, drawn.polygon, drawn.holes, drawn.in_degrees, *heights_m),
            inclusive or drawn.inclusive,
            replace,
            reason,
        )
    except UnsoundZoneError as fault:
        raise InputError(Fault(source, "", str(fault), fault.remedy)) from fault
    return submit(wish, MissionConnection(mission, timeout_s, seat, speedup), "ID", json=json)


@zone.command("remove", help=_REMOVE_HELP, short_help="Take a zone away.")
@with_options
def remove(
    name: ZoneArgument,
    reason: ReasonOption = "",
    mission: SomeMissionOption = None,
    timeout_s: TimeoutOption = 10.0,
    seat: ConnectionOptions = DEFAULT_CONNECTION,
    speedup: SpeedupOption = 1.0,
    json: JsonOption = False,
) -> int:
    """Take a zone away."""
    from coordinator.operator.submission import MissionConnection, check_reason_and_ids
    from coordinator.operator.zone_edits import ZoneRemoval

    check_reason_and_ids(reason, ("--mission", mission), ("ID", name))
    reach = MissionConnection(mission, timeout_s, seat, speedup)
    return submit(ZoneRemoval(name, reason), reach, "ID", json=json)


@with_options
def ready(
    uav: UavArgument,
    reason: ReasonOption = "",
    mission: SomeMissionOption = None,
    timeout_s: TimeoutOption = 10.0,
    seat: ConnectionOptions = DEFAULT_CONNECTION,
    speedup: SpeedupOption = 1.0,
    json: JsonOption = False,
) -> int:
    """Say that a UAV at a base has a new battery and may start.

    A real vehicle that has landed to swap stays disarmed until a person has said so. Of a UAV that
    is lost it says that its slot is free again. It counts once: after the next swap it is to be
    said anew. Works without a coordinator. Exit status 1: the UAV does not stand at a base, or was
    not seen to know of it.

    Examples:
        swarm ready uav2
        swarm ready uav2 --reason "battery 7" --keys keys/operator
    """
    from coordinator.operator.readiness import ReadyRequest
    from coordinator.operator.submission import MissionConnection, check_reason_and_ids

    check_reason_and_ids(reason, ("--mission", mission), ("UAV", uav))
    reach = MissionConnection(mission, timeout_s, seat, speedup)
    return submit(ReadyRequest(uav, reason), reach, "UAV", json=json)


def _drawn(
    name: str, polygon: str | None, polygon_deg: str | None, file: Path | None
) -> tuple[str, ZoneDrawing]:
    """The zone that the options tell of, and which of them.

    Raises:
        InputError: they tell of none, of two, or the file holds it not.
    """
    from swarm.scenario.zone_files import ZoneDrawing, read_zone

    remedy = "give either --polygon, --polygon-deg or --file"
    given = [each for each in (polygon, polygon_deg, file) if each is not None]
    if len(given) != 1:
        many = "no corners were given" if not given else "a zone was given more than once"
        raise InputError(Fault("swarm zone add", "", many, remedy))
    if file is not None:
        return str(file), read_zone(file, name)
    option, text = ("--polygon", polygon) if polygon is not None else ("--polygon-deg", polygon_deg)
    in_degrees = polygon is None
    corners = points_of(option, text or "", in_degrees=in_degrees)
    for number, corner in enumerate(corners, 1):
        if len(corner) != 2:
            problem, right = "has a height", "give corners of two numbers, heights by --ceiling-m"
            raise InputError(Fault(option, f"point {number}", problem, right))
    return option, ZoneDrawing(tuple((x, y) for x, y, *_ in corners), (), in_degrees)
