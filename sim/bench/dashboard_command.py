"""The command `swarm bench dashboard`.

Leaves out: what it does (`sim.bench.dashboard_load`).
"""

from __future__ import annotations

from typing import Annotated

import typer

from sim.bench.trouble_commands import progress
from sim.bench.words import each
from swarm.errors import Fault, InputError
from swarm.options import JsonOption, SeedOption

__all__ = ["DASHBOARD_HELP", "dashboard"]

DASHBOARD_HELP = """Measure what a dashboard costs.

A mission is acted out on a real bus: every UAV tells its status, claims and ends tasks, and
says why. The dashboard is a process of its own; so many pages follow it. Exit status 0: it
took less than half a core whatever the pages. Needs Linux.

\b
Examples:
    swarm bench dashboard
    swarm bench dashboard --uavs 300 --rate-hz 5 --clients 1 --seconds 10 --json
"""
_MOST_CORES = 0.5


def dashboard(
    uavs: Annotated[
        int, typer.Option("--uavs", min=1, max=1000, metavar="N", help="How many UAVs.")
    ] = 100,
    tasks: Annotated[
        int, typer.Option("--tasks", min=1, max=5000, metavar="M", help="How many tasks.")
    ] = 1000,
    rate_hz: Annotated[
        float,
        typer.Option(
            "--rate-hz", min=0.1, max=50.0, metavar="HZ", help="Statuses of each UAV per second."
        ),
    ] = 2.0,
    clients: Annotated[
        str,
        typer.Option(
            "--clients", metavar="K,…", help="Pages that follow, one number after the other."
        ),
    ] = "0,1,5",
    seconds: Annotated[
        float,
        typer.Option(
            "--seconds", min=1.0, max=3600.0, metavar="S", help="How long to measure each."
        ),
    ] = 20.0,
    seed: SeedOption = 0,
    json: JsonOption = False,
) -> int:
    """See `DASHBOARD_HELP`."""
    import asyncio
    from json import dumps
    from pathlib import Path

    from rich.console import Console

    from sim.bench.dashboard_load import load_as_json, load_as_rich, measure_dashboard

    if not Path("/proc/self/stat").exists():
        problem = "there is no /proc that tells processor time"
        raise InputError(Fault("swarm bench dashboard", "", problem, "run it on Linux"))
    counts = tuple(each("--clients", clients, _count))
    with progress() as tell:
        done = asyncio.run(measure_dashboard(uavs, tasks, rate_hz, counts, seconds, seed, tell))
    if json:
        typer.echo(dumps(load_as_json(done), allow_nan=False))
    else:
        Console(highlight=False).print(load_as_rich(done))
    return 0 if max(following.cores for following in done.followings) < _MOST_CORES else 1


def _count(flag: str, word: str) -> int:
    if not (word.isascii() and word.isdigit() and int(word) <= 64):
        raise InputError(Fault(flag, word, "no number of pages", "give numbers up to 64"))
    return int(word)
