"""The command `swarm bench scale`."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from sim.bench.command_line import (
    LONGEST_S,
    MarkdownOption,
    check_files,
    each,
    integer,
    progress,
    require_proc,
    show,
    write_file,
)
from sim.options import MethodOption
from swarm.protocol.timing import LinkKind
from swarm.runtime.options import JsonOption, LinkOption, SeedOption

if TYPE_CHECKING:
    from sim.bench.scale import ScaleSettings


def scale(
    sizes: Annotated[
        str, typer.Option("--sizes", metavar="N,…", help="UAVs of the fleets, in this order.")
    ] = "10,50,100,200",
    watch_s: Annotated[
        float,
        typer.Option(
            "--watch-s", min=1.0, max=LONGEST_S, metavar="S", help="How long each fleet is watched."
        ),
    ] = 30.0,
    start_limit_s: Annotated[
        float,
        typer.Option(
            "--start-limit-s",
            min=1.0,
            max=LONGEST_S,
            metavar="S",
            help="After so long a fleet that is not in the air is given up.",
        ),
    ] = 300.0,
    method: MethodOption = "greedy",
    link: LinkOption = LinkKind.NORMAL,
    routers: Annotated[
        int, typer.Option("--routers", min=1, max=8, metavar="N", help="So many, linked.")
    ] = 1,
    agents_per_process: Annotated[
        int,
        typer.Option("--agents-per-process", min=1, max=100, metavar="N", help="See swarm run."),
    ] = 1,
    separation_m: Annotated[
        float | None,
        typer.Option(
            "--separation-m",
            min=1.0,
            max=50.0,
            metavar="M",
            help="Keep them so far apart, in layers within 30 to 110 m; else each has its own.",
            show_default=False,
        ),
    ] = None,
    spacing_m: Annotated[
        float,
        typer.Option(
            "--spacing-m",
            min=10.0,
            max=1000.0,
            metavar="M",
            help="One task on each square of that side, six for each UAV: 91 m are 20 UAVs/km².",
        ),
    ] = 40.0,
    seed: SeedOption = 0,
    json: JsonOption = False,
    plot: Annotated[
        Path | None,
        typer.Option(
            "--plot", metavar="FILE", help="Draw it, as .png, .svg or .pdf.", show_default=False
        ),
    ] = None,
    out: MarkdownOption = None,
) -> int:
    """Measure what each UAV more costs this machine, in fleets of real processes.

    Each fleet surveys at wall speed with simulated autopilots, is watched for a while in the
    midst of its mission and then ended: time to start, memory and processor time of its
    processes, messages by kind, from an arrival to the next target. A fleet too large for this
    machine is told so first, and flown all the same. Needs Linux, and a quiet machine for times.

    Examples:
        swarm bench scale
        swarm bench scale --sizes 10,50 --watch-s 10 --json
        swarm bench scale --sizes 10,100,200 --agents-per-process 25
        swarm bench scale --sizes 10,100,200 --agents-per-process 25 --separation-m 6
        swarm bench scale --sizes 100 --agents-per-process 50 --separation-m 6 --spacing-m 91
        swarm bench scale --plot scale.svg --out scale.md
    """
    from sim.bench.plan_report import write_figure
    from sim.bench.scale import ScaleSettings, measure_scale
    from sim.bench.scale_figure import scale_figure

    require_proc("scale")
    fleet_size = integer(1, 1000, "no fleet size", "give numbers within 1..1000")
    check_files(plot, out)
    settings = ScaleSettings(
        sizes=tuple(each("--sizes", sizes, fleet_size)),
        watch_s=watch_s,
        start_limit_s=start_limit_s,
        method=method,
        link=link,
        routers=routers,
        agents_per_process=agents_per_process,
        separation_m=separation_m,
        spacing_m=spacing_m,
        seed=seed,
    )
    _warn_of_large(settings)
    with progress() as tell:
        done = measure_scale(settings, tell)
    if plot is not None:
        write_file("--plot", plot, lambda path: write_figure(scale_figure(done), path))
    if out is not None:
        write_file("--out", out, lambda path: path.write_text(done.as_markdown(), "utf-8"))
    show(done, json=json)
    return 0


def _warn_of_large(settings: ScaleSettings) -> None:
    """Say which fleets this machine is too small for, before anything starts."""
    from sim.fleet.capacity import memory_bytes, too_large, usable_cores

    room, per_process = (usable_cores(), memory_bytes()), settings.agents_per_process
    apart = settings.separation_m is not None
    for n_uav in settings.sizes:
        reason = too_large(n_uav, *room, per_process, keeps_apart=apart)
        if reason is not None:
            typer.echo(f"warning: {reason}", err=True)
