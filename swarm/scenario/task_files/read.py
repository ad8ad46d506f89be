"""Read a file of tasks by the reader its suffix asks for."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

from swarm.model import Origin
from swarm.runtime.errors import Fault, InputError
from swarm.scenario.files import decode, read_bytes
from swarm.scenario.findings import printable
from swarm.scenario.task_files.csv_file import read_csv
from swarm.scenario.task_files.geojson_file import read_geojson
from swarm.scenario.task_files.plan_file import read_plan
from swarm.scenario.task_files.task_file import Reader, ReadOptions, TaskFile
from swarm.scenario.task_files.waypoints_file import read_waypoints

_READERS: Mapping[str, Reader] = {
    ".plan": read_plan,
    ".waypoints": read_waypoints,
    ".geojson": read_geojson,
    ".csv": read_csv,
}
SUFFIXES = tuple(_READERS)
"""How names of files of tasks end."""
_PLACES = (read_geojson, read_csv)
_WHAT = "file of tasks"


def read_task_file(
    path: Path, *, home: Origin | None = None, below_m: float | None = None
) -> TaskFile:
    """The tasks in the file ``path``.

    ``home`` takes the place of the one that it names; ``below_m`` is how far tasks lie below the
    waypoints of a flight plan [m].

    Raises:
        InputError: with every fault of the file.
    """
    source = printable(str(path))
    reader = _READERS.get(path.suffix.lower())
    if reader is None:
        problem = f"{path.suffix or 'a name without a suffix'} is no kind of {_WHAT}"
        raise InputError(Fault(source, "", problem, f"give one ending in {', '.join(SUFFIXES)}"))
    if below_m is not None and reader in _PLACES:
        problem = "holds places and no waypoints that tasks could lie below"
        raise InputError(Fault(source, "", problem, "leave out --below-m"))
    tasks = reader(
        decode(read_bytes(path, _WHAT), source, _WHAT), ReadOptions(source, home, below_m)
    )
    if tasks.home is None and tasks.in_degrees:
        problem = "names no home, and places in degrees need one"
        remedy = "name it: --home LAT,LON,ALT, or [origin] in the scenario"
        raise InputError(Fault(source, "", problem, remedy))
    return tasks
