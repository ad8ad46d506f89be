"""The command `swarm bench turnaround`.

Leaves out: what it does and how it is shown (`sim.bench.turnaround`).
"""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from sim.bench.trouble_commands import progress
from swarm.options import JsonOption, SeedOption, SpeedupOption
from swarm.scenario.shipped import resolve_scenario

__all__ = ["TURNAROUND_HELP", "turnaround"]

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
    from sim.bench.turnaround import (
        measure_turnarounds,
        turnarounds_as_json,
        turnarounds_as_rich,
    )
    from sim.launch.autopilots import parse_autopilots
    from sim.launch.firmware import Firmware
    from sim.launch.fleet import BusKind, LaunchOptions, defaults_for
    from sim.launch.handed_on import HandedOn, parse_command_styles
    from swarm.log import LogFormat
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
        handed_on=HandedOn(
            command=parse_command_styles(command, uavs),
            accept_no_failsafe=isinstance(autopilots, Firmware),
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
