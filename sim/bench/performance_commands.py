"""Commands of `swarm bench`: `turnaround`, `autopilot`, `dashboard`, `missions`, `flight`, `replan`
and `bound`.

They measure how long things take, how much one process carries, and how much is proven.
"""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from sim.bench.command_line import (
    LONGEST_S,
    SeedsOption,
    SizesOption,
    ValleyArgument,
    check_files,
    each,
    integer,
    launch_options,
    progress,
    require_proc,
    seeds_of,
    show,
    size_of,
    sizes_of,
    write_file,
)
from sim.options import ChanceOptions
from swarm.runtime.option_groups import option_of
from swarm.runtime.options import JsonOption, SeedOption, SpeedupOption
from swarm.scenario.files import resolve_scenario


def turnaround(
    scenario: ValleyArgument = None,
    rounds: Annotated[
        int, typer.Option("--rounds", min=1, max=1000, metavar="N", help="Flights.")
    ] = 1,
    speedup: SpeedupOption = 1.0,
    autopilot: Annotated[
        str,
        typer.Option(
            "--autopilot",
            metavar="sim|sim-px4|ardupilot|px4",
            help="What flies; see swarm run. The ratio is of ideal vehicles with sim ones only.",
        ),
    ] = "sim",
    command: Annotated[
        str | None,
        typer.Option(
            "--command",
            metavar="reposition|mission",
            help="How vehicles are commanded.",
            show_default=False,
        ),
    ] = None,
    position_rate_hz: Annotated[
        float,
        typer.Option(
            "--position-rate-hz",
            min=1.0,
            max=200.0,
            metavar="HZ",
            help="Position reports of each autopilot per wall second; half an interval is "
            "about what an arrival is seen late.",
        ),
    ] = 20.0,
    seed: SeedOption = 0,
    json: JsonOption = False,
) -> int:
    """Time from each arrival, or end of a service, to the next target sent.

    Flies a scenario with real processes: what each agent's process takes to send its vehicle
    on, and the makespan beside the plan's. Exit status 0: every task was done.

    At wall speed valley-survey takes about seven minutes. A speed-up saves time, but has as
    many turnarounds and messages in less of it: then processes wait for processors too.

    Examples:
        swarm bench turnaround
        swarm bench turnaround --speedup 4 --rounds 3
        swarm bench turnaround --command mission --json
    """
    import os
    from dataclasses import replace

    from sim.bench.turnaround import measure_turnarounds
    from sim.fleet.autopilots import parse_autopilots
    from sim.fleet.firmware import SitlFirmware
    from sim.fleet.layout import BusKind
    from sim.fleet.passthrough import PassthroughOptions, parse_command_styles
    from swarm.model.mission import kinds_of
    from swarm.scenario import load_scenario, require_plain

    path = scenario or resolve_scenario("valley-survey")
    mission = load_scenario(path)
    require_plain(mission, "swarm bench")
    uavs = [uav.id for uav in mission.uavs]
    autopilots = parse_autopilots(autopilot, uavs, None, os.environ, kinds_of(mission))
    options = launch_options(
        path,
        len(uavs),
        autopilots,
        BusKind.AUTO,
        seed=seed,
        speedup=speedup,
        position_rate_hz=position_rate_hz,
    )
    passthrough = PassthroughOptions(
        command=parse_command_styles(command, uavs),
        accept_no_failsafe=isinstance(autopilots, SitlFirmware),
    )
    with progress() as tell:
        done = measure_turnarounds(mission, replace(options, passthrough=passthrough), rounds, tell)
    show(done, json=json)
    return 0 if done.ok else 1


_LEAST_DELIVERED_FRAC = 0.995
_AUTOPILOT_MOST_CORES = 1.0


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
    """Measure how many flying vehicles one process simulates.

    Every vehicle has a TCP client of its own that asks for positions at 10 Hz and the status
    messages that an agent asks for. Exit status 0: at least 99.5 % of them came, for less than
    one core. Needs Linux.

    Examples:
        swarm bench autopilot
        swarm bench autopilot --vehicles 20 --seconds 5 --json
    """
    import asyncio

    from sim.bench.autopilot_load import measure_autopilot

    require_proc("autopilot")
    with progress() as tell:
        done = asyncio.run(measure_autopilot(vehicles, seconds, seed, tell))
    show(done, json=json)
    enough = done.delivered_frac >= _LEAST_DELIVERED_FRAC and done.cores < _AUTOPILOT_MOST_CORES
    return 0 if enough else 1


