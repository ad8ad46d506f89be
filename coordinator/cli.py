"""Commands of the coordinator."""

from __future__ import annotations

import contextlib
import signal
import sys
from collections.abc import Callable, Iterator
from dataclasses import replace
from pathlib import Path
from types import FrameType
from typing import TYPE_CHECKING, Annotated

import typer

from coordinator.plan_options import USUAL_FIRMWARE, check_plan_options
from coordinator.planner.options import method_names, online_method_names
from swarm.bus.connection import DEFAULT_CONNECTION, ConnectionOptions
from swarm.protocol.timing import Timing
from swarm.runtime.errors import EXIT_INTERRUPTED, Fault, InputError
from swarm.runtime.log import LogFormat, LogLevel
from swarm.runtime.option_groups import with_options
from swarm.runtime.options import (
    BoundTimeOption,
    CheckOption,
    JsonOption,
    LifelineOption,
    LogFormatOption,
    LogLevelOption,
    ScenarioArgument,
    SeedOption,
    SpeedupOption,
    StateOption,
    TimeLimitOption,
    complete_from,
)

if TYPE_CHECKING:
    from contextlib import AbstractAsyncContextManager

    from rich.status import Status

    from coordinator.core.lifecycle import MakePlan
    from coordinator.daemon import CoordinatorProcess
    from coordinator.planner.options import ShouldStop
    from swarm.model import Mission, Plan
    from swarm.protocol.messages import Snapshot
    from swarm.runtime.store import Store


