"""Find a scenario by what a person types: a file's path or a shipped name.

Shipped scenarios are the TOML files of the package ``sim.scenarios``. They are
looked up by that name among the installed packages, not imported, so that
commands of the lower packages can offer them. Leaves out: reading the file.
"""

from __future__ import annotations

import importlib.util
from difflib import get_close_matches
from pathlib import Path

from swarm.errors import Fault, InputError
from swarm.scenario.findings import printable

__all__ = ["resolve_scenario", "shipped_scenarios"]

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
