"""The command `swarm bench areas`."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from sim.bench.command_line import (
    LONGEST_S,
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
from swarm.scenario.files import resolve_scenario

_SCENARIO = "hayfield"
_DEFAULT_METHODS = "guided,strips,strips-relaunched,ortools,ortools-makespan"


def areas(
    scenario: Annotated[
        Path | None,
        typer.Argument(
            metavar="[SCENARIO]",
            help=f"Scenario file, or the name of a shipped one; default: {_SCENARIO}.",
            parser=resolve_scenario,
            show_default=False,
        ),
    ] = None,
    time_limit_s: Annotated[
        str, typer.Option("--time-limit-s", metavar="S", help="Time for each search of guided.")
    ] = "10",
    ortools_s: Annotated[
        float,
        typer.Option(
            "--ortools-s", min=0.01, max=LONGEST_S, metavar="S", help="The same for OR-Tools."
        ),
    ] = 60.0,
    seeds: SeedsOption = "0,1,2,3,4,5,6,7,8,9",
    methods: Annotated[
        str,
        typer.Option(
            "--methods",
            metavar="NAME,…",
            help="Among guided, strips, strips-relaunched, ortools and ortools-makespan; the last "
            "two also from value-per-time's lists: ortools-warm, ortools-makespan-warm.",
        ),
    ] = _DEFAULT_METHODS,
    json: JsonOption = False,
    plot: Annotated[
        Path | None,
        typer.Option(
            "--plot",
            metavar="FILE",
            help="Draw coverage over time, as .png, .svg or .pdf.",
            show_default=False,
        ),
    ] = None,
    out: MarkdownOption = None,
) -> int:
    """Cover areas by our lists, by a fixed split into strips and by OR-Tools' lists.

    How soon 99.5 % of what may be covered is, and the mean coverage until all are through:
    undisturbed, and with one UAV lost at random. Then our agents fly in virtual time, and of the
    split the lost one's strips are flown by whoever is first through with the own ones: straight
    on, or (strips-relaunched) from a base with a new battery, as ground stations need it.

    Examples:
        swarm bench areas
        swarm bench areas field.toml --seeds 0,1,2 --time-limit-s 3 --ortools-s 20
        swarm bench areas --methods guided,strips --plot coverage.png
        swarm bench areas --json
    """
    from sim.bench.area_figure import areas_figure
    from sim.bench.area_methods import SearchTimes
    from sim.bench.areas import measure_areas
    from sim.bench.plan_report import write_figure
    from swarm.runtime.clock import SystemClock
    from swarm.scenario import load_scenario

    times = SearchTimes(limit_of("--time-limit-s", time_limit_s), ortools_s)
    all_seeds = seeds_of(seeds)
    names = each("--methods", methods, _method)
    check_files(plot, out)
    mission = load_scenario(scenario or resolve_scenario(_SCENARIO))
    with progress() as tell:
        done = measure_areas(mission, all_seeds, names, times, SystemClock(), tell=tell)
    if plot is not None:
        write_file("--plot", plot, lambda path: write_figure(areas_figure(done), path))
    if out is not None:
        write_file("--out", out, lambda path: path.write_text(done.as_markdown(), "utf-8"))
    show(done, json=json)
    return 0


def _method(flag: str, word: str) -> str:
    from sim.bench.area_methods import METHODS

    if word not in METHODS:
        remedy = remedy_for_name(word, METHODS, "choose among")
        raise InputError(Fault(flag, word, "no such method", remedy))
    return word
