"""The commands `swarm bench failover`, `flood` and `secure`: fleets in trouble and attacked."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from sim.bench.command_line import bus_of, each, progress
from swarm.protocol.timing import LinkKind
from swarm.runtime.errors import Fault, InputError
from swarm.runtime.options import JsonOption, LinkOption, SeedOption, SpeedupOption
from swarm.scenario.files import resolve_scenario

if TYPE_CHECKING:
    from sim.bench.failover import FailoverMeasure

__all__ = ["FAILOVER_HELP", "FLOOD_HELP", "SECURE_HELP", "failover", "flood", "secure"]


_LONGEST_S = 86_400.0

FAILOVER_HELP = """Measure fleets of real processes in trouble.

kill, hang, cut, deadlock: time until another UAV holds the task of one that is struck.
loss: how often somebody is taken for lost on bad links. partition: duplicate visits of a
fleet in two halves. traffic: messages and bytes against fleet size. latency: from an
arrival to the next command. All of it takes an hour; run it on a quiet machine.

\b
Examples:
    swarm bench failover
    swarm bench failover --what kill,hang --trials 20 --link clean
    swarm bench failover --what loss --watch-s 30 --json
"""

FLOOD_HELP = """Fly while a hostile peer floods the bus with malformed messages.

24 messages of each malformed kind per second, from before take-off almost to the end.
Exit status 0: every decision was the planned one, every process lived, and every UAV
counted what it dropped.

\b
Examples:
    swarm bench flood
    swarm bench flood --seconds 15 --bus mesh --json
"""


def failover(
    what: Annotated[
        str,
        typer.Option("--what", metavar="NAME,…", help="What to measure; all for everything."),
    ] = "all",
    trials: Annotated[
        int, typer.Option("--trials", min=1, max=10_000, metavar="N", help="Blows of each kind.")
    ] = 100,
    link: LinkOption = LinkKind.NORMAL,
    bus: Annotated[
        str,
        typer.Option("--bus", metavar="mesh|router", help="How the fleets that are struck talk."),
    ] = "router",
    watch_s: Annotated[
        float,
        typer.Option(
            "--watch-s", min=1.0, max=_LONGEST_S, metavar="S", help="Time on each kind of bad link."
        ),
    ] = 120.0,
    relay: Annotated[
        bool,
        typer.Option("--relay", help="Imitate losses, even where real packets could be lost."),
    ] = False,
    parted_s: Annotated[
        float,
        typer.Option(
            "--parted-s", min=1.0, max=_LONGEST_S, metavar="S", help="Length of a partition."
        ),
    ] = 30.0,
    partitions: Annotated[
        int, typer.Option("--partitions", min=1, max=1000, metavar="N", help="How many of them.")
    ] = 3,
    sizes: Annotated[
        str,
        typer.Option("--sizes", metavar="N,…", help="UAVs of the fleets whose traffic is counted."),
    ] = "3,10,30,100",
    seed: SeedOption = 0,
    json: JsonOption = False,
) -> int:
    """See `FAILOVER_HELP`."""
    from json import dumps

    from rich.console import Console

    from sim.bench.failover import (
        FailoverMeasure,
        FailoverSettings,
        failover_as_json,
        failover_as_rich,
        measure_failover,
    )

    wanted = list(FailoverMeasure) if what == "all" else each("--what", what, _what)
    settings = FailoverSettings(
        trials=trials,
        link=link,
        bus=bus_of(bus),
        watch_s=watch_s,
        relay=relay,
        parted_s=parted_s,
        partitions=partitions,
        sizes=tuple(each("--sizes", sizes, _fleet_size)),
        seed=seed,
    )
    with progress() as tell:
        done = measure_failover(wanted, settings, tell)
    if json:
        typer.echo(dumps(failover_as_json(done), allow_nan=False))
    else:
        Console(highlight=False).print(failover_as_rich(done))
    return 0


def flood(
    seconds: Annotated[
        float,
        typer.Option(
            "--seconds", min=12.0, max=3600.0, metavar="S", help="How long to flood, about."
        ),
    ] = 60.0,
    bus: Annotated[
        str, typer.Option("--bus", metavar="mesh|router", help="How the processes talk.")
    ] = "router",
    seed: SeedOption = 0,
    json: JsonOption = False,
) -> int:
    """See `FLOOD_HELP`."""
    import asyncio
    from json import dumps

    from rich.console import Console

    from sim.bench.machine import this_machine
    from sim.bench.security_report import flood_as_json, flood_as_rich
    from sim.fleet.faults.flood import fly_flooded, times_for

    kind, machine = bus_of(bus), this_machine()
    with progress() as tell:
        done = asyncio.run(fly_flooded(times_for(seconds), seed=seed, bus=kind, on_progress=tell))
    if json:
        typer.echo(dumps(flood_as_json(machine, seed, done), allow_nan=False))
    else:
        Console(highlight=False).print(flood_as_rich(machine, seed, done))
    return 0 if done.ok else 1


def _what(flag: str, word: str) -> FailoverMeasure:
    from sim.bench.failover import FailoverMeasure

    try:
        return FailoverMeasure(word)
    except ValueError:
        remedy = f"choose among {', '.join(FailoverMeasure)}, or all"
        raise InputError(Fault(flag, word, "cannot be measured", remedy)) from None


def _fleet_size(flag: str, word: str) -> int:
    if not (word.isascii() and word.isdigit() and 1 <= int(word[:5]) <= 1000):
        raise InputError(Fault(flag, word, "no fleet size", "give numbers within 1..1000"))
    return int(word)


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
    from sim.bench.security import SecureSettings, measure_secure
    from sim.bench.security_report import secure_as_json, secure_as_rich
    from sim.fleet.autopilots import SimulatedAutopilots
    from sim.fleet.layout import LaunchOptions, defaults_for
    from swarm.runtime.log import LogFormat
    from swarm.scenario import load_scenario

    if flood_hz > 0.0 and bus != "router":
        problem = "the hostile agent is a router's client"
        raise InputError(Fault("--flood-hz", f"{flood_hz:g}", problem, "give 0 with --bus mesh"))
    path = scenario or resolve_scenario("valley-survey")
    mission = load_scenario(path)
    defaults = defaults_for(SimulatedAutopilots(), len(mission.uavs))
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
        done = measure_secure(mission, options, SecureSettings(rounds, claims, flood_hz), tell)
    if json:
        typer.echo(dumps(secure_as_json(machine, done), allow_nan=False))
    else:
        Console(highlight=False).print(secure_as_rich(machine, done))
    return 0 if done.ok else 1
