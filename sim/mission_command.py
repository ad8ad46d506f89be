"""What the commands that fly missions have in common: options, and how they tell what came of it.

Leaves out: the commands themselves (sim.cli, sim.simulate_command), and laying out a report
(coordinator.view).
"""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from coordinator.planner.methods import ONLINE_METHODS
from swarm.complete import among

if TYPE_CHECKING:
    from coordinator.view.report import MissionReport

__all__ = ["MethodOption", "ReportOption", "tell"]

MethodOption = Annotated[
    str,
    typer.Option(
        "--method",
        metavar="METHOD",
        help="Decision rule: greedy, lookahead or guided.",
        autocompletion=among(*ONLINE_METHODS),
    ),
]

ReportOption = Annotated[
    Path | None,
    typer.Option(
        "--report",
        metavar="FILE",
        help="Also write the report, as .json or .md.",
        show_default=False,
    ),
]


def tell(told: MissionReport, *, json: bool, report: Path | None) -> int:
    """Print and write the report; the exit status of the command."""
    from json import dumps

    from rich.console import Console

    from coordinator.view.report import mission_ok, write_report

    if json:
        typer.echo(dumps(told.as_json(), allow_nan=False))
    else:
        told.render(Console(highlight=False))
    if report is not None:  # last: a full disk must not hide the result
        write_report(told, report)
    return 0 if mission_ok(told.result) else 1