_DASHBOARD_MOST_CORES = 0.5


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
    """Measure what a dashboard costs.

    A mission is acted out on a real bus: every UAV tells its status, claims and ends tasks, and
    says why. The dashboard is a process of its own; so many pages follow it. Exit status 0: it
    took less than half a core whatever the pages. Needs Linux.

    Examples:
        swarm bench dashboard
        swarm bench dashboard --uavs 300 --rate-hz 5 --clients 1 --seconds 10 --json
    """
    import asyncio

    from sim.bench.dashboard_load import measure_dashboard

    require_proc("dashboard")
    read = integer(0, 64, "no number of pages", "give numbers up to 64")
    counts = tuple(each("--clients", clients, read))
    with progress() as tell:
        done = asyncio.run(measure_dashboard(uavs, tasks, rate_hz, counts, seconds, seed, tell))
    show(done, json=json)
    return 0 if max(following.cores for following in done.followings) < _DASHBOARD_MOST_CORES else 1


_LOSS = _POPUP = 0.3


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
    loss: Annotated[float | None, option_of(ChanceOptions, "loss")] = None,
    popup: Annotated[float | None, option_of(ChanceOptions, "popup")] = None,
    seed: SeedOption = 0,
    json: JsonOption = False,
) -> int:
    """Fly random missions in virtual time with the agents' real cores.

    Each is another mission, planned anew and flown by the greedy rule on an ideal bus, its
    coordinator dead. Unless --loss and --popup say otherwise, 30% of the UAVs are lost and
    30% of the tasks pop up.

    Examples:
        swarm bench missions
        swarm bench missions --missions 100 --size 20x100 --jobs 1
        swarm bench missions --loss 0 --popup 0 --json
    """
    from rich.console import Console
    from rich.progress import Progress

    from sim.bench.missions import MissionBatch, measure_missions
    from sim.world.uncertainty import Uncertainty
    from swarm.kernels.lower_level import default_threads
    from swarm.runtime.clock import SystemClock

    n_uav, n_task = size_of("--size", size)
    uncertainty = Uncertainty(
        loss=_LOSS if loss is None else loss, popup=_POPUP if popup is None else popup
    )
    which = MissionBatch(n_uav, n_task, range(seed, seed + count), uncertainty)
    console = Console(stderr=True)
    with Progress(console=console, transient=True, disable=not console.is_terminal) as bar:
        flying = bar.add_task("missions", total=count)
        done = measure_missions(
            which,
            jobs or default_threads(),
            SystemClock(),
            lambda flown: bar.advance(flying, flown),
        )
    show(done, json=json)
    return 0


