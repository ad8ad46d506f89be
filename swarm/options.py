"""Arguments and options that several commands share, so that they look alike.

Use them as annotations of a command's parameters; the default stays with the
parameter::

    def plan(scenario: ScenarioArgument, json: JsonOption = False, seed: SeedOption = 0) -> int: ...

Names: `ScenarioArgument` (a `pathlib.Path`; give it to
`swarm.scenario.load_scenario`), `JsonOption` (bool), `SeedOption` (int),
`TimeLimitOption` (float or None), `LogLevelOption` and `LogFormatOption` (for
`swarm.log.configure_logging`; defaults `LogLevel.INFO`, `LogFormat.AUTO`) and
the hidden `LifelineOption` (int or None). Leaves out: what a single command
alone has.
"""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from swarm.log import LogFormat, LogLevel
from swarm.scenario.shipped import resolve_scenario, shipped_scenarios

__all__ = [
    "JsonOption",
    "LifelineOption",
    "LogFormatOption",
    "LogLevelOption",
    "ScenarioArgument",
    "SeedOption",
    "TimeLimitOption",
]


def _complete_scenario(incomplete: str) -> list[tuple[str, str]]:
    """Shipped names and TOML files that continue what has been typed."""
    names = [(name, "shipped") for name in shipped_scenarios() if name.startswith(incomplete)]
    folder, _, beginning = incomplete.rpartition("/")
    prefix = f"{folder}/" if "/" in incomplete else ""
    try:
        entries = sorted(Path(prefix or ".").iterdir())
    except OSError:
        entries = []
    for entry in entries:
        if not entry.name.startswith(beginning):
            continue
        if entry.is_dir() and not entry.name.startswith("."):
            names.append((f"{prefix}{entry.name}/", "folder"))
        elif entry.suffix == ".toml":
            names.append((f"{prefix}{entry.name}", "file"))
    return names


ScenarioArgument = Annotated[
    Path,
    typer.Argument(
        metavar="SCENARIO",
        help="Scenario file, or the name of a shipped one such as table-1.",
        parser=resolve_scenario,
        autocompletion=_complete_scenario,
        show_default=False,
    ),
]
"""Path of an existing scenario file; shipped names are resolved already."""

JsonOption = Annotated[
    bool,
    typer.Option("--json", help="Print one JSON object on standard output, nothing else there."),
]

SeedOption = Annotated[
    int,
    typer.Option("--seed", min=0, metavar="N", help="Seed of everything random."),
]

TimeLimitOption = Annotated[
    float | None,
    typer.Option(
        "--time-limit-s",
        min=0.0,
        metavar="S",
        help="Stop searching after this many seconds and take the best so far.",
        show_default=False,
    ),
]

LogLevelOption = Annotated[
    LogLevel,
    typer.Option("--log-level", envvar="SWARM_LOG_LEVEL", help="How much to log."),
]

LogFormatOption = Annotated[
    LogFormat,
    typer.Option("--log-format", envvar="SWARM_LOG_FORMAT", help="What a log line looks like."),
]

LifelineOption = Annotated[
    int | None,
    typer.Option("--lifeline", min=0, metavar="FD", hidden=True),
]
"""Read end of a pipe held by the parent process; the command ends when it closes."""
