"""Commands of the coordinator.

Leaves out: what they do (coordinator.planner, coordinator.plan_report, coordinator.plot).
"""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Annotated

import typer

from swarm.errors import Fault, InputError
from swarm.options import JsonOption, ScenarioArgument, SeedOption, TimeLimitOption

__all__ = ["plan"]


def plan(
    scenario: ScenarioArgument,
    method: Annotated[
        str,
        typer.Option(
            metavar="METHOD",
            help="greedy or lookahead: how UAVs decide; exact: the proven best lists.",
        ),
    ] = "greedy",
    seed: SeedOption = 0,
    time_limit_s: TimeLimitOption = None,
    json: JsonOption = False,
    plot: Annotated[
        Path | None,
        typer.Option(
            metavar="FILE",
            help="Draw the lists over the map, as .png, .svg or .pdf.",
            show_default=False,
        ),
    ] = None,
) -> int:
    """Compute the priority sequence, and the task lists it leads to.

    Tasks that appear later are unknown to a plan. The same seed gives the same plan,
    unless --time-limit-s cuts the search short.

    Examples:
        swarm plan table-1
        swarm plan valley-survey --plot lists.png
        swarm plan table-1 --method exact --json
    """
    from json import dumps

    from coordinator.plan_report import plan_as_json, plan_table
    from coordinator.planner.exact import ProblemTooLargeError
    from coordinator.planner.plan import make_plan
    from coordinator.planner.stop import after_time
    from swarm.clock import SystemClock
    from swarm.scenario import load_scenario

    _check_plan_options(method, plot)
    mission = load_scenario(scenario)
    clock = SystemClock()
    stop = None if time_limit_s is None else after_time(clock, time_limit_s)
    try:
        result = make_plan(mission, method, clock=clock, seed=seed, stop=stop)
    except ProblemTooLargeError as error:
        remedy = "choose --method greedy or lookahead"
        raise InputError(Fault(str(scenario), "", str(error), remedy)) from error
    if plot is not None:
        from coordinator.plot import draw_plan

        try:
            draw_plan(mission, result, plot)
        except OSError as error:
            problem = f"cannot write {plot}: {error.strerror or error}"
            raise InputError(Fault("--plot", "", problem, "name a file that can be")) from error
        print(f"drawn: {plot}", file=sys.stderr)
    if json:
        print(dumps(plan_as_json(result), allow_nan=False))
    else:
        from rich.console import Console

        Console(highlight=False).print(plan_table(mission, result))
    return 0


def _check_plan_options(method: str, plot: Path | None) -> None:
    """Refuse what cannot be done before any work is done."""
    from coordinator.planner.plan import METHODS
    from coordinator.plot import PLOT_SUFFIXES

    faults = []
    if method not in METHODS:
        problem = "not available yet" if method == "guided" else "no such method"
        methods = ", ".join(METHODS)
        faults.append(Fault("--method", method, problem, f"choose one of {methods}"))
    if plot is not None and plot.suffix.lower() not in PLOT_SUFFIXES:
        problem = f"no picture is called {plot.suffix!r}" if plot.suffix else "it has no suffix"
        remedy = f"end it in {', '.join(PLOT_SUFFIXES)}"
        faults.append(Fault("--plot", str(plot), problem, remedy))
    if faults:
        raise InputError(*faults)
