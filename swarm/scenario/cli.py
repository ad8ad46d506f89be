"""The commands ``swarm import`` and ``swarm new``."""

from __future__ import annotations

import re
import sys
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

if TYPE_CHECKING:
    from swarm.model import Origin
    from swarm.scenario.draft import Draft
    from swarm.scenario.task_files import TaskFile

NameOption = Annotated[
    str | None,
    typer.Option(
        "--name",
        metavar="NAME",
        help="Name of the mission. Default: that of the file.",
        show_default=False,
    ),
]
UavsOption = Annotated[
    int, typer.Option("--uavs", min=1, max=1000, metavar="N", help="Size of the fleet.")
]


def import_tasks(
    files: Annotated[
        list[Path],
        typer.Argument(
            metavar="FILE…",
            help="Files of tasks, areas and fences: .plan, .waypoints, .kml, .kmz, .geojson, .shp, "
            ".zip of Shapefiles, .csv, .fen or .rally.",
            show_default=False,
        ),
    ],
    uavs: UavsOption = 3,
    speed_m_s: Annotated[
        float | None,
        typer.Option(
            "--speed-m-s",
            min=0.01,
            max=1000.0,
            metavar="V",
            help="Cruise speed of every UAV. Default: the plan's, else 5.",
            show_default=False,
        ),
    ] = None,
    home: Annotated[
        str | None,
        typer.Option(
            "--home",
            metavar="LAT,LON,ALT",
            help="Where the UAVs start: degrees, and height above mean sea level. "
            "Default: the plan's home.",
            show_default=False,
        ),
    ] = None,
    below_m: Annotated[
        float | None,
        typer.Option(
            "--below-m",
            min=-1000.0,
            max=1000.0,
            metavar="M",
            help="How far tasks lie below waypoints. Default: 10, the lowest height layer, so "
            "that the first UAV flies at the height planned.",
            show_default=False,
        ),
    ] = None,
    horizon_s: Annotated[
        float | None,
        typer.Option(
            "--horizon-s",
            min=1.0,
            max=1e9,
            metavar="D",
            help="Horizon D. Default: about what a single UAV would need for all tasks.",
            show_default=False,
        ),
    ] = None,
    value: Annotated[
        float,
        typer.Option(
            "--value",
            min=0.0,
            max=1e12,
            metavar="V",
            help="Of tasks the file gives none, and of every hectare of such areas.",
        ),
    ] = 1.0,
    service_s: Annotated[
        float,
        typer.Option(
            "--service-s",
            min=0.0,
            max=1e9,
            metavar="S",
            help="Time on the spot, for tasks the file gives none.",
        ),
    ] = 0.0,
    spacing_m: Annotated[
        float | None,
        typer.Option(
            "--spacing-m",
            min=0.1,
            max=1e6,
            metavar="M",
            help="Between the lines of areas the file says nothing of. Default: 25.",
            show_default=False,
        ),
    ] = None,
    camera: Annotated[
        str | None,
        typer.Option(
            "--camera",
            metavar="NAME",
            help="What takes the pictures of such areas, instead of --spacing-m; needs a height.",
            show_default=False,
        ),
    ] = None,
    height_m: Annotated[
        float | None,
        typer.Option(
            "--height-m",
            min=-1e5,
            max=1e5,
            metavar="H",
            help="Where lines of areas are flown, above home, if the file does not say it. "
            "Default: each UAV in its layer.",
            show_default=False,
        ),
    ] = None,
    terrain: Annotated[
        Path | None,
        typer.Option(
            "--terrain",
            metavar="DEM",
            help="What the ground is: a GeoTIFF or an SRTM tile. Heights above the ground are "
            "refused without.",
            show_default=False,
        ),
    ] = None,
    clearance_m: Annotated[
        float,
        typer.Option(
            "--clearance-m",
            min=0.0,
            max=1e4,
            metavar="M",
            help="How near UAVs may come to that ground.",
        ),
    ] = 20.0,
    name: NameOption = None,
    no_fence: Annotated[
        bool, typer.Option("--no-fence", help="Leave the geofence and other zones out.")
    ] = False,
    output: Annotated[
        Path | None,
        typer.Option(
            "--output",
            "-o",
            metavar="SCENARIO",
            help="Write the scenario there. Default: standard output.",
            show_default=False,
        ),
    ] = None,
) -> int:
    """Make a scenario of what surveyors and ground stations have.

    Points and waypoints become tasks, lines tasks along them, polygons and surveys areas that are
    covered by lines, geofences zones. Several files are put together, such as a mission and its
    fence; the first one that names a home says where the UAVs start. What has been assumed or left
    out is told. The scenario is commented, to be looked over and flown.

    KML, GeoJSON and Shapefiles may give each object id, value, service_s, kind, appears_s, due_s,
    opens_s, closes_s and height_m; lines trigger_m, too; areas spacing_m and trigger_m or camera,
    sidelap_frac, frontlap_frac, heading_deg and max_line_m, too. A polygon is a zone if it has a
    property zone, or if its name or folder begins with zone, no-fly or keep-out. A CSV has columns
    lat_deg, lon_deg and maybe alt_m, or east_m, north_m and maybe up_m, and those of tasks.

    Examples:
        swarm import survey.plan --uavs 3 -o survey.toml && swarm run survey.toml
        swarm import field.kml --home 47.3977,8.5456,488 --camera dji-mavic-3e --height-m 60
        swarm import mission.waypoints fence.waypoints --speed-m-s 8 -o mission.toml
        swarm import parcels.zip --home 47.3977,8.5456,488 --spacing-m 20 -o parcels.toml
        swarm import grid.csv --uavs 10 -o grid.toml
    """
    from dataclasses import replace

    from swarm.scenario.area_defaults import AreaDefaults
    from swarm.scenario.draft import DraftOptions, draft_scenario
    from swarm.scenario.task_files import ImportOptions, read_task_files

    _require_height(camera, height_m, spacing_m)
    place = None if home is None else _origin(home)
    options = ImportOptions(place, below_m, has_terrain=terrain is not None)
    tasks = read_task_files(files, options)
    if no_fence:
        tasks = replace(tasks, zones=())
    named = _named(name, files[0])
    areas = AreaDefaults(spacing_m, camera, height_m)
    folder = None if output is None else output.parent
    ground = (terrain, clearance_m, folder)
    fleet = DraftOptions(named, uavs, speed_m_s, horizon_s, value, service_s, areas, *ground)
    draft = draft_scenario(tasks, fleet)
    if output is None:
        print(draft.text, end="")
    else:
        _write(output, draft.text)
    print(_story(tasks, draft, fleet.uavs, output), file=sys.stderr)
    return 0


