"""What the commands of `swarm bench` share: options, values between commas, progress, output."""

from __future__ import annotations

import contextlib
import re
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, TypeVar

import typer

from swarm.runtime.errors import Fault, InputError
from swarm.scenario.files import resolve_scenario

if TYPE_CHECKING:
    from sim.bench.results import BenchResult, Progress
    from sim.fleet.autopilots import Autopilots
    from sim.fleet.layout import BusKind, LaunchOptions

LONGEST_S = 86_400.0
"""The longest time that an option takes."""
T = TypeVar("T")
Reader = Callable[[str, str], T]
"""The value that a word behind an option stands for; raises `InputError` where it is none."""

_SIZE = re.compile(r"([1-9]\d{0,3})[x×]([1-9]\d{0,4})")

ValleyArgument = Annotated[
    Path | None,
    typer.Argument(
        metavar="[SCENARIO]",
        help="Scenario file, or the name of a shipped one; default: valley-survey.",
        parser=resolve_scenario,
        show_default=False,
    ),
]
BusKindOption = Annotated[
    str, typer.Option("--bus", metavar="mesh|router", help="How the processes talk.")
]
SizesOption = Annotated[
    str, typer.Option("--sizes", metavar="NxM,…", help="UAVs and tasks of random missions.")
]
SeedsOption = Annotated[
    str, typer.Option("--seeds", metavar="N,…", help="Of random missions and of searches.")
]
MarkdownOption = Annotated[
    Path | None,
    typer.Option(
        "--out", metavar="FILE.md", help="Also write the tables as Markdown.", show_default=False
    ),
]


def each(flag: str, text: str, read: Reader[T]) -> list[T]:
    """The values between commas, each once."""
    words = [word.strip() for word in text.split(",")]
    return list(dict.fromkeys(read(flag, word) for word in words))


def integer(least: int, most: int, problem: str, remedy: str) -> Reader[int]:
    """Reads whole numbers within least..most, and refuses others with these words."""

    def read(flag: str, word: str) -> int:
        digits = word.isascii() and word.isdigit() and len(word) <= len(str(most))
        if not (digits and least <= int(word) <= most):
            raise InputError(Fault(flag, word, problem, remedy))
        return int(word)

    return read


_SEED = integer(0, 10**18 - 1, "no seed", "give whole numbers from 0 on, such as 0,1")


def seeds_of(text: str) -> list[int]:
    """The seeds that ``--seeds`` names.

    Raises:
        InputError: one of them is none.
    """
    return each("--seeds", text, _SEED)


def sizes_of(text: str) -> list[tuple[int, int]]:
    """How many UAVs and tasks each size has that ``--sizes`` names.

    Raises:
        InputError: one of them is none.
    """
    return each("--sizes", text, size_of)


def size_of(flag: str, word: str) -> tuple[int, int]:
    """How many UAVs and tasks ``word`` stands for.

    Raises:
        InputError: it is no size.
    """
    match = _SIZE.fullmatch(word)
    if match is None:
        raise InputError(Fault(flag, word, "no size", "write UAVs x tasks, such as 50x500"))
    return int(match[1]), int(match[2])


def limit_of(flag: str, word: str) -> float:
    """The time limit that ``word`` stands for [s].

    Raises:
        InputError: it is none.
    """
    try:
        limit_s = float(word)
    except ValueError:
        limit_s = -1.0
    if not 0.0 < limit_s <= LONGEST_S:
        remedy = "give seconds above 0, such as 10 or 1,3,10"
        raise InputError(Fault(flag, word, "no time limit", remedy))
    return limit_s


def check_files(plot: Path | None, out: Path | None, new_best: Path | None = None) -> None:
    """Refuse what cannot be written before anything is measured.

    Raises:
        InputError: a suffix that no picture has, or no such folder.
    """
    from coordinator.plot import PLOT_SUFFIXES

    faults = []
    if plot is not None and plot.suffix.lower() not in PLOT_SUFFIXES:
        remedy = f"end it in {', '.join(PLOT_SUFFIXES)}"
        faults.append(Fault("--plot", str(plot), "no picture has this suffix", remedy))
    for flag, path in (("--plot", plot), ("--out", out), ("--new-best", new_best)):
        if path is not None and not path.absolute().parent.is_dir():
            faults.append(Fault(flag, str(path), "its folder is not there", "make it first"))
    if faults:
        raise InputError(*faults)


def write_file(flag: str, path: Path, write: Callable[[Path], object]) -> None:
    """Write what ``flag`` asks for.

    Raises:
        InputError: the file cannot be written.
    """
    try:
        write(path)
    except OSError as error:
        problem = f"cannot write {path}: {error.strerror or error}"
        raise InputError(Fault(flag, "", problem, "name a file that can be")) from error


def bus_of(word: str) -> BusKind:
    """The bus of that name.

    Raises:
        InputError: it is none.
    """
    from sim.fleet.layout import BusKind

    if word not in (BusKind.MESH, BusKind.ROUTER):
        raise InputError(Fault("--bus", word, "no such bus", "choose mesh or router"))
    return BusKind(word)


def require_proc(command: str) -> None:
    """Refuse where the processor time of other processes cannot be read.

    Raises:
        InputError: there is no /proc.
    """
    if not Path("/proc/self/stat").exists():
        problem = "there is no /proc that tells processor time"
        raise InputError(Fault(f"swarm bench {command}", "", problem, "run it on Linux"))


def launch_options(
    scenario: Path,
    n_uav: int,
    autopilots: Autopilots,
    bus: BusKind,
    *,
    seed: int,
    speedup: float,
    position_rate_hz: float,
) -> LaunchOptions:
    """How to fly a scenario by guided agents whose logs are read."""
    from sim.fleet.layout import LaunchOptions, defaults_for
    from swarm.runtime.log import LogFormat

    defaults = defaults_for(autopilots, n_uav)
    return LaunchOptions(
        scenario=scenario,
        method="guided",
        seed=seed,
        speedup=speedup,
        bus=bus,
        position_rate_hz=position_rate_hz,
        acceptance_radius_m=defaults.acceptance_radius_m,
        start_timeout_s=defaults.start_timeout_s,
        autopilots=autopilots,
        log_format=LogFormat.JSON,
    )


@contextlib.contextmanager
def progress() -> Iterator[Progress]:
    """A place to say what is being done: a line that changes, on a terminal only."""
    from rich.console import Console

    from swarm.runtime.log import LogLevel, configure_logging

    configure_logging(LogLevel.ERROR)
    console = Console(stderr=True)
    with console.status("", spinner_style="dim") as status:
        yield status.update if console.is_terminal else lambda _: None


def show(done: BenchResult, *, json: bool) -> None:
    """Print a result for programs, or for people."""
    if json:
        from json import dumps

        typer.echo(dumps(done.as_json(), allow_nan=False))
        return
    from rich.console import Console

    Console(highlight=False).print(done)
