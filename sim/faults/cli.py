"""The command `swarm soak`."""

from __future__ import annotations

import contextlib
import os
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from swarm.runtime.errors import Fault, InputError
from swarm.runtime.options import JsonOption

if TYPE_CHECKING:
    from sim.faults.soak import Breach


def soak(
    seeds: Annotated[
        int, typer.Option("--seeds", min=1, metavar="N", help="How many cases to play.")
    ] = 1000,
    first: Annotated[int, typer.Option("--first", min=0, metavar="N", help="The first seed.")] = 0,
    jobs: Annotated[
        int | None,
        typer.Option(
            "--jobs",
            min=1,
            metavar="N",
            help="Processes that play them. Default: one for each processor.",
        ),
    ] = None,
    faults: Annotated[
        str,
        typer.Option(
            "--faults", metavar="KINDS", help="Kinds of fault, with commas between, or all."
        ),
    ] = "all",
    replay: Annotated[
        Path | None,
        typer.Option(
            "--replay",
            metavar="FILE",
            help="Play this one case instead, as a failing soak writes it.",
        ),
    ] = None,
    out: Annotated[
        Path,
        typer.Option("--out", metavar="FILE", help="Where to write the case that fails."),
    ] = Path("failing.case"),
    json: JsonOption = False,
    bug: Annotated[str, typer.Option("--bug", hidden=True)] = "",
) -> int:
    """Play missions with random faults until an invariant breaks.

    They are random themselves, and played in virtual time. Every case follows from its seed. One
    that fails is made as small as possible, printed, and written to a file that --replay plays
    again. Seeds from 1000000 on have accelerations, those from 2000000 on all of the field's
    constraints: batteries, bases, zones, wind, windows; from 3000000 on UAVs keep apart, and from
    4000000 on there are up to 40 of them. From 5000000 on fleets of 2 to 40, most of them small,
    keep apart that also lose up to 20 % of their messages all along, and are up to 1 m from where
    they believe to be, each in a direction that changes: nobody may come nearer than the
    separation less that metre. Exit status 0: every invariant held.

    Examples:
        swarm soak --seeds 10000
        swarm soak --seeds 500 --faults cut,crash --first 20000
        swarm soak --seeds 500 --first 2000000
        swarm soak --seeds 500 --first 5000000
        swarm soak --replay failing.case
    """
    import sys
    from json import dumps

    from sim.faults.case import format_case
    from sim.faults.generator import kinds_of
    from sim.faults.planted_bugs import BUGS
    from sim.faults.soak import shrunk
    from sim.faults.soak import soak as play_all
    from swarm.runtime.clock import SystemClock

    if replay is not None:
        return _replay(replay, json=json)
    if bug and bug not in BUGS:
        raise InputError(Fault("--bug", bug, f"is none of {', '.join(BUGS)}", "choose one"))
    kinds, clock = kinds_of(faults, "--faults"), SystemClock()
    began_s = clock.now_s()
    with _counting(seeds) as progress:
        breach = play_all(
            first, seeds, jobs or os.cpu_count() or 1, kinds, bug=bug, progress=progress
        )
    elapsed_s = clock.now_s() - began_s
    if breach is None:
        if json:
            print(dumps({"first": first, "seeds": seeds, "elapsed_s": elapsed_s, "broken": None}))
        else:
            each_ms = 1e3 * elapsed_s / seeds
            print(f"{seeds} cases, no invariant broken ({elapsed_s:.0f} s, {each_ms:.0f} ms each)")
        return 0
    print(f"seed {breach.case.seed} breaks: {breach.broken}; shrinking", file=sys.stderr)
    small = shrunk(breach)
    _write(out, small)
    if json:
        lines = format_case(small.case).splitlines()
        told = {"seed": breach.case.seed, "broken": str(small.broken), "case": lines}
        print(dumps({"first": first, "seeds": seeds, "elapsed_s": elapsed_s, **told}))
    else:
        print(format_case(small.case), end="")
        print(f"# {small.broken}")
        print(f"# again: swarm soak --replay {out}")
    return 1


def _replay(path: Path, *, json: bool) -> int:
    from json import dumps

    from sim.faults.case import format_case, parse_case, play
    from sim.faults.generator import read_lines

    case = parse_case(read_lines(path), str(path))
    verdict = play(case)
    broken = None if verdict.broken is None else str(verdict.broken)
    if json:
        print(dumps({"case": format_case(case).splitlines(), "broken": broken}))
    else:
        for line in verdict.world.mission_state.story:
            when = "" if line.mission_s is None else f"{line.mission_s:.3f}"
            print(f"{when:>9}  {line.text}")
        print(broken or "no invariant broken")
    return 0 if broken is None else 1


@contextlib.contextmanager
def _counting(seeds: int) -> Iterator[Callable[[int], None]]:
    """Shows on a terminal how many cases have been played and how long the rest will take."""
    from rich.console import Console
    from rich.progress import BarColumn, MofNCompleteColumn, Progress, TimeRemainingColumn

    console = Console(stderr=True)
    columns = (BarColumn(), MofNCompleteColumn(), TimeRemainingColumn())
    hidden = not console.is_terminal
    with Progress(*columns, console=console, transient=True, disable=hidden) as shown:
        task = shown.add_task("cases", total=seeds)
        yield lambda count: shown.advance(task, count)


def _write(path: Path, breach: Breach) -> None:
    from sim.faults.case import format_case

    try:
        path.write_text(f"{format_case(breach.case)}# {breach.broken}\n", encoding="utf-8")
    except OSError as error:
        problem = f"cannot be written: {error.strerror or error}"
        raise InputError(Fault("--out", str(path), problem, "name a file that can be")) from error
