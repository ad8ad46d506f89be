"""Options of the commands that fly missions, so that they look alike, and their report.

Leaves out: the commands themselves, and laying out a report (coordinator.terminal).
"""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from coordinator.planner.options import online_method_names
from swarm.runtime.options import complete_from

if TYPE_CHECKING:
    from coordinator.terminal.report import MissionReport
    from sim.world.uncertainty import Uncertainty
    from swarm.model import Mission

__all__ = [
    "CoordinatorLostOption",
    "DelayOption",
    "JitterOption",
    "LegSdOption",
    "LossOption",
    "MessageLossOption",
    "MethodOption",
    "OutcomesOption",
    "PartitionLengthOption",
    "PartitionRateOption",
    "PopupOption",
    "PopupRateOption",
    "PositionErrorOption",
    "ReattemptOption",
    "ReportOption",
    "SpeedSdOption",
    "SurvivalOption",
    "WindOption",
    "WithdrawRateOption",
    "asked_for",
    "print_report",
    "with_reattempts",
]


def _number(*names: str, most: float, metavar: str, help_text: str) -> Any:
    return typer.Option(
        *names, min=0.0, max=most, metavar=metavar, help=help_text, show_default=False
    )


LossOption = Annotated[
    float | None,
    _number(
        "--loss",
        most=1.0,
        metavar="P",
        help_text="Probability that a UAV is lost, at a random moment.",
    ),
]


PopupOption = Annotated[
    float | None,
    _number(
        "--popup",
        most=1.0,
        metavar="P",
        help_text="Probability that a task appears only during the mission.",
    ),
]


PopupRateOption = Annotated[
    float | None,
    _number(
        "--popup-rate",
        most=1e4,
        metavar="N",
        help_text="Tasks that appear besides, per minute on average; each is like one of the "
        "scenario's, at a random place among them.",
    ),
]


WithdrawRateOption = Annotated[
    float | None,
    _number(
        "--withdraw-rate",
        most=1e4,
        metavar="N",
        help_text="Tasks that are withdrawn, per minute on average.",
    ),
]


OutcomesOption = Annotated[
    bool | None,
    typer.Option(
        "--outcomes/--no-outcomes",
        help="Let attempts succeed or fail by chance, with the scenario's probabilities of "
        "success.",
        show_default=False,
    ),
]


SurvivalOption = Annotated[
    bool | None,
    typer.Option(
        "--survival/--no-survival",
        help="Let tasks cost UAVs by chance, with the scenario's probabilities of survival.",
        show_default=False,
    ),
]


ReattemptOption = Annotated[
    bool | None,
    typer.Option(
        "--reattempt/--no-reattempt",
        help="Whether failed tasks open again, instead of what the scenario says.",
        show_default=False,
    ),
]


SpeedSdOption = Annotated[
    float | None,
    _number(
        "--speed-sd",
        most=2.0,
        metavar="FRAC",
        help_text="Standard deviation of each UAV's speed, as a share of its cruise speed.",
    ),
]


LegSdOption = Annotated[
    float | None,
    _number(
        "--leg-sd",
        most=2.0,
        metavar="FRAC",
        help_text="The same for each leg by itself.",
    ),
]


WindOption = Annotated[
    float | None,
    _number(
        "--wind",
        most=100.0,
        metavar="M/S",
        help_text="Speed of a steady wind from a random direction. A UAV flies at up to 1.25 "
        "times its cruise speed, or the wind's if that is more, through the air.",
    ),
]


PositionErrorOption = Annotated[
    float | None,
    _number(
        "--position-error-m",
        most=1e4,
        metavar="M",
        help_text="Standard deviation, east and north each, of where a UAV stops for a task.",
    ),
]


MessageLossOption = Annotated[
    float | None,
    _number(
        "--message-loss",
        most=1.0,
        metavar="P",
        help_text="Share of messages that never arrive.",
    ),
]


DelayOption = Annotated[
    float | None,
    _number(
        "--delay-s",
        "--latency-s",
        most=60.0,
        metavar="S",
        help_text="Least delay of every message.",
    ),
]


JitterOption = Annotated[
    float | None,
    _number(
        "--jitter-s",
        most=60.0,
        metavar="S",
        help_text="Mean of what comes on top of it, by chance.",
    ),
]


PartitionRateOption = Annotated[
    float | None,
    _number(
        "--partition-rate",
        most=1e3,
        metavar="N",
        help_text="How often, per minute on average, a random half of the fleet is cut off from "
        "the rest and the coordinator.",
    ),
]


PartitionLengthOption = Annotated[
    float | None,
    _number(
        "--partition-s",
        most=1e6,
        metavar="S",
        help_text="How long each such partition lasts. Default: 30.",
    ),
]


CoordinatorLostOption = Annotated[
    float | None,
    _number(
        "--coordinator-lost-s",
        most=1e9,
        metavar="S",
        help_text="The coordinator dies at this mission time. Tasks that appear or are withdrawn "
        "later come from an operator's seat.",
    ),
]


def asked_for(base: Uncertainty, **given: float | bool | None) -> Uncertainty:
    """``base`` with the fields of `Uncertainty` that were asked for; None leaves one as it is."""
    wanted: dict[str, Any] = {name: value for name, value in given.items() if value is not None}
    return replace(base, **wanted)


def with_reattempts(mission: Mission, *, reattempt: bool | None) -> Mission:
    """``mission`` with failed tasks opening again or not; None leaves that to the scenario."""
    return mission if reattempt is None else replace(mission, reattempt_failed=reattempt)


MethodOption = Annotated[
    str,
    typer.Option(
        "--method",
        metavar="METHOD",
        help="Decision rule: guided, greedy, lookahead, nearest or value-per-time.",
        autocompletion=complete_from(online_method_names),
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


def print_report(told: MissionReport, *, json: bool, report: Path | None) -> int:
    """Print and write the report; the exit status of the command."""
    from json import dumps

    from rich.console import Console

    from coordinator.terminal.report import write_report

    if json:
        typer.echo(dumps(told.as_json(), allow_nan=False))
    else:
        told.render(Console(highlight=False))
    if report is not None:  # last: a full disk must not hide the result
        write_report(told, report)
    return 0 if told.result.is_complete else 1
