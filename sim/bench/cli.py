"""The commands of the family `swarm bench`; those about plans and decisions are here."""

from __future__ import annotations

from collections.abc import Collection
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from sim.bench.area_commands import areas
from sim.bench.command_line import (
    LONGEST_S,
    MarkdownOption,
    Reader,
    SeedsOption,
    check_files,
    each,
    limit_of,
    progress,
    seeds_of,
    show,
    size_of,
    sizes_of,
    write_file,
)
from sim.bench.leg_commands import legs
from sim.bench.performance_commands import (
    autopilot,
    bound,
    dashboard,
    flight,
    missions,
    replan,
    turnaround,
)
from sim.bench.robustness_commands import (
    failover,
    flood,
    secure,
)
from sim.bench.route_commands import routes
from sim.bench.scale_commands import scale
from sim.bench.separation_commands import separation
from swarm.runtime.errors import Fault, InputError, remedy_for_name
from swarm.runtime.options import JsonOption, SeedOption
from swarm.scenario.files import resolve_scenario

if TYPE_CHECKING:
    from sim.bench.solvers import MissionSource

_DEFAULT_SIZES = "10x50,50x500"
_FIELD_SIZES = "50x500"
_SCALING_SIZES = "10x50,10x500,50x500,50x2000,100x1000,200x2000,200x5000"
bench = typer.Typer(
    help="Benchmarks, each printing machine, seeds and ratios.",
    rich_markup_mode=None,
    no_args_is_help=True,
)


@bench.callback()
def _family() -> None:
    """Keep the family a family, however many commands it has."""


@bench.command("plan", short_help="Compare planning methods side by side.")
def plan(
    scenario: Annotated[
        Path | None,
        typer.Argument(
            metavar="SCENARIO",
            help="Scenario file, or the name of a shipped one such as table-1.",
            parser=resolve_scenario,
            show_default=False,
        ),
    ] = None,
    sizes: Annotated[
        str | None,
        typer.Option(
            "--sizes",
            metavar="NxM,…",
            help=f"UAVs and tasks of random missions. Default: {_DEFAULT_SIZES}.",
            show_default=False,
        ),
    ] = None,
    time_limit_s: Annotated[
        str,
        typer.Option("--time-limit-s", metavar="S,…", help="Time for each method; one or several."),
    ] = "10",
    seeds: SeedsOption = "0,1,2",
    methods: Annotated[
        str | None,
        typer.Option(
            "--methods",
            metavar="NAME,…",
            help="Which to compare. Default: all.",
            show_default=False,
        ),
    ] = None,
    long_run_s: Annotated[
        float | None,
        typer.Option(
            "--long-run-s",
            min=0.01,
            max=LONGEST_S,
            metavar="S",
            help="Also run guided for this long, and compare with that.",
            show_default=False,
        ),
    ] = None,
    field: Annotated[
        bool,
        typer.Option(
            "--field",
            help="Random missions with batteries, bases, zones and windows, 50 × 500 by default.",
        ),
    ] = False,
    scaling: Annotated[
        bool,
        typer.Option(
            "--scaling",
            help="Instead: time and memory of guided and greedy from 10 to 200 UAVs and 50 to "
            "5000 tasks, with the first of the seeds.",
        ),
    ] = False,
    json: JsonOption = False,
    plot: Annotated[
        Path | None,
        typer.Option(
            "--plot",
            metavar="FILE",
            help="Draw value against time limit or size, as .png, .svg or .pdf.",
            show_default=False,
        ),
    ] = None,
    out: MarkdownOption = None,
) -> int:
    """Compare planning methods side by side, each with the same time.

    Without SCENARIO and --sizes: random missions of 10 × 50 and 50 × 500.

    Examples:
        swarm bench plan
        swarm bench plan --sizes 20x100 --time-limit-s 1,3,10 --plot value.png
        swarm bench plan valley-survey --methods guided,cbba,exact --json
        swarm bench plan hayfield --methods guided,greedy,value-per-time
        swarm bench plan --field --methods guided,ortools-warm --time-limit-s 10,60
        swarm bench plan --scaling --out scaling.md
    """
    from sim.bench.plan_report import (
        PlanReport,
        comparison_figure,
        comparison_grids,
        scaling_figure,
        scaling_grid,
        write_figure,
    )
    from sim.bench.plans import measure_plans
    from sim.bench.solvers import MissionSource, methods_for

    limits_s = each("--time-limit-s", time_limit_s, limit_of)
    all_seeds = seeds_of(seeds)
    if field and (scenario is not None or scaling):
        other = "SCENARIO" if scenario is not None else "--scaling"
        problem = f"it draws random missions, and compares methods; {other} does not go with it"
        raise InputError(Fault("--field", "", problem, "leave one of them out"))
    field = field or _in_field(scenario, scaling=scaling)
    known = methods_for(MissionSource(field=field))
    default_methods = "guided,greedy" if scaling else ",".join(known)
    names = each("--methods", methods or default_methods, _one_of(known))
    check_files(plot, out)
    if scaling:
        limits_s, all_seeds = limits_s[:1], all_seeds[:1]
    default_sizes = _FIELD_SIZES if field else _SCALING_SIZES if scaling else _DEFAULT_SIZES
    sources = _sources(scenario, sizes, default_sizes, field=field)
    if methods is not None and any(name.startswith("ortools") for name in names):
        from sim.study.baselines.ortools_routing import require_installed

        require_installed()

    with progress() as tell:
        done = measure_plans(sources, names, limits_s, all_seeds, long_run_s=long_run_s, tell=tell)
    grids = [scaling_grid(done)] if scaling else comparison_grids(done)
    report = PlanReport(done.machine, done, grids)
    if plot is not None:
        figure = scaling_figure(done) if scaling else comparison_figure(done)
        write_file("--plot", plot, lambda path: write_figure(figure, path))
    if out is not None:
        write_file("--out", out, lambda path: path.write_text(report.as_markdown(), "utf-8"))
    show(report, json=json)
    return 0


