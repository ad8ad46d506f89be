"""The command `swarm bench routes`."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from sim.bench.command_line import (
    MarkdownOption,
    SeedsOption,
    check_files,
    each,
    limit_of,
    progress,
    seeds_of,
    show,
    write_file,
)
from swarm.runtime.errors import Fault, InputError, remedy_for_name
from swarm.runtime.options import JsonOption


def routes(
    instances: Annotated[
        Path,
        typer.Option(
            "--instances",
            metavar="DIR",
            help="Folder of instances, and of tables *.csv (file,best_known) that name them.",
            show_default=False,
        ),
    ],
    only: Annotated[
        str | None,
        typer.Option(
            "--only",
            metavar="NAME,…",
            help="Files to search, such as st70.tsp or 'Pr_200_*'. Default: all.",
            show_default=False,
        ),
    ] = None,
    time_limit_s: Annotated[
        str, typer.Option("--time-limit-s", metavar="S", help="Time for each search.")
    ] = "10",
    seeds: SeedsOption = "0,1,2,3,4,5,6,7,8,9",
    methods: Annotated[
        str,
        typer.Option("--methods", metavar="NAME,…", help="Among guided, ortools and vrp-cli."),
    ] = "guided",
    json: JsonOption = False,
    new_best: Annotated[
        Path | None,
        typer.Option(
            "--new-best",
            metavar="FILE.json",
            help="Also write routes that are better than the best known.",
            show_default=False,
        ),
    ] = None,
    plot: Annotated[
        Path | None,
        typer.Option(
            "--plot",
            metavar="FILE",
            help="Draw the gaps, as .png, .svg or .pdf.",
            show_default=False,
        ),
    ] = None,
    out: MarkdownOption = None,
) -> int:
    """Search published instances, and compare with the best values known.

    Reads travelling repairman instances (TSPLIB files) and ones of multiple travelling
    repairmen with profits, whose objectives are special cases of a mission's. Their own rounded
    distances are searched as swarm plan searches a mission, and the published objective is
    reckoned anew from the routes found. With --json the routes are told, for others to check.

    Examples:
        swarm bench routes --instances benchmarks
        swarm bench routes --instances benchmarks --only st70.tsp --time-limit-s 2 --seeds 0,1
        swarm bench routes --instances benchmarks --only '*.tsp' --methods guided,ortools,vrp-cli
        swarm bench routes --instances benchmarks --json
    """
    from json import dumps

    from sim.bench.instances import read_instances
    from sim.bench.plan_report import write_figure
    from sim.bench.route_figure import gaps_figure
    from sim.bench.routes import measure_routes

    limit_s = limit_of("--time-limit-s", time_limit_s)
    all_seeds = seeds_of(seeds)
    names = each("--methods", methods, _method)
    check_files(plot, out, new_best)
    found = read_instances(instances, only)
    with progress() as tell:
        done = measure_routes(found, all_seeds, limit_s, names, tell=tell)
    if plot is not None:
        write_file("--plot", plot, lambda path: write_figure(gaps_figure(done), path))
    if out is not None:
        write_file("--out", out, lambda path: path.write_text(done.as_markdown(), "utf-8"))
    if new_best is not None:
        routes_json = dumps(done.new_best(), indent=1) + "\n"
        write_file("--new-best", new_best, lambda path: path.write_text(routes_json, "utf-8"))
    show(done, json=json)
    return 0


def _method(flag: str, word: str) -> str:
    from sim.bench.route_solvers import METHODS
    from swarm.runtime.extras import MissingExtraError

    if word not in METHODS:
        remedy = remedy_for_name(word, METHODS, "choose among")
        raise InputError(Fault(flag, word, "no such method", remedy))
    if not METHODS[word].is_installed():
        raise MissingExtraError(f"{flag} {word}", "bench")
    return word
