"""Read files of tasks by the readers their suffixes ask for, and make one of several."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

from swarm.model import Origin
from swarm.runtime.errors import Fault, InputError
from swarm.scenario.files import decode, read_bytes, require_small
from swarm.scenario.findings import printable
from swarm.scenario.task_files.csv_file import read_csv
from swarm.scenario.task_files.geojson_file import read_geojson
from swarm.scenario.task_files.kml_file import read_kml, read_kmz
from swarm.scenario.task_files.local_places import in_scenario_keys
from swarm.scenario.task_files.plan_file import read_plan
from swarm.scenario.task_files.point_lists import read_fence, read_rally, read_text_file
from swarm.scenario.task_files.shapefile import (
    PARTS,
    Layer,
    read_layers,
    read_shapefiles_in_zip,
)
from swarm.scenario.task_files.task_file import (
    Array,
    BytesReader,
    FileEntry,
    Reader,
    ReadOptions,
    TaskFile,
)
from swarm.scenario.task_files.waypoints_file import read_waypoints

_READERS: Mapping[str, Reader] = {
    ".plan": read_plan,
    ".waypoints": read_waypoints,
    ".geojson": read_geojson,
    ".json": read_geojson,
    ".csv": read_csv,
    ".fen": read_fence,
    ".rally": read_rally,
    ".ral": read_rally,
    ".txt": read_text_file,
}
_BYTES_READERS: Mapping[str, BytesReader] = {
    ".kml": read_kml,
    ".kmz": read_kmz,
    ".zip": read_shapefiles_in_zip,
}
_LAYER = ".shp"
SUFFIXES = (
    ".plan",
    ".waypoints",
    ".kml",
    ".kmz",
    ".geojson",
    ".json",
    ".shp",
    ".zip",
    ".csv",
    ".fen",
    ".rally",
    ".ral",
    ".txt",
)
"""How names of files of tasks end."""
_OF_WAYPOINTS = (".plan", ".waypoints", ".txt")
"""Files whose tasks lie below waypoints."""
_WHAT = "file of tasks"
_HOMELESS = "names no home, and places in degrees need one"


@dataclass(frozen=True, slots=True)
class ImportOptions:
    """How files of tasks are to be read."""

    home: Origin | None = None
    """Takes the place of the one that they name."""
    below_m: float | None = None
    """How far tasks lie below the waypoints of a flight plan [m]."""
    visits_alone: bool = False
    """Surveys and lines become visits of their corners, as in scenarios of schema 1."""
    has_terrain: bool = False
    """Whether the scenario knows the ground."""


def read_task_file(
    path: Path, *, home: Origin | None = None, below_m: float | None = None
) -> TaskFile:
    """What is in the file ``path``; see `read_task_files`."""
    return read_task_files([path], ImportOptions(home, below_m))


def read_task_files(paths: Sequence[Path], options: ImportOptions) -> TaskFile:
    """Tasks, areas and zones of all files, in their order, in the keys of a scenario.

    The first file that names a home says what it is. Who has no id of his own in his file is
    numbered through all of them.

    Raises:
        InputError: with every fault of the files.
    """
    files: list[TaskFile] = []
    faults: list[Fault] = []
    for path in paths:
        try:
            files.append(_read(path, options))
        except InputError as error:
            faults += error.faults
    if faults:
        raise InputError(*faults)
    suffixes = {path.suffix.lower() for path in paths}
    if options.below_m is not None and not suffixes & {*_OF_WAYPOINTS}:
        problem = "holds places and no waypoints that tasks could lie below"
        raise InputError(Fault(files[0].source, "", problem, "leave out --below-m"))
    whole = files[0]
    if files[1:]:
        whole = _together(files, has_terrain=options.has_terrain)
    if not (whole.entries or whole.areas):
        kinds = ["zones"] * bool(whole.zones) + [*whole.left_out]
        problem = f"holds {', '.join(kinds)} and no task" if kinds else "holds no task"
        remedy = "give the file of the tasks, too" if kinds else whole.nothing
        raise InputError(Fault(whole.source, "", problem, remedy))
    if whole.home is None and whole.in_degrees:
        remedy = "name it: --home LAT,LON,ALT, or [origin] in the scenario"
        raise InputError(Fault(whole.source, "", _HOMELESS, remedy))
    return in_scenario_keys(whole, has_terrain=options.has_terrain)


def _read(path: Path, options: ImportOptions) -> TaskFile:
    source, suffix = printable(str(path)), path.suffix.lower()
    request = ReadOptions(
        source, options.home, options.below_m, options.visits_alone, options.has_terrain
    )
    if suffix not in SUFFIXES:
        problem = f"{path.suffix or 'a name without a suffix'} is no kind of {_WHAT}"
        raise InputError(Fault(source, "", problem, f"give one ending in {', '.join(SUFFIXES)}"))
    data = read_bytes(path, _WHAT)
    if (reader := _READERS.get(suffix)) is not None:
        return reader(decode(data, source, _WHAT), request)
    require_small(data, source, _WHAT)
    if suffix == _LAYER:
        return read_layers([Layer(source, {**_beside(path), _LAYER: data})], request)
    return _BYTES_READERS[suffix](data, request)


def _beside(path: Path) -> dict[str, bytes]:
    """The other files of a Shapefile; their suffixes may be in capitals."""
    found: dict[str, bytes] = {}
    for suffix in PARTS:
        names = [path.with_suffix(each) for each in (suffix, suffix.upper())]
        there = next((name for name in names if name.is_file()), None)
        if suffix != _LAYER and there is not None:
            found[suffix] = read_bytes(there, _WHAT)
            require_small(found[suffix], printable(str(there)), _WHAT)
    return found


def _together(files: Sequence[TaskFile], *, has_terrain: bool) -> TaskFile:
    """One file of all that is in several."""
    home = next((file.home for file in files if file.home is not None), None)
    entries = [
        entry if has_terrain else _moved(entry, file.home, home)
        for file in files
        for entry in file.all_entries
    ]
    numbered = _renumbered(list(_without_twins(entries)))
    left_out: Counter[str] = Counter()
    for file in files:
        left_out.update(file.left_out)
    below_m = {file.below_m for file in files} - {None}
    parts = {array: tuple(entry for entry in numbered if entry.array is array) for array in Array}
    return TaskFile(
        ", ".join(file.source for file in files),
        parts[Array.TASK],
        home,
        next((file.speed_m_s for file in files if file.speed_m_s is not None), None),
        below_m.pop() if len(below_m) == 1 else None,
        left_out,
        parts[Array.AREA],
        parts[Array.ZONE],
        tuple(note for file in files for note in file.notes),
        files[0].nothing,
    )


def _without_twins(entries: Iterable[FileEntry]) -> Iterator[FileEntry]:
    """``entries`` without zones that are there already: plans of a fleet all have its fence."""
    met: set[str] = set()
    for entry in entries:
        if entry.array is Array.ZONE and not entry.has_own_id:
            table = {key: value for key, value in entry.table.items() if key != "id"}
            if (words := repr(table)) in met:
                continue
            met.add(words)
        yield entry


def _moved(entry: FileEntry, own: Origin | None, home: Origin | None) -> FileEntry:
    """An entry whose height counts from its own file's home, counted from that of all."""
    height_m = entry.table.get("height_m")
    if own is None or home is None or not isinstance(height_m, float) or own.alt_m == home.alt_m:
        return entry
    return replace(entry, table={**entry.table, "height_m": height_m + own.alt_m - home.alt_m})


def _renumbered(entries: Sequence[FileEntry]) -> list[FileEntry]:
    """``entries`` with numbers of their own where their files give no ids.

    Raises:
        InputError: two files give the same id.
    """
    taken: dict[tuple[Array, object], FileEntry] = {}
    faults: list[Fault] = []
    for entry in entries:
        if not entry.has_own_id:
            continue
        other = taken.setdefault((entry.array, entry.table["id"]), entry)
        if other is not entry:
            problem = f"{entry.table['id']!r} is already the id at {other.source}, {other.place}"
            remedy = "give every one an id of its own"
            faults.append(Fault(entry.source, entry.at("id"), problem, remedy))
    if faults:
        raise InputError(*faults)
    found: list[FileEntry] = []
    numbers: Counter[str] = Counter()
    for entry in entries:
        if entry.has_own_id:
            found.append(entry)
            continue
        prefix = str(entry.table["id"]).rstrip("0123456789")
        while True:
            numbers[prefix] += 1
            identity = f"{prefix}{numbers[prefix]}"
            if (entry.array, identity) not in taken:
                break
        found.append(replace(entry, table={**entry.table, "id": identity}))
    return found
