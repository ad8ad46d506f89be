"""The command `swarm bench autopilot`.

Leaves out: what it does (`sim.bench.autopilot_load`).
"""

from __future__ import annotations

from typing import Annotated

import typer

from sim.bench.trouble_commands import progress
from swarm.errors import Fault, InputError
from swarm.options import JsonOption, SeedOption

__all__ = ["AUTOPILOT_HELP", "autopilot"]

AUTOPILOT_HELP = """Measure how many flying vehicles one process simulates.

Every vehicle has a TCP client of its own that asks for positions at 10 Hz and the status
messages that an agent asks for. Exit status 0: at least 99.5 % of them came, for less than
one core. Needs Linux.

\b
Examples:
    swarm bench autopilot
    swarm bench autopilot --vehicles 20 --seconds 5 --json
"""
_LEAST_DELIVERED_FRAC = 0.995
_MOST_CORES = 1.0


def autopilot(
    vehicles: Annotated[
        int, typer.Option("--vehicles", min=1, max=1000, metavar="N", help="How many vehicles.")
    ] = 100,
    seconds: Annotated[
        float,
        typer.Option("--seconds", min=1.0, max=3600.0, metavar="S", help="How long to measure."),
    ] = 30.0,
    seed: SeedOption = 0,
    json: JsonOption = False,
) -> int:
    """See `AUTOPILOT_HELP`."""
    import asyncio
    from json import dumps
    from pathlib import Path

    from rich.console import Console

    from sim.bench.autopilot_load import load_as_json, load_as_rich, measure_load

    if not Path("/proc/self/stat").exists():
        problem = "there is no /proc that tells processor time"
        raise InputError(Fault("swarm bench autopilot", "", problem, "run it on Linux"))
    with progress() as tell:
        done = asyncio.run(measure_load(vehicles, seconds, seed, tell))
    if json:
        typer.echo(dumps(load_as_json(done), allow_nan=False))
    else:
        Console(highlight=False).print(load_as_rich(done))
    enough = done.delivered_frac >= _LEAST_DELIVERED_FRAC and done.cores < _MOST_CORES
    return 0 if enough else 1