def new(
    file: Annotated[
        Path,
        typer.Argument(
            metavar="FILE.toml",
            help="File to write; one that is there is left alone.",
            show_default=False,
        ),
    ],
    uavs: UavsOption = 3,
    tasks: Annotated[
        int, typer.Option("--tasks", min=0, max=10_000, metavar="M", help="Number of tasks.")
    ] = 6,
    origin: Annotated[
        str | None,
        typer.Option(
            "--origin",
            metavar="LAT,LON[,ALT]",
            help="Where the UAVs start: degrees, and height above mean sea level, by default 0. "
            "Default: where simulators usually fly.",
            show_default=False,
        ),
    ] = None,
    name: NameOption = None,
) -> int:
    """Write a new scenario in which every field is explained.

    It flies as it is. UAVs stand side by side at the origin, tasks lie around them. Change what
    you like: `swarm plan FILE` tells every fault at its place.

    Examples:
        swarm new field.toml
        swarm new field.toml --uavs 5 --tasks 20 --origin 47.3977,8.5456,488
        swarm new field.toml && swarm plan field.toml && swarm run field.toml --speedup 5
    """
    from swarm.model.frames import DEFAULT_ORIGIN
    from swarm.runtime.errors import Fault, InputError
    from swarm.scenario.blank import Blank, blank_scenario

    named = _named(name, file)
    if file.suffix != ".toml":
        remedy = f"end it in .toml, such as {file.stem or 'field'}.toml"
        raise InputError(Fault(str(file), "", "is no name of a scenario file", remedy))
    place = DEFAULT_ORIGIN if origin is None else _origin(origin, "--origin", alt_m=0.0)
    _write(file, blank_scenario(Blank(named, uavs, tasks, place)), "")
    print(f"fly it with: swarm run {file}", file=sys.stderr)
    return 0


