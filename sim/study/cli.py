"""The command `swarm study`."""

from __future__ import annotations

from contextlib import ExitStack
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from sim.options import (
    DelayOption,
    JitterOption,
    LegSdOption,
    LossOption,
    MessageLossOption,
    OutcomesOption,
    PartitionLengthOption,
    PartitionRateOption,
    PopupOption,
    PopupRateOption,
    PositionErrorOption,
    ReattemptOption,
    SpeedSdOption,
    SurvivalOption,
    WindOption,
    WithdrawRateOption,
)
from swarm.runtime.errors import Fault, InputError, SwarmError
from swarm.runtime.extras import require_extra
from swarm.runtime.options import JsonOption

if TYPE_CHECKING:
    from sim.study.design import Study
    from sim.study.runner import Fly
    from sim.study.store import RowStore
    from sim.study.summary import StudySummary
    from sim.study.trial import TrialRow

__all__ = ["study"]


_INTERRUPTED = 130
_SUMMARY_FILE = "summary.md"
_WIDTH = 100
"""Columns where standard output is no terminal."""


def study(
    what: Annotated[
        str | None,
        typer.Argument(
            metavar="[SCENARIO|STUDY]",
            help="A scenario or a study: a TOML file, or the name of a shipped one such as "
            "valley-survey or robustness.",
            show_default=False,
        ),
    ] = None,
    random: Annotated[
        str | None,
        typer.Option(
            "--random",
            metavar="N,M",
            help="Fly random missions of N UAVs and M tasks, another one in each trial.",
            show_default=False,
        ),
    ] = None,
    trials: Annotated[
        int | None,
        typer.Option(
            "--trials",
            min=1,
            max=1_000_000,
            metavar="K",
            help="Fates that every policy meets, at every point. Default: as the study says, or "
            "50.",
            show_default=False,
        ),
    ] = None,
    seed: Annotated[
        int | None,
        typer.Option(
            "--seed",
            min=0,
            max=2**63 - 1,
            metavar="N",
            help="Seed of everything random. Default: as the study says, or 0.",
            show_default=False,
        ),
    ] = None,
    policies: Annotated[
        str | None,
        typer.Option(
            "--policies",
            metavar="NAME,…",
            help="What to compare: guided, guided-alone (its coordinator dead), greedy, lookahead, "
            "central, central-divert, interval:SECONDS, frozen, cbba, nearest, value-per-time. "
            "Default: as the study says, or all.",
            show_default=False,
        ),
    ] = None,
    reference: Annotated[
        str | None,
        typer.Option(
            "--reference",
            metavar="NAME",
            help="The policy to which the others are compared, trial by trial. Default: as the "
            "study says, or central, or the first one.",
            show_default=False,
        ),
    ] = None,
    bound: Annotated[
        bool | None,
        typer.Option(
            "--bound/--no-bound",
            help="Also work out a value that no policy can exceed, from the draws themselves.",
            show_default=False,
        ),
    ] = None,
    vary: Annotated[
        list[str] | None,
        typer.Option(
            "--vary",
            metavar="NAME=V,…",
            help="Fly the study again with this number of its uncertainty at each of the values, "
            "instead of what the study varies; may be repeated. Names are those of study files, "
            "such as loss, popup and message_loss.",
            show_default=False,
        ),
    ] = None,
    loss: LossOption = None,
    popup: PopupOption = None,
    popup_rate: PopupRateOption = None,
    withdraw_rate: WithdrawRateOption = None,
    outcomes: OutcomesOption = None,
    survival: SurvivalOption = None,
    reattempt: ReattemptOption = None,
    speed_sd: SpeedSdOption = None,
    leg_sd: LegSdOption = None,
    wind: WindOption = None,
    position_error_m: PositionErrorOption = None,
    message_loss: MessageLossOption = None,
    delay_s: DelayOption = None,
    jitter_s: JitterOption = None,
    partition_rate: PartitionRateOption = None,
    partition_s: PartitionLengthOption = None,
    jobs: Annotated[
        int | None,
        typer.Option(
            "--jobs",
            min=1,
            max=1024,
            metavar="J",
            help="Processes that fly trials; 1 for none but this one. Default: one per processor. "
            "The numbers do not depend on it.",
            show_default=False,
        ),
    ] = None,
    scheduler: Annotated[
        str | None,
        typer.Option(
            "--scheduler",
            metavar="ADDRESS",
            help="Fly the trials on the Dask cluster whose scheduler is there, such as "
            "tcp://10.0.0.1:8786; needs peckorder[study] here and on the workers.",
            show_default=False,
        ),
    ] = None,
    out: Annotated[
        Path | None,
        typer.Option(
            "--out",
            metavar="FOLDER",
            help="Keep the study, every trial, a summary and plots there. The same command goes on "
            "where it was interrupted, or flies more --trials.",
            show_default=False,
        ),
    ] = None,
    file_format: Annotated[
        str,
        typer.Option(
            "--format",
            metavar="csv|parquet",
            help="How --out keeps the trials: as CSV, or as Parquet too (needs peckorder[study]).",
        ),
    ] = "csv",
    plots: Annotated[
        bool, typer.Option("--plots/--no-plots", help="Whether --out gets plots.")
    ] = True,
    update: Annotated[
        Path | None,
        typer.Option(
            "--update",
            metavar="FILE.md",
            help="Renew the table of this study in a Markdown file, between the lines "
            "<!-- study NAME --> and <!-- end of study -->.",
            show_default=False,
        ),
    ] = None,
    json: JsonOption = False,
) -> int:
    """Compare policies over many missions in which much goes wrong.

    UAVs are lost, tasks pop up and so on. In every trial all policies meet the same drawn future,
    so that their differences show with few trials. Numbers come with 95 % confidence intervals.
    Everything follows from the seed; wall times of decisions alone differ from run to run.

    Examples:
        swarm study valley-survey --loss 0.3 --popup 0.3
        swarm study --random 10,50 --trials 20 --loss 0.3 --policies guided,central,cbba
        swarm study --random 5,25 --vary loss=0,0.1,0.3 --policies greedy,guided --out losses
        swarm study robustness --out robustness
        swarm study readme --update sim/README.md
    """
    from rich.console import Console

    require_extra("ground", "swarm study")  # not at the end, when all has been flown
    from sim.study.policies.roster import ROSTER
    from sim.study.progress import StudyProgress
    from sim.study.request import StudyRequest, requested_study
    from sim.study.runner import run_study
    from sim.study.store import FolderStore, MemoryStore, require_parquet
    from sim.study.tables import MarkedFile
    from sim.study.trial import TrialContext
    from swarm.runtime.clock import SystemClock

    _check_options(file_format, out, jobs, scheduler)
    uncertainty: dict[str, float | bool | None] = {
        "loss": loss,
        "popup": popup,
        "popups_per_min": popup_rate,
        "withdrawals_per_min": withdraw_rate,
        "outcomes": outcomes,
        "survival": survival,
        "speed_sd_frac": speed_sd,
        "leg_sd_frac": leg_sd,
        "wind_m_s": wind,
        "position_error_m": position_error_m,
        "message_loss": message_loss,
        "delay_s": delay_s,
        "jitter_s": jitter_s,
        "partitions_per_min": partition_rate,
        "partition_s": partition_s,
    }
    asked = StudyRequest(
        what=what,
        random=random,
        trials=trials,
        seed=seed,
        policies=policies,
        reference=reference,
        bound=bound,
        reattempt=reattempt,
        vary=vary or (),
        uncertainty=uncertainty,
    )
    found = requested_study(asked, ROSTER)
    marked = None if update is None else MarkedFile(update, found.name)
    if file_format == "parquet":
        require_parquet()
    errors = Console(stderr=True)
    if found.certain:
        line = "nothing is uncertain, so all trials are alike: try --loss 0.3 --popup 0.3"
        errors.print(line, highlight=False, soft_wrap=True)
    with ExitStack() as stack:
        store: RowStore
        if out is None:
            store = MemoryStore(found)
        else:
            store = folder_store = FolderStore(out, found, ROSTER)
            stack.callback(folder_store.close)
        progress = stack.enter_context(StudyProgress(errors, found.name, SystemClock()))
        try:
            rows = run_study(TrialContext(found, ROSTER), store, _fly(jobs, scheduler), progress)
        except KeyboardInterrupt:
            kept = "nothing is kept without --out"
            if out is not None:
                kept = f"{out} keeps them, and the same command goes on"
            line = f"interrupted after {progress.done} of {progress.total} trials: {kept}"
            errors.print(line, highlight=False, soft_wrap=True)
            return _INTERRUPTED
    summary = _summary(found, rows, here=scheduler is None)
    files = [] if out is None else _write(out, summary, rows, file_format, plots=plots)
    if marked is not None:
        marked.replace(summary.markdown())
    _tell(found, summary, files, json=json)
    return 0


