"""The command `swarm bench separation`."""

from __future__ import annotations

from typing import Annotated

import typer

from sim.bench.command_line import SeedsOption, each, integer, progress, seeds_of, show
from swarm.runtime.options import JsonOption

_DENSITY = integer(2, 200, "is no number of UAVs", "write a whole number from 2 to 200")


def separation(
    densities: Annotated[
        str, typer.Option("--densities", metavar="N,…", help="UAVs over a square kilometre.")
    ] = "2,5,10,20,40",
    seeds: SeedsOption = "0,1,2,3,4,5,6,7,8,9",
    separation_m: Annotated[
        float,
        typer.Option("--separation-m", min=0.1, max=1000.0, metavar="M", help="To be kept."),
    ] = 10.0,
    position_error_m: Annotated[
        float,
        typer.Option(
            "--position-error-m",
            min=0.0,
            max=100.0,
            metavar="M",
            help="Their standard deviation.",
        ),
    ] = 0.0,
    json: JsonOption = False,
) -> int:
    """What keeping a distance costs in J, over density, in virtual time.

    Each mission is flown with the separation and without it. Exit status 1 if any pair came nearer
    than asked, less six standard deviations of a place.

    Examples:
        swarm bench separation
        swarm bench separation --densities 20 --seeds 0,1,2 --position-error-m 1
        swarm bench separation --json
    """
    from sim.bench.separation import measure_separation
    from swarm.runtime.clock import SystemClock

    fleets = each("--densities", densities, _DENSITY)
    with progress() as tell:
        done = measure_separation(
            fleets, seeds_of(seeds), separation_m, position_error_m, SystemClock(), tell=tell
        )
    show(done, json=json)
    return 1 if any(row.too_near for row in done.rows) else 0