def flight(
    size: Annotated[
        str, typer.Option("--size", metavar="NxM", help="UAVs and tasks of the random mission.")
    ] = "200x5000",
    loss: Annotated[float | None, option_of(ChanceOptions, "loss")] = None,
    popup: Annotated[float | None, option_of(ChanceOptions, "popup")] = None,
    coordinator: Annotated[
        bool,
        typer.Option(
            "--coordinator/--no-coordinator",
            help="Whether the coordinator lives and plans anew; else it dies at the start.",
        ),
    ] = True,
    replan_interval_s: Annotated[
        float,
        typer.Option(
            "--replan-interval-s",
            min=1.0,
            max=1e6,
            metavar="S",
            help="Shortest mission time between two re-plans; real coordinators have 5.",
        ),
    ] = 60.0,
    seed: SeedOption = 0,
    json: JsonOption = False,
) -> int:
    """Fly one large mission in virtual time: its value, and how long decisions and re-plans take.

    The real cores of all agents and of the coordinator fly it in one process, on an ideal bus.
    Unless --loss and --popup say otherwise, 30% of the UAVs are lost and 30% of the tasks pop
    up. Times are processor time; all else follows from the seed. At 200x5000 a re-plan takes
    some seconds: with an interval of 5 s most of the work would be re-plans. Such a flight takes
    half an hour or more, 100x2500 five minutes.

    Examples:
        swarm bench flight
        swarm bench flight --no-coordinator
        swarm bench flight --size 50x500 --seed 3 --json
    """
    from sim.bench.flight import measure_flight
    from sim.world.uncertainty import Uncertainty
    from swarm.runtime.clock import SystemClock

    n_uav, n_task = size_of("--size", size)
    uncertainty = Uncertainty(
        loss=_LOSS if loss is None else loss, popup=_POPUP if popup is None else popup
    )
    with progress() as tell:
        done = measure_flight(
            n_uav,
            n_task,
            seed,
            uncertainty,
            SystemClock(),
            replan_interval_s=replan_interval_s if coordinator else None,
            progress=tell,
        )
    show(done, json=json)
    return 0


def replan(
    sizes: SizesOption = "50x500,200x5000",
    seeds: SeedsOption = "0",
    long_run_s: Annotated[
        float,
        typer.Option(
            "--long-run-s",
            min=0.1,
            max=LONGEST_S,
            metavar="S",
            help="How long to search for a yardstick.",
        ),
    ] = 60.0,
    json: JsonOption = False,
    out: Annotated[
        Path | None,
        typer.Option(
            "--out", metavar="FILE", help="Write the result here, too.", show_default=False
        ),
    ] = None,
) -> int:
    """Time re-plans of running missions, and what they gain.

    30% of the UAVs are lost and 30% of the tasks appear, at the start or when half of the known
    tasks are done. From there the rest is planned anew as the coordinator does it; also, it is
    given up at five moments, and timed how long it goes on.

    Examples:
        swarm bench replan
        swarm bench replan --sizes 50x500 --seeds 0,1,2 --long-run-s 20 --json
        swarm bench replan --out replans.txt
    """
    from rich.console import Console

    from sim.bench.replans import measure_replans
    from swarm.runtime.clock import SystemClock

    check_files(None, out)
    wanted, chosen = sizes_of(sizes), seeds_of(seeds)
    with progress() as tell:
        done = measure_replans(wanted, chosen, SystemClock(), unhurried_s=long_run_s, progress=tell)
    show(done, json=json)
    if out is not None:

        def write(path: Path) -> None:
            with path.open("w", encoding="utf-8") as file:
                Console(file=file, width=100).print(done)

        write_file("--out", out, write)
    return 0


def bound(
    sizes: SizesOption = "10x50,50x500",
    seeds: SeedsOption = "0,1,2",
    search_s: Annotated[
        float,
        typer.Option(
            "--search-s",
            min=0.01,
            max=LONGEST_S,
            metavar="S",
            help="Time for guided: once to find a makespan, once more for the D that follows.",
        ),
    ] = 10.0,
    time_limit_s: Annotated[
        float,
        typer.Option(
            "--time-limit-s", min=0.01, max=LONGEST_S, metavar="S", help="Time for each bound."
        ),
    ] = 60.0,
    json: JsonOption = False,
) -> int:
    """Measure how close to the optimum guided lists are proven to be.

    D is 1.5 x the makespan of a first plan, as a long horizon would hide the gap. Where the bound
    meets the lists they are proven optimal.

    Examples:
        swarm bench bound --sizes 10x50 --seeds 0,1,2,3,4,5,6,7,8,9
        swarm bench bound --sizes 200x5000 --seeds 0 --search-s 60 --time-limit-s 300 --json
    """
    from sim.bench.bounds import measure_bounds
    from swarm.runtime.clock import SystemClock

    wanted, chosen = sizes_of(sizes), seeds_of(seeds)
    with progress() as tell:
        done = measure_bounds(
            wanted, chosen, SystemClock(), search_s=search_s, limit_s=time_limit_s, tell=tell
        )
    show(done, json=json)
    return 0