def _check_options(
    file_format: str, out: Path | None, jobs: int | None, scheduler: str | None
) -> None:
    if file_format not in ("csv", "parquet"):
        fault = Fault("--format", file_format, "no such format", "choose csv or parquet")
        raise InputError(fault)
    if file_format == "parquet" and out is None:
        fault = Fault("--format", file_format, "has no folder to write to", "add --out FOLDER")
        raise InputError(fault)
    if jobs is not None and scheduler is not None:
        problem = "does not go with --scheduler"
        remedy = "leave it out: the cluster has as many processes as it has"
        raise InputError(Fault("--jobs", str(jobs), problem, remedy))


def _fly(jobs: int | None, scheduler: str | None) -> Fly:
    from sim.study.runner import in_processes, on_dask
    from swarm.kernels.lower_level import default_threads

    if scheduler is not None:
        return on_dask(scheduler)
    return in_processes(default_threads() if jobs is None else jobs)


def _summary(found: Study, rows: list[TrialRow], *, here: bool) -> StudySummary:
    """What the rows say; ``here`` if they were flown on this machine."""
    from sim.bench.machine import this_machine
    from sim.study.design import RandomMissions
    from sim.study.policies.roster import ROSTER
    from sim.study.summary import StudyDescription, summarise
    from sim.study.trial import BOUND

    match found.missions:
        case RandomMissions(uavs, tasks):
            missions = f"random missions of {uavs} UAVs and {tasks} tasks"
        case same:
            missions = f"mission {same.mission.name}"
    if found.uncertainty.outcomes:
        again = found.mission(0).reattempt_failed
        missions += f", where failed tasks {'open again' if again else 'stay failed'}"
    machine = this_machine()
    what = {name: ROSTER.policy(name).what for name in found.policies}
    if found.bound:
        what[BOUND] = ROSTER.make_bound().what
    about = StudyDescription(
        missions=missions,
        uncertainty=found.uncertainty,
        seed=found.seed,
        machine=f"{machine.cpu}, {machine.cores} cores" if here else "",
        ideal=frozenset(name for name in found.policies if ROSTER.ideal(name)),
        what=what,
    )
    return summarise(rows, found.compared_to, about)