@bench.command("decide", short_help="Time one online decision of each rule.")
def decide(
    size: Annotated[
        str, typer.Option("--size", metavar="NxM", help="UAVs and tasks of the random mission.")
    ] = "50x500",
    seed: SeedOption = 0,
    json: JsonOption = False,
) -> int:
    """Time one online decision of each rule.

    A whole random mission is decided, task by task, and each decision timed.

    Examples:
        swarm bench decide
        swarm bench decide --size 10x50 --json
    """
    from sim.bench.decisions import measure_decisions
    from swarm.runtime.clock import SystemClock

    n_uav, n_task = size_of("--size", size)
    show(measure_decisions(n_uav, n_task, seed, SystemClock()), json=json)
    return 0


bench.command("bound", short_help="Measure how close guided is proven.")(bound)
bench.command("routes", short_help="Search published instances.")(routes)
bench.command("areas", short_help="Cover areas, beside a fixed split.")(areas)
bench.command("separation", short_help="Measure what keeping apart costs.")(separation)
bench.command("failover", short_help="Measure fleets in trouble.")(failover)
bench.command("flood", short_help="Fly while a hostile peer floods the bus.")(flood)
bench.command("missions", short_help="Fly many missions in virtual time.")(missions)
bench.command("flight", short_help="Fly one large mission in virtual time.")(flight)
bench.command("replan", short_help="Time re-plans of running missions.")(replan)
bench.command("dashboard", short_help="Measure what a dashboard costs.")(dashboard)
bench.command("autopilot", short_help="Measure simulated vehicles.")(autopilot)
bench.command("secure", short_help="Measure what keys and encryption cost.")(secure)
bench.command("turnaround", short_help="Time from each arrival to the next target.")(turnaround)
bench.command("legs", short_help="Time of legs flown, beyond length / speed.")(legs)
bench.command("scale", short_help="Measure what each UAV more costs.")(scale)


def _in_field(scenario: Path | None, *, scaling: bool) -> bool:
    """Whether a scenario has the field's constraints, and so what it is compared by.

    Raises:
        InputError: it has, and sizes of plain missions are asked for beside it.
    """
    from coordinator.planner.field_plan import is_field
    from swarm.scenario import load_scenario, require_plain

    if scenario is None:
        return False
    mission = load_scenario(scenario)
    if is_field(mission) and not scaling:
        return True
    require_plain(mission, "swarm bench")
    return False


def _sources(
    scenario: Path | None, sizes: str | None, default: str, *, field: bool
) -> list[tuple[str, MissionSource]]:
    """Cases by name, the scenario first."""
    from sim.bench.results import size_name
    from sim.bench.solvers import MissionSource
    from swarm.scenario import load_scenario

    found: list[tuple[str, MissionSource]] = []
    if scenario is not None:
        source = MissionSource(scenario=str(scenario.resolve()), field=field)
        found.append((load_scenario(scenario).name, source))
    if scenario is None or sizes is not None:
        for n_uav, n_task in sizes_of(sizes or default):
            source = MissionSource(n_uav=n_uav, n_task=n_task, field=field)
            found.append((size_name(n_uav, n_task), source))
    return found


def _one_of(known: Collection[str]) -> Reader[str]:
    """Reads names of methods."""

    def read(flag: str, word: str) -> str:
        if word not in known:
            remedy = remedy_for_name(word, known, "choose among")
            raise InputError(Fault(flag, word, "no such method", remedy))
        return word

    return read
