"""The command `swarm study`."""

from __future__ import annotations

from contextlib import ExitStack
from pathlib import Path
from typing import TYPE_CHECKING

import typer

from sim.options import ChanceOptions
from sim.study.options import StudyOutput, StudyRequest
from swarm.runtime.errors import SwarmError
from swarm.runtime.extras import require_extra
from swarm.runtime.option_groups import with_options
from swarm.runtime.options import JsonOption

if TYPE_CHECKING:
    from sim.study.design import Study
    from sim.study.runner import Fly
    from sim.study.summary import StudySummary
    from sim.study.trial import TrialRow

_INTERRUPTED = 130
_SUMMARY_FILE = "summary.md"
_WIDTH = 100
"""Columns where standard output is no terminal."""


@with_options
def study(
    *,
    asked: StudyRequest,
    chance: ChanceOptions,
    output: StudyOutput,
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
    from sim.study.request import requested_study
    from sim.study.runner import run_study
    from sim.study.store import FolderStore, RowStore
    from sim.study.tables import MarkedFile
    from sim.study.trial import TrialContext
    from swarm.runtime.clock import SystemClock

    output.check()
    found = requested_study(asked, chance, ROSTER)
    marked = None if output.update is None else MarkedFile(output.update, found.name)
    if output.file_format == "parquet":
        require_extra("study", "--format parquet")  # before anything is flown
    errors = Console(stderr=True)
    if found.certain:
        line = "nothing is uncertain, so all trials are alike: try --loss 0.3 --popup 0.3"
        errors.print(line, highlight=False, soft_wrap=True)
    with ExitStack() as stack:
        store = RowStore(found)
        if output.out is not None:
            store = FolderStore(output.out, found, ROSTER)
            stack.callback(store.close)
        progress = stack.enter_context(StudyProgress(errors, found.name, SystemClock()))
        try:
            rows = run_study(TrialContext(found, ROSTER), store, _fly(output), progress)
        except KeyboardInterrupt:
            kept = "nothing is kept without --out"
            if output.out is not None:
                kept = f"{output.out} keeps them, and the same command goes on"
            line = f"interrupted after {progress.done} of {progress.total} trials: {kept}"
            errors.print(line, highlight=False, soft_wrap=True)
            return _INTERRUPTED
    summary = _summary(found, rows, here=output.scheduler is None)
    files = [] if output.out is None else _write(output.out, found, summary, rows, output)
    if marked is not None:
        marked.replace(summary.markdown())
    _tell(found, summary, files, json=json)
    return 0


def _fly(output: StudyOutput) -> Fly:
    from sim.study.runner import in_processes, on_dask
    from swarm.kernels.lower_level import default_threads

    if output.scheduler is not None:
        return on_dask(output.scheduler)
    return in_processes(default_threads() if output.jobs is None else output.jobs)


def _summary(found: Study, rows: list[TrialRow], *, here: bool) -> StudySummary:
    """What the rows say; ``here`` if they were flown on this machine."""
    from sim.bench.machine import this_machine
    from sim.study.design import RandomMissions
    from sim.study.policies.roster import ROSTER
    from sim.study.style import shape_words
    from sim.study.summary import StudyDescription, summarise
    from sim.study.trial import BOUND

    match found.missions:
        case RandomMissions(uavs, tasks, shape):
            missions = f"random missions of {uavs} UAVs and {tasks} tasks"
            if shape is not None:
                missions += f" in the field ({shape_words(shape)})"
        case same:
            missions = f"mission {same.mission.name}"
    if found.uncertainty.outcomes:
        again = found.mission(0).reattempt_failed
        missions += f", where failed tasks {'open again' if again else 'stay failed'}"
    machine = this_machine()
    what = {name: ROSTER.policy(name, in_field=found.in_field).what for name in found.policies}
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
    folder: Path, found: Study, summary: StudySummary, rows: list[TrialRow], output: StudyOutput
) -> list[Path]:
    """Everything but the trials themselves; the files that ``folder`` has then got."""
    from sim.study.store import ROWS_FILE, STUDY_FILE, write_parquet
    from sim.study.trial import columns_of

    files = [folder / STUDY_FILE, folder / ROWS_FILE]
    try:
        if output.file_format == "parquet":
            files.append(write_parquet(folder, rows, columns_of(found)))
        files.append(folder / _SUMMARY_FILE)
        files[-1].write_text(summary.markdown(every_setting=True), encoding="utf-8")
        if output.plots:
            from sim.study.plots import draw_study

            files += draw_study(summary, folder)
    except OSError as error:
        reason = error.strerror or error
        raise SwarmError(
            f"the trials are in {folder}, and the rest cannot be written: {reason}"
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