def _write(
    out: Path, summary: StudySummary, rows: list[TrialRow], file_format: str, *, plots: bool
) -> list[Path]:
    """Everything but the trials themselves; the files that ``out`` has then got."""
    from sim.study.store import ROWS_FILE, STUDY_FILE, write_parquet

    files = [out / STUDY_FILE, out / ROWS_FILE]
    try:
        if file_format == "parquet":
            files.append(write_parquet(out, rows))
        files.append(out / _SUMMARY_FILE)
        files[-1].write_text(summary.markdown(every_setting=True), encoding="utf-8")
        if plots:
            from sim.study.plots import draw_study

            files += draw_study(summary, out)
    except OSError as error:
        reason = error.strerror or error
        raise SwarmError(
            f"the trials are in {out}, and the rest cannot be written: {reason}"
        ) from error
    return files


def _tell(found: Study, summary: StudySummary, files: list[Path], *, json: bool) -> None:
    from json import dumps

    from rich.console import Console

    if json:
        told = {
            "study": found.name,
            "trials": found.trials,
            "policies": list(found.policies),
            **summary.as_json(),
            "files": [str(path) for path in files],
        }
        typer.echo(dumps(told, allow_nan=False))
        return
    console = Console(highlight=False)
    if not console.is_terminal:
        console.width = _WIDTH
    console.print(summary.table())
    if files:
        console.print(f"\nWritten: {', '.join(map(str, files))}", soft_wrap=True)
