"""The command `swarm bench secure`.

Leaves out: what it does and how it is shown (`sim.bench.secure`, `sim.bench.hop`,
`sim.bench.secure_report`).
"""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from sim.bench.trouble_commands import bus_of, progress
from swarm.errors import Fault, InputError
from swarm.options import JsonOption, SeedOption, SpeedupOption
from swarm.scenario.shipped import resolve_scenario

__all__ = ["SECURE_HELP", "secure"]

SECURE_HELP = """Fly with keys and without in turn, and set what it costs side by side.

Flies a scenario with real processes in turn plain, by --secure of swarm run, and secure while a
hostile agent with valid keys floods the bus: processor time and memory by kind of process, the
time from each arrival to the next target sent, the time to take off; and the time single claims
take through a router. Exit status 0: every task was done, and nothing was refused without a flood.

\b
Examples:
    swarm bench secure
    swarm bench secure --speedup 10 --rounds 3
    swarm bench secure --flood-hz 0 --bus mesh
    swarm bench secure table-1 --claims 0 --json
"""


def secure(
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
        int, typer.Option("--rounds", min=0, max=1000, metavar="N", help="Flights each way.")
    ] = 2,
    claims: Annotated[
        int,
        typer.Option(
            "--claims",
            min=0,
            max=100_000,
            metavar="N",
            help="Claims sent through a router each way, 20 a second.",
        ),
    ] = 400,
    flood_hz: Annotated[
        float,
        typer.Option(
            "--flood-hz",
            min=0.0,
            max=1e6,
            metavar="HZ",
            help="Messages a second of the hostile agent; 0: no flooded flights.",
        ),
    ] = 10_000.0,
    speedup: SpeedupOption = 4.0,
    bus: Annotated[
        str, typer.Option("--bus", metavar="mesh|router", help="How the processes talk.")
    ] = "router",
    position_rate_hz: Annotated[
        float,
        typer.Option(
            "--position-rate-hz",
            min=1.0,
            max=200.0,
            metavar="HZ",
            help="Position reports of each autopilot per wall second.",
        ),
    ] = 20.0,
    seed: SeedOption = 0,
    json: JsonOption = False,
) -> int:
    """See `SECURE_HELP`."""
    from json import dumps

    from rich.console import Console

    from sim.bench.machine import this_machine
    from sim.bench.secure import Settings, measure_secure
    from sim.bench.secure_report import secure_as_json, secure_as_rich
    from sim.launch.autopilots import Simulated
    from sim.launch.fleet import LaunchOptions, defaults_for
    from swarm.log import LogFormat
    from swarm.scenario import load_scenario

    if flood_hz > 0.0 and bus != "router":
        problem = "the hostile agent is a router's client"
        raise InputError(Fault("--flood-hz", f"{flood_hz:g}", problem, "give 0 with --bus mesh"))
    path = scenario or resolve_scenario("valley-survey")
    mission = load_scenario(path)
    defaults = defaults_for(Simulated(), len(mission.uavs))
    options = LaunchOptions(
        scenario=path,
        method="guided",
        seed=seed,
        speedup=speedup,
        bus=bus_of(bus),
        position_rate_hz=position_rate_hz,
        acceptance_radius_m=defaults.acceptance_radius_m,
        start_timeout_s=defaults.start_timeout_s,
        log_format=LogFormat.JSON,
    )
    machine = this_machine()
    with progress() as tell:
        done = measure_secure(mission, options, Settings(rounds, claims, flood_hz), tell)
    if json:
        typer.echo(dumps(secure_as_json(machine, done), allow_nan=False))
    else:
        Console(highlight=False).print(secure_as_rich(machine, done))
    return 0 if done.ok else 1