def _origin(text: str, option: str = "--home", *, alt_m: float | None = None) -> Origin:
    """The place that ``text`` names; ``alt_m`` is its height where it names none."""
    from swarm.model import Origin
    from swarm.runtime.errors import Fault, InputError

    try:
        numbers = [float(part) for part in text.split(",")]
        if alt_m is not None and len(numbers) == 2:
            numbers.append(alt_m)
        lat_deg, lon_deg, height_m = numbers
        return Origin(lat_deg, lon_deg, height_m)
    except ValueError as error:
        remedy = "give LAT,LON,ALT in degrees and metres, such as 47.397742,8.545594,488"
        raise InputError(Fault(option, "", f"{text!r} is no place", remedy)) from error


def _named(name: str | None, file: Path) -> str:
    """The name of the mission; without one, one close to that of the file."""
    from swarm.model.ids import ID_RULE, valid_id
    from swarm.runtime.errors import Fault, InputError

    if name is not None and not valid_id(name):
        raise InputError(Fault("--name", "", f"{name!r} is not an id", f"give {ID_RULE}"))
    words = re.sub(r"[^A-Za-z0-9_.-]+", "-", file.stem).strip("-_.")
    return name or words[:64] or "mission"


def _write(path: Path, text: str, option: str = "--output") -> None:
    """Write a new file; one that is there may have been worked on."""
    from swarm.runtime.errors import Fault, InputError

    where = (option, str(path)) if option else (str(path), "")
    try:
        with path.open("x", encoding="utf-8") as file:
            file.write(text)
    except FileExistsError as error:
        fault = Fault(*where, "is there already", "remove it, or name another file")
        raise InputError(fault) from error
    except (OSError, ValueError) as error:
        reason = error.strerror if isinstance(error, OSError) else None
        problem = f"cannot be written: {reason or error}"
        raise InputError(Fault(*where, problem, "name a file that can be")) from error


def _require_height(camera: str | None, height_m: float | None, spacing_m: float | None) -> None:
    """Refuse a camera of which nobody knows how high it flies, or that has nothing to say."""
    from swarm.runtime.errors import Fault, InputError
    from swarm.survey.cameras import CAMERAS

    if camera is None:
        return
    if camera not in CAMERAS:
        from swarm.runtime.errors import remedy_for_name

        problem, remedy = f"{camera!r} is no camera that is known", remedy_for_name(camera, CAMERAS)
    elif spacing_m is not None:
        problem, remedy = "says how far apart lines are, as --spacing-m does", "leave out one"
    elif height_m is None or height_m <= 0.0:
        problem, remedy = "needs to know how high it flies", "add --height-m, above 0"
    else:
        return
    raise InputError(Fault("--camera", "", problem, remedy))


def _story(tasks: TaskFile, draft: Draft, uavs: int, output: Path | None) -> str:
    """What has been made of the files, and how to go on."""
    counted = [
        _counted(len(tasks.entries), "task"),
        _counted(len(tasks.areas), "area") + f" of {_counted(draft.lines, 'line')}"
        if tasks.areas
        else "",
    ]
    made = " and ".join(words for words in counted if words)
    story = f"{tasks.source}: {made} for {_counted(uavs, 'UAV')}"
    if tasks.zones:
        story += f" and {_counted(len(tasks.zones), 'zone')}"
    if tasks.left_out:
        parts = (f"{n} × {what}" if n > 1 else what for what, n in tasks.left_out.items())
        story += f"; left out: {', '.join(parts)}"
    lines = [story, *(f"note: {note}" for note in draft.notes)]
    if output is not None:
        lines.append(f"fly it with: swarm run {output}")
    return "\n".join(lines)


def _counted(count: int, what: str) -> str:
    """``3 tasks``; nothing where there is none."""
    return f"{count} {what}{'s' if count > 1 else ''}" if count else ""
