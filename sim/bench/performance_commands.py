"""The commands `swarm bench turnaround`, `autopilot`, `dashboard` and `missions`.

They measure how long things take, and how much one process carries.
"""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from sim.bench.command_line import each, progress, size_of
from sim.options import LossOption, PopupOption
from swarm.runtime.errors import Fault, InputError
from swarm.runtime.options import JsonOption, SeedOption, SpeedupOption
from swarm.scenario.files import resolve_scenario

__all__ = [
    "AUTOPILOT_HELP",
    "DASHBOARD_HELP",
    "MISSIONS_HELP",
    "TURNAROUND_HELP",
    "autopilot",
    "dashboard",
    "missions",
    "turnaround",
]


TURNAROUND_HELP = """Time from each arrival, or end of a service, to the next target sent.

Flies a scenario with real processes: what each agent's process takes to send its vehicle
on, and the makespan beside the plan's. Exit status 0: every task was done.

At wall speed valley-survey takes about seven minutes. A speed-up saves time, but has as
many turnarounds and messages in less of it: then processes wait for processors too.

\b
Examples:
    swarm bench turnaround
    swarm bench turnaround --speedup 4 --rounds 3
    swarm bench turnaround --command mission --json
"""


def turnaround(
    scenario: Annotated[
        Path | None,
        typer.Argument(
            metavar="[SCENARIO]",
            help="Scenario file, or the name of a shipped one; default: valley-survey.",
            parser=resolve_scenario,
            show_default=False,
        ),
    ] = None,
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
    """See `TURNAROUND_HELP`."""
    import os
    from json import dumps

    from rich.console import Console

    from sim.bench.machine import this_machine
    from sim.bench.turnaround import measure_turnarounds, turnarounds_as_json, turnarounds_as_rich
    from sim.fleet.autopilots import parse_autopilots
    from sim.fleet.firmware import SitlFirmware
    from sim.fleet.layout import BusKind, LaunchOptions, defaults_for
    from sim.fleet.passthrough import PassthroughOptions, parse_command_styles
    from swarm.runtime.log import LogFormat
    from swarm.scenario import load_scenario

    path = scenario or resolve_scenario("valley-survey")
    mission = load_scenario(path)
    uavs = [uav.id for uav in mission.uavs]
    autopilots = parse_autopilots(autopilot, uavs, None, os.environ)
    defaults = defaults_for(autopilots, len(uavs))
    options = LaunchOptions(
        scenario=path,
        method="guided",
        seed=seed,
        speedup=speedup,
        bus=BusKind.AUTO,
        position_rate_hz=position_rate_hz,
        acceptance_radius_m=defaults.acceptance_radius_m,
        start_timeout_s=defaults.start_timeout_s,
        autopilots=autopilots,
        passthrough=PassthroughOptions(
            command=parse_command_styles(command, uavs),
            accept_no_failsafe=isinstance(autopilots, SitlFirmware),
        ),
        log_format=LogFormat.JSON,
    )
    machine = this_machine()
    with progress() as tell:
        done = measure_turnarounds(mission, options, rounds, tell)
    if json:
        typer.echo(dumps(turnarounds_as_json(machine, seed, done), allow_nan=False))
    else:
        Console(highlight=False).print(turnarounds_as_rich(machine, seed, done))
    return 0 if done.ok else 1


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
    """See `AUTOPILOT_HELP`."""
    import asyncio
    from json import dumps
    from pathlib import Path

    from rich.console import Console

    from sim.bench.autopilot_load import (
        autopilot_load_as_json,
        autopilot_load_as_rich,
        measure_autopilot,
    )

    if not Path("/proc/self/stat").exists():
        problem = "there is no /proc that tells processor time"
        raise InputError(Fault("swarm bench autopilot", "", problem, "run it on Linux"))
    with progress() as tell:
        done = asyncio.run(measure_autopilot(vehicles, seconds, seed, tell))
    if json:
        typer.echo(dumps(autopilot_load_as_json(done), allow_nan=False))
    else:
        Console(highlight=False).print(autopilot_load_as_rich(done))
    enough = done.delivered_frac >= _LEAST_DELIVERED_FRAC and done.cores < _AUTOPILOT_MOST_CORES
    return 0 if enough else 1


DASHBOARD_HELP = """Measure what a dashboard costs.

A mission is acted out on a real bus: every UAV tells its status, claims and ends tasks, and
says why. The dashboard is a process of its own; so many pages follow it. Exit status 0: it
took less than half a core whatever the pages. Needs Linux.

\b
Examples:
    swarm bench dashboard
    swarm bench dashboard --uavs 300 --rate-hz 5 --clients 1 --seconds 10 --json
"""

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
    """See `DASHBOARD_HELP`."""
    import asyncio
    from json import dumps
    from pathlib import Path

    from rich.console import Console

    from sim.bench.dashboard_load import (
        dashboard_load_as_json,
        dashboard_load_as_rich,
        measure_dashboard,
    )

    if not Path("/proc/self/stat").exists():
        problem = "there is no /proc that tells processor time"
        raise InputError(Fault("swarm bench dashboard", "", problem, "run it on Linux"))
    counts = tuple(each("--clients", clients, _count))
    with progress() as tell:
        done = asyncio.run(measure_dashboard(uavs, tasks, rate_hz, counts, seconds, seed, tell))
    if json:
        typer.echo(dumps(dashboard_load_as_json(done), allow_nan=False))
    else:
        Console(highlight=False).print(dashboard_load_as_rich(done))
    return 0 if max(following.cores for following in done.followings) < _DASHBOARD_MOST_CORES else 1


def _count(flag: str, word: str) -> int:
    if not (word.isascii() and word.isdigit() and int(word) <= 64):
        raise InputError(Fault(flag, word, "no number of pages", "give numbers up to 64"))
    return int(word)


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
        MissionBatch,
        measure_missions,
        missions_as_json,
        missions_as_rich,
    )
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
    if json:
        typer.echo(dumps(missions_as_json(done), allow_nan=False))
    else:
        Console(highlight=False).print(missions_as_rich(done))
    return 0
