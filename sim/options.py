"""Options of the commands that fly missions, so that they look alike, and their report."""

from __future__ import annotations

from dataclasses import dataclass, fields, replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from coordinator.planner.options import online_method_names
from coordinator.recording.options import check_new_recording
from swarm.runtime.option_groups import option
from swarm.runtime.options import complete_from

if TYPE_CHECKING:
    from coordinator.terminal.report import MissionReport
    from sim.world.uncertainty import Uncertainty
    from swarm.model import Mission


def _number(names: str, most: float, metavar: str, text: str, least: float = 0.0) -> Any:
    return option(None, *names.split(), min=least, max=most, metavar=metavar, help=text)


def _switch(name: str, text: str) -> Any:
    return option(None, f"--{name}/--no-{name}", help=text)


@dataclass(frozen=True, slots=True)
class ChanceOptions:
    """What may go wrong by chance, by the names of `Uncertainty`; None where nothing is said."""

    loss: float | None = _number(
        "--loss", 1.0, "P", "Probability that a UAV is lost, at a random moment."
    )
    popup: float | None = _number(
        "--popup", 1.0, "P", "Probability that a task appears only during the mission."
    )
    popups_per_min: float | None = _number(
        "--popup-rate",
        1e4,
        "N",
        "Tasks that appear besides, per minute on average; each is like one of the scenario's, at"
        " a random place among them.",
    )
    withdrawals_per_min: float | None = _number(
        "--withdraw-rate", 1e4, "N", "Tasks that are withdrawn, per minute on average."
    )
    outcomes: bool | None = _switch(
        "outcomes",
        "Let attempts succeed or fail by chance, with the scenario's probabilities of success.",
    )
    survival: bool | None = _switch(
        "survival", "Let tasks cost UAVs by chance, with the scenario's probabilities of survival."
    )
    reattempt: bool | None = _switch(
        "reattempt", "Whether failed tasks open again, instead of what the scenario says."
    )
    speed_frac: float | None = _number(
        "--speed-frac",
        10.0,
        "FRAC",
        "Share of its cruise speed at which every UAV really flies. Default: 1.",
        least=0.1,
    )
    drain_frac: float | None = _number(
        "--drain-frac",
        10.0,
        "FRAC",
        "How many times as fast as planned batteries really drain. Default: 1.",
        least=0.1,
    )
    speed_sd_frac: float | None = _number(
        "--speed-sd",
        2.0,
        "FRAC",
        "Standard deviation of each UAV's speed, as a share of its cruise speed.",
    )
    leg_sd_frac: float | None = _number("--leg-sd", 2.0, "FRAC", "The same for each leg by itself.")
    wind_m_s: float | None = _number(
        "--wind",
        100.0,
        "M/S",
        "Speed of a steady wind from a random direction. A UAV flies at up to 1.25 times its "
        "cruise speed, or the wind's if that is more, through the air.",
    )
    position_error_m: float | None = _number(
        "--position-error-m",
        1e4,
        "M",
        "Standard deviation, east and north each, of where a UAV stops for a task.",
    )
    message_loss: float | None = _number(
        "--message-loss", 1.0, "P", "Share of messages that never arrive."
    )
    delay_s: float | None = _number(
        "--delay-s --latency-s", 60.0, "S", "Least delay of every message."
    )
    jitter_s: float | None = _number(
        "--jitter-s", 60.0, "S", "Mean of what comes on top of it, by chance."
    )
    partitions_per_min: float | None = _number(
        "--partition-rate",
        1e3,
        "N",
        "How often, per minute on average, a random half of the fleet is cut off from the rest "
        "and the coordinator.",
    )
    partition_s: float | None = _number(
        "--partition-s", 1e6, "S", "How long each such partition lasts. Default: 30."
    )

    def changed(self, uncertainty: Uncertainty) -> Uncertainty:
        """``uncertainty`` with what was said."""
        said = {each.name: getattr(self, each.name) for each in fields(self)}
        del said["reattempt"]  # which is the mission's
        return replace(uncertainty, **{name: n for name, n in said.items() if n is not None})


CoordinatorLostOption = Annotated[
    float | None,
    typer.Option(
        "--coordinator-lost-s",
        min=0.0,
        max=1e9,
        metavar="S",
        help="The coordinator dies at this mission time. Tasks that appear or are withdrawn "
        "later come from an operator's seat.",
        show_default=False,
    ),
]


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


def check_flight(method: str, report: Path | None, record: Path | None) -> None:
    """Refuse a method, and files to be written, before anything is flown."""
    from coordinator.planner.plan import check_online_method
    from coordinator.terminal.report import check_report_path

    check_online_method(method)
    if report is not None:
        check_report_path(report)
    if record is not None:
        check_new_recording(record)


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
    return 1 if told.missed else 0
