"""Find a scenario by path or shipped name, and read the files people give.

Shipped scenarios are the TOML files of the package ``sim.scenarios``. They are looked up by
that name among the installed packages, not imported, so that commands of the lower packages
can offer them.
"""

from __future__ import annotations

import importlib.util
from difflib import get_close_matches
from pathlib import Path

from swarm.runtime.errors import Fault, InputError
from swarm.scenario.findings import printable

LARGEST_FILE_BYTES = 16 * 2**20
"""Larger files are refused unread: no mission needs them, and they take minutes."""


def read_bytes(path: Path, what: str) -> bytes:
    """The content of the file ``path``, cut just above `LARGEST_FILE_BYTES`.

    Raises:
        InputError: it cannot be read; the remedy asks for a readable ``what``.
    """
    try:
        with path.open("rb") as file:
            return file.read(LARGEST_FILE_BYTES + 1)
    except (OSError, ValueError) as error:
        reason = error.strerror if isinstance(error, OSError) else None
        problem = f"cannot be read: {reason or error}"
        fault = Fault(printable(str(path)), "", problem, f"give a readable {what}")
        raise InputError(fault) from error


def decode(data: bytes, source: str, what: str) -> str:
    """``data`` as text in UTF-8, with or without a byte order mark.

    Raises:
        InputError: it is no such text, or larger than `LARGEST_FILE_BYTES`.
    """
    require_small(data, source, what)
    try:
        return data.decode("utf-8-sig")
    except UnicodeDecodeError as error:
        line = data.count(b"\n", 0, error.start) + 1
        column = error.start - data.rfind(b"\n", 0, error.start)
        problem = f"byte 0x{data[error.start]:02x} is not UTF-8"
        place = f"line {line}, column {column}"
        raise InputError(Fault(source, place, problem, "save the file as UTF-8")) from error


def require_small(data: bytes, source: str, what: str) -> None:
    """Refuse a file that `read_bytes` has cut.

    Raises:
        InputError: it is larger than `LARGEST_FILE_BYTES`.
    """
    if len(data) > LARGEST_FILE_BYTES:
        problem = f"is larger than {LARGEST_FILE_BYTES // 2**20} MiB"
        raise InputError(Fault(source, "", problem, f"give a smaller {what}"))


_PACKAGE = "sim.scenarios"


def shipped_scenarios(package: str = _PACKAGE) -> dict[str, Path]:
    """Names and files of the scenarios in ``package``, by name; empty without the package."""
    try:
        spec = importlib.util.find_spec(package)
    except ModuleNotFoundError:
        return {}
    folders = list(spec.submodule_search_locations or ()) if spec else []
    files = (file for folder in folders for file in Path(folder).glob("*.toml"))
    return {file.stem: file for file in sorted(files)}


def resolve_scenario(argument: str) -> Path:
    """The scenario file meant by ``argument``; an existing path wins over a shipped name.

    Raises:
        InputError: there is neither a file nor a shipped scenario of that name.
    """
    path = Path(argument)
    try:
        if path.is_file():
            return path
        is_folder = bool(argument) and path.is_dir()
    except (OSError, ValueError):  # a name too long, or with a null character
        is_folder = False
    shipped = shipped_scenarios()
    if argument in shipped:
        return shipped[argument]
    raise InputError(_not_found(argument, list(shipped), is_folder))


def _not_found(argument: str, names: list[str], is_folder: bool) -> Fault:
    problem = "is a folder, not a scenario file" if is_folder else "no such scenario file"
    stem = argument.removesuffix(".toml")
    close = get_close_matches(stem, names, n=1)
    if close and not is_folder:
        remedy = f"did you mean {close[0]!r}? Shipped scenarios: {', '.join(names)}"
    elif names:
        remedy = f"give a file or a shipped scenario: {', '.join(names)}"
    else:
        remedy = "give the path of a scenario file"
    return Fault(printable(argument) or "SCENARIO", "", problem, remedy)
