"""The command `swarm bench missions`.

Leaves out: what it does (`sim.bench.missions`).
"""

from __future__ import annotations

from typing import Annotated

import typer

from sim.bench.words import size_of
from sim.uncertainty_options import LossOption, PopupOption
from swarm.options import JsonOption, SeedOption

__all__ = ["MISSIONS_HELP", "missions"]

_LOSS = 0.3
_POPUP = 0.3
MISSIONS_HELP = f"""Fly random missions in virtual time with the agents' real cores.

Each is another mission, planned anew and flown by the greedy rule on an ideal bus, its
coordinator dead. Unless --loss and --popup say otherwise, {_LOSS:.0%} of the UAVs are lost and
{_POPUP:.0%} of the tasks pop up.

\b
Examples:
    swarm bench missions
    swarm bench missions --missions 100 --size 20x100 --jobs 1
    swarm bench missions --loss 0 --popup 0 --json
"""


def missions(
    count: Annotated[
        int, typer.Option("--missions", min=1, max=1_000_000, metavar="N", help="How many.")
    ] = 1000,
    size: Annotated[
        str, typer.Option("--size", metavar="NxM", help="UAVs and tasks of each.")
    ] = "10x50",
    jobs: Annotated[
        int | None,
        typer.Option(
            "--jobs",
            min=1,
            max=1024,
            metavar="N",
            help="Processes that fly them. Default: as many as there are processors.",
            show_default=False,
        ),
    ] = None,
    loss: LossOption = None,
    popup: PopupOption = None,
    seed: SeedOption = 0,
    json: JsonOption = False,
) -> int:
    """See `MISSIONS_HELP`."""
    from json import dumps

    from rich.console import Console
    from rich.progress import Progress

    from sim.bench.missions import (
        Missions,
        measure_missions,
        missions_as_json,
        missions_as_rich,
    )
    from sim.uncertainty import Uncertainty
    from swarm.clock import SystemClock
    from swarm.kernels.lower_level import default_threads

    n_uav, n_task = size_of("--size", size)
    uncertainty = Uncertainty(
        loss=_LOSS if loss is None else loss, popup=_POPUP if popup is None else popup
    )
    which = Missions(n_uav, n_task, range(seed, seed + count), uncertainty)
    console = Console(stderr=True)
    with Progress(console=console, transient=True, disable=not console.is_terminal) as bar:
        flying = bar.add_task("missions", total=count)
        done = measure_missions(
            which,
            jobs or default_threads(),
            SystemClock(),
            lambda flown: bar.advance(flying, flown),
        )
    if json:
        typer.echo(dumps(missions_as_json(done), allow_nan=False))
    else:
        Console(highlight=False).print(missions_as_rich(done))
    return 0
