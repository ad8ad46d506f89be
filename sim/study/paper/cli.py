"""The command `swarm reproduce`."""

from __future__ import annotations

from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from swarm.runtime.errors import Fault, InputError
from swarm.runtime.extras import require_extra
from swarm.runtime.options import JsonOption, SeedOption

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator

    from sim.study.paper.reproduction import Reproduction


def reproduce(
    problems: Annotated[
        int,
        typer.Option(
            "--problems", min=1, max=100_000, metavar="N", help="How many random problems."
        ),
    ] = 50,
    seed: SeedOption = 0,
    plots: Annotated[
        Path | None,
        typer.Option(
            "--plots",
            metavar="FOLDER",
            help="Draw figures 2, 3 and 4 there, each as .png and .svg.",
            show_default=False,
        ),
    ] = None,
    json: JsonOption = False,
) -> int:
    """Compute the paper's tables and figures again.

    They are shown beside what it prints: tables I and II, random problems, relative times, and
    the theorems against brute force; differences are explained. The same seed gives the same
    results, times apart. Exit status 1: a figure or a theorem did not come out as it must.

    Examples:
        swarm reproduce
        swarm reproduce --problems 300 --plots figures
        swarm reproduce --seed 7 --json
    """
    require_extra("ground", "swarm reproduce")  # not at the end, when all has been computed
    from sim.study.paper.reproduction import reproduce_paper
    from swarm.kernels.lower_level import default_threads
    from swarm.runtime.clock import SystemClock

    if plots is not None:
        _make_folder(plots)
    with _progress(problems) as progress:
        found = reproduce_paper(
            problems, seed, clock=SystemClock(), threads=default_threads(), progress=progress
        )
    drawn: list[Path] = []
    if plots is not None:
        from sim.study.paper.figures import draw_figures

        try:
            drawn = draw_figures(found, plots)
        except OSError as error:
            raise _unwritable(plots, error) from error
    return _tell(found, drawn, json=json)


def _tell(found: Reproduction, drawn: list[Path], *, json: bool) -> int:
    """Print it; the exit status of the command."""
    from json import dumps

    from rich.console import Console

    from sim.study.paper.report import reproduction_text

    if json:
        figures = [str(path) for path in drawn]
        print(dumps({**found.as_json(), "figures": figures}, allow_nan=False))
    else:
        Console(highlight=False).print(reproduction_text(found, drawn))
    return 0 if found.ok else 1


@contextmanager
def _progress(problems: int) -> Iterator[Callable[[int], None]]:
    """A bar on standard error, while it is a terminal."""
    from rich.console import Console
    from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn

    console = Console(stderr=True)
    columns = (TextColumn("random problems"), BarColumn(), MofNCompleteColumn())
    with Progress(
        *columns, console=console, transient=True, disable=not console.is_terminal
    ) as bar:
        task = bar.add_task("", total=problems)
        yield lambda done: bar.update(task, completed=done)


def _make_folder(folder: Path) -> None:
    """Before any work is done."""
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise _unwritable(folder, error) from error


def _unwritable(folder: Path, error: OSError) -> InputError:
    problem = f"cannot write to {folder}: {error.strerror or error}"
    return InputError(Fault("--plots", "", problem, "name a folder that can be written"))