def plan(
    scenario: ScenarioArgument,
    method: Annotated[
        str,
        typer.Option(
            metavar="METHOD",
            autocompletion=complete_from(method_names),
            help="greedy, lookahead, nearest or value-per-time: how UAVs decide; guided: "
            "optimised lists; exact: the proven best lists.",
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
    export: Annotated[
        Path | None,
        typer.Option(
            metavar="DIR",
            help="Write every UAV's list there as a QGroundControl plan, MISSION.UAV.plan.",
            show_default=False,
        ),
    ] = None,
    firmware: Annotated[
        str,
        typer.Option(metavar="ardupilot|px4", help="What the exported plans are to be flown by."),
    ] = USUAL_FIRMWARE,
    bound: Annotated[
        bool,
        typer.Option(
            "--bound/--no-bound",
            help="Where the optimum is not proven at once, spend some seconds on an upper bound "
            "on J, which may prove it.",
        ),
    ] = True,
    bound_s: BoundTimeOption = None,
) -> int:
    """Compute the priority sequence, and the task lists it leads to.

    Of a scenario of schema 2 also the schedule: swaps, waits, ways home, and what is left out.
    Tasks that appear later are unknown to a plan. The same seed gives the same plan,
    unless --time-limit-s cuts the search short. That limit holds for all but drawing, exporting
    and what --bound-s adds: reading, searching and the bound. With exact the search is the proof,
    and --bound-s what follows where it was cut short. Ctrl-C ends the search with the
    best so far.

    Examples:
        swarm plan table-1
        swarm plan valley-survey --plot lists.png
        swarm plan valley-survey --method guided --export plans
        swarm plan table-1 --method exact --json
        swarm plan valley-survey --method guided --time-limit-s 10 --bound-s 60
        swarm plan reservoir-inspection --method guided --plot map.png
    """
    from swarm.runtime.clock import SystemClock

    clock = SystemClock()
    begin_s = clock.now_s()

    from json import dumps

    from coordinator.core.heights import height_warnings
    from coordinator.mission_view.area_report import areas_as_json
    from coordinator.planner.exact import ProblemTooLargeError
    from coordinator.planner.options import BOUND_S, after_time, first_of, whole_limit
    from coordinator.planner.plan import make_plan
    from coordinator.planner.plan_report import plan_as_json, plan_table
    from swarm.model.layers import layers_over
    from swarm.scenario import load_scenario

    check_plan_options(method, plot, firmware, None if bound else bound_s)
    mission = load_scenario(scenario)
    for warning in height_warnings(mission, layers_over(mission.terrain)):
        print(f"warning: {warning}", file=sys.stderr)
    if export is not None:
        from coordinator.export import require_exportable, require_origin

        require_exportable(mission, str(scenario))
        require_origin(mission, str(scenario))
    try:
        with _searching() as (interrupted, progress, proving):
            whole_s, kept_frac = whole_limit(time_limit_s, bound_s, proves=method == "exact")
            limit = None if whole_s is None else after_time(clock, whole_s, begin_s)
            result = make_plan(
                mission,
                method,
                clock=clock,
                seed=seed,
                stop=interrupted if limit is None else first_of(limit, interrupted),
                progress=progress,
                bound_progress=proving,
                bound_s=(bound_s or BOUND_S) if bound else None,
                bound_frac=kept_frac,
            )
            told_to_stop = interrupted(0)
    except ProblemTooLargeError as error:
        remedy = "choose --method guided, greedy or lookahead"
        raise InputError(Fault(str(scenario), "", str(error), remedy)) from error
    if plot is not None:
        _draw(plot, mission, result)
    if export is not None:
        _export(export, mission, result, firmware)
    if json:
        told = plan_as_json(result) | areas_as_json(mission, result.completion_s)
        print(dumps(told, allow_nan=False))
    else:
        from rich.console import Console

        Console(highlight=False).print(plan_table(mission, result))
    return EXIT_INTERRUPTED if told_to_stop else 0


def _draw(picture: Path, mission: Mission, made: Plan) -> None:
    from coordinator.plot import draw_plan

    try:
        draw_plan(mission, made, picture)
    except OSError as error:
        problem = f"cannot write {picture}: {error.strerror or error}"
        raise InputError(Fault("--plot", "", problem, "name a file that can be")) from error
    print(f"drawn: {picture}", file=sys.stderr)


def _export(folder: Path, mission: Mission, made: Plan, firmware: str) -> None:
    """Write the lists as plans, and say which."""
    from coordinator.export import ExportFirmware, write_plans

    try:
        written = write_plans(folder, mission, made, ExportFirmware(firmware))
    except OSError as error:
        problem = f"cannot write into {folder}: {error.strerror or error}"
        raise InputError(Fault("--export", "", problem, "name a folder that can be")) from error
    idle = [uav for uav, route in made.routes.items() if not route]
    without = f"; none for {', '.join(idle)}, without tasks" if idle else ""
    plans = "1 plan" if len(written.files) == 1 else f"{len(written.files)} plans"
    print(f"exported: {plans} into {folder}{without}", file=sys.stderr)
    if written.unfenced:
        zones = ", ".join(written.unfenced)
        told = "UAVs may fly above or below them"
        print(f"note: not in the geofence of every plan, as {told}: {zones}", file=sys.stderr)


def _status_line() -> contextlib.AbstractContextManager[Status | None]:
    """A line on standard error that can be updated; nothing off a terminal."""
    if not sys.stderr.isatty():
        return contextlib.nullcontext()
    from rich.console import Console

    return Console(stderr=True).status("planning")


@contextlib.contextmanager
def _searching() -> Iterator[
    tuple[Callable[[float], bool], Callable[[int, float], None], Callable[[float], None]]
]:
    """Whether Ctrl-C was pressed, and places to show how far a search and a proof are.

    The first Ctrl-C asks for the best so far; a second one interrupts. Progress shows on a
    terminal only.
    """
    pressed, best = False, 0.0

    def on_interrupt(_number: int, _frame: FrameType | None) -> None:
        nonlocal pressed
        pressed = True
        signal.signal(signal.SIGINT, before)

    before = signal.getsignal(signal.SIGINT)
    signal.signal(signal.SIGINT, on_interrupt)
    try:
        with _status_line() as show:

            def progress(evaluations: int, worth: float) -> None:
                nonlocal best
                best = worth
                if show is not None:
                    show.update(f"planning: {evaluations} tried, best J {worth:.2f} value·s")

            def proving(bound: float) -> None:
                if show is not None:
                    gap = f", gap {100.0 * (bound / best - 1.0):.2f} %" if best > 0.0 else ""
                    show.update(f"proving: no lists have more than {bound:.2f} value·s{gap}")

            yield lambda _: pressed, progress, proving
    finally:
        signal.signal(signal.SIGINT, before)


@with_options
def coordinator(
    scenario: ScenarioArgument,
    method: Annotated[
        str,
        typer.Option(
            "--method",
            metavar="METHOD",
            help="Decision rule: guided, greedy, lookahead, nearest or value-per-time.",
            autocompletion=complete_from(online_method_names),
        ),
    ] = "guided",
    seed: SeedOption = 0,
    start_timeout_s: Annotated[
        float,
        typer.Option(
            "--start-timeout-s",
            min=1.0,
            metavar="S",
            help="UAVs that are not airborne by then are given up; mission seconds, or wall "
            "seconds where the mission runs faster.",
        ),
    ] = 120.0,
    hover_s: Annotated[
        float,
        typer.Option(
            "--hover-s",
            min=1.0,
            metavar="S",
            help="How long vehicles in the air wait before the start for one that does not get "
            "ready; mission seconds, or wall seconds where the mission runs faster.",
        ),
    ] = Timing().hover_s,
    lowest_layer_m: Annotated[
        float,
        typer.Option(
            "--lowest-layer-m",
            min=1.0,
            metavar="M",
            help="Height above the tasks at which the first UAV flies.",
        ),
    ] = 10.0,
    layer_spacing_m: Annotated[
        float,
        typer.Option(
            "--layer-spacing-m",
            min=0.0,
            metavar="M",
            help="Every further UAV flies this much higher than the one before.",
        ),
    ] = 3.0,
    state: StateOption = None,
    standby: Annotated[
        bool,
        typer.Option(
            "--standby",
            help="Watch the coordinator that is there, and take its place when it is lost.",
        ),
    ] = False,
    seat: ConnectionOptions = DEFAULT_CONNECTION,
    speedup: SpeedupOption = 1.0,
    dashboard: Annotated[
        str | None,
        typer.Option(
            "--dashboard",
            metavar="[ADDRESS:]PORT",
            help="Also show the mission in a browser, by a process of its own that ends with "
            "this one; 0: any port that is free. See swarm dashboard.",
            show_default=False,
        ),
    ] = None,
    json: JsonOption = False,
    check: CheckOption = False,
    lifeline: LifelineOption = False,
    log_level: LogLevelOption = LogLevel.INFO,
    log_format: LogFormatOption = LogFormat.AUTO,
) -> int:
    """Plan a mission, brief the agents, and start and end it.

    Once it has started, the fleet finishes without the coordinator. Started anew, it takes
    charge of the mission that is being flown, as far as agents or its own --state know it.
    With --json the plan is printed as `swarm plan --json` prints it. Exit status 0: every
    task was done.

    Examples:
        swarm coordinator table-1
        swarm coordinator valley-survey --keys keys/coordinator --state /var/lib/peckorder
        swarm coordinator valley-survey --keys keys/coordinator-2 --standby
        swarm coordinator valley-survey --dashboard 8080
    """
    from coordinator.core.active import CoordinatorCore
    from coordinator.core.heights import height_warnings
    from coordinator.core.publication import unsayable
    from coordinator.daemon import CoordinatorProcess
    from coordinator.dashboard.access import parse_serve_address
    from coordinator.dashboard.supervisor import supervised_dashboard
    from coordinator.planner.plan import check_online_method
    from swarm.bus.zenoh_bus import open_zenoh_bus
    from swarm.identity import Role
    from swarm.model.ids import COORDINATOR
    from swarm.model.layers import FlightLayers
    from swarm.protocol.seal import seal_of
    from swarm.runtime.clock import ScaledClock, incarnation
    from swarm.runtime.log import configure_logging, get_logger, identify
    from swarm.runtime.store import Store
    from swarm.scenario import load_scenario

    configure_logging(log_level, log_format)
    check_online_method(method)
    network = seat.network
    mission = load_scenario(scenario)
    config = seat.config(mission=mission.name, roles=(Role.COORDINATOR,))
    timing = network.timing.scaled(speedup)
    timing = replace(timing, hover_s=hover_s * max(1.0, speedup))

    identify(mission=mission.name)
    layers = FlightLayers(lowest_layer_m, layer_spacing_m)
    remedy = "leave some out, or make several of it"
    if faults := [Fault(str(scenario), "", what, remedy) for what in unsayable(mission, layers)]:
        raise InputError(*faults)
    for warning in height_warnings(mission, layers):
        get_logger(COORDINATOR).warning(warning)

    def core(memory: Snapshot | None, memory_age_s: float) -> CoordinatorCore:
        life = incarnation()
        identify(incarnation=life)
        return CoordinatorCore(
            mission,
            method=method,
            seed=seed,
            incarnation=life,
            timing=timing,
            start_timeout_s=start_timeout_s * max(1.0, speedup),
            layers=layers,
            memory=memory,
            memory_age_s=memory_age_s,
        )

    place = None if dashboard is None else parse_serve_address(dashboard, must_be_free=False)
    page = supervised_dashboard(place, mission.name, seat, speedup=speedup)
    if check:
        return 0
    for line in () if place is None else place.lines:
        print(line, file=sys.stderr)
    store = None if state is None else Store(state, mission.name, COORDINATOR, speedup=speedup)
    service = CoordinatorProcess(
        mission=mission,
        make_core=core,
        make_plan=_printed_plan if json else _planned,
        open_bus=lambda: open_zenoh_bus(config),
        clock=ScaledClock(speedup),
        timing=timing,
        answer_s=network.answer_s,
        store=store,
        seal=seal_of(config.identity),
    )
    return _serve(service, page, store, standby=standby, lifeline=lifeline)


def _planned(wanted: MakePlan, unwanted: ShouldStop) -> Plan:
    from coordinator.planner.plan import make_plan
    from swarm.runtime.clock import SystemClock

    return make_plan(
        wanted.mission,
        wanted.method,
        clock=SystemClock(),
        seed=wanted.seed,
        stop=unwanted,
        rates=wanted.rates,
    )


def _printed_plan(wanted: MakePlan, unwanted: ShouldStop) -> Plan:
    """The same, printed unless nobody wants it any more."""
    from json import dumps

    from coordinator.planner.plan_report import plan_as_json

    made = _planned(wanted, unwanted)
    if not unwanted(0.0):
        print(dumps(plan_as_json(made), allow_nan=False), flush=True)
    return made


def _serve(
    service: CoordinatorProcess,
    page: AbstractAsyncContextManager[object],
    store: Store | None,
    *,
    standby: bool,
    lifeline: bool,
) -> int:
    """Work to the end, and close the store; the exit status of the command."""
    import asyncio

    from swarm.runtime.process import run_until_stopped

    try:
        work = _work(service, page, standby=standby)
        return asyncio.run(run_until_stopped(work, lifeline=lifeline))
    finally:
        if store is not None:
            store.close()


async def _work(
    service: CoordinatorProcess, page: AbstractAsyncContextManager[object], *, standby: bool
) -> int:
    """Coordinate, or wait until it is wanted; with the dashboard, if there is one."""
    from swarm.runtime.process import SERVICE_NOTIFIER

    async with page:
        if standby:
            status = await service.stand_by()
        else:
            status, stood_down = await service.coordinate()
            if stood_down is not None:
                print(f"{stood_down}; add --standby to wait for its loss", file=sys.stderr)
    # Whoever supervises it must not take a mission's end for a failure, and fly it again.
    return 0 if SERVICE_NOTIFIER.supervised else status
