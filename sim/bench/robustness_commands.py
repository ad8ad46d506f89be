"""The commands `swarm bench failover`, `flood` and `secure`: fleets in trouble and attacked."""

from __future__ import annotations

from typing import TYPE_CHECKING, Annotated

import typer

from sim.bench.command_line import (
    LONGEST_S,
    BusKindOption,
    ValleyArgument,
    bus_of,
    each,
    integer,
    launch_options,
    progress,
    show,
)
from swarm.protocol.timing import LinkKind
from swarm.runtime.errors import Fault, InputError
from swarm.runtime.options import JsonOption, LinkOption, SeedOption, SpeedupOption
from swarm.scenario.files import resolve_scenario

if TYPE_CHECKING:
    from sim.bench.failover import FailoverMeasure


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
            "--watch-s", min=1.0, max=LONGEST_S, metavar="S", help="Time on each kind of bad link."
        ),
    ] = 120.0,
    relay: Annotated[
        bool,
        typer.Option("--relay", help="Imitate losses, even where real packets could be lost."),
    ] = False,
    parted_s: Annotated[
        float,
        typer.Option(
            "--parted-s", min=1.0, max=LONGEST_S, metavar="S", help="Length of a partition."
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
    """Measure fleets of real processes in trouble.

    kill, hang, cut, deadlock: time until another UAV holds the task of one that is struck.
    loss: how often somebody is taken for lost on bad links. partition: duplicate visits of a
    fleet in two halves. traffic: messages and bytes against fleet size. latency: from an
    arrival to the next command. All of it takes an hour; run it on a quiet machine.

    Examples:
        swarm bench failover
        swarm bench failover --what kill,hang --trials 20 --link clean
        swarm bench failover --what loss --watch-s 30 --json
    """
    from sim.bench.failover import FailoverMeasure, FailoverSettings, measure_failover

    fleet_size = integer(1, 1000, "no fleet size", "give numbers within 1..1000")
    wanted = list(FailoverMeasure) if what == "all" else each("--what", what, _what)
    settings = FailoverSettings(
        trials=trials,
        link=link,
        bus=bus_of(bus),
        watch_s=watch_s,
        relay=relay,
        parted_s=parted_s,
        partitions=partitions,
        sizes=tuple(each("--sizes", sizes, fleet_size)),
        seed=seed,
    )
    with progress() as tell:
        done = measure_failover(wanted, settings, tell)
    show(done, json=json)
    return 0


def flood(
    seconds: Annotated[
        float,
        typer.Option(
            "--seconds", min=12.0, max=3600.0, metavar="S", help="How long to flood, about."
        ),
    ] = 60.0,
    bus: BusKindOption = "router",
    seed: SeedOption = 0,
    json: JsonOption = False,
) -> int:
    """Fly while a hostile peer floods the bus with malformed messages.

    24 messages of each malformed kind per second, from before take-off almost to the end.
    Exit status 0: every decision was the planned one, every process lived, and every UAV
    counted what it dropped.

    Examples:
        swarm bench flood
        swarm bench flood --seconds 15 --bus mesh --json
    """
    import asyncio

    from sim.bench.machine import this_machine
    from sim.bench.security import FloodBench
    from sim.fleet.faults.flood import fly_flooded, times_for

    kind, machine = bus_of(bus), this_machine()
    with progress() as tell:
        done = asyncio.run(fly_flooded(times_for(seconds), seed=seed, bus=kind, on_progress=tell))
    show(FloodBench(machine, seed, done), json=json)
    return 0 if done.ok else 1


def _what(flag: str, word: str) -> FailoverMeasure:
    from sim.bench.failover import FailoverMeasure

    try:
        return FailoverMeasure(word)
    except ValueError:
        remedy = f"choose among {', '.join(FailoverMeasure)}, or all"
        raise InputError(Fault(flag, word, "cannot be measured", remedy)) from None


def secure(
    scenario: ValleyArgument = None,
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
    bus: BusKindOption = "router",
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
    """Fly with keys and without in turn, and set what it costs side by side.

    Flies a scenario with real processes in turn plain, by --secure of swarm run, and secure while a
    hostile agent with valid keys floods the bus: processor time and memory by kind of process, the
    time from each arrival to the next target sent, the time to take off; and the time single claims
    take through a router. Exit status 0: every task was done, and nothing was refused without a
    flood.

    Examples:
        swarm bench secure
        swarm bench secure --speedup 10 --rounds 3
        swarm bench secure --flood-hz 0 --bus mesh
        swarm bench secure table-1 --claims 0 --json
    """
    from sim.bench.security import SecureSettings, measure_secure
    from sim.fleet.autopilots import SimulatedAutopilots
    from swarm.scenario import load_scenario, require_plain

    if flood_hz > 0.0 and bus != "router":
        problem = "the hostile agent is a router's client"
        raise InputError(Fault("--flood-hz", f"{flood_hz:g}", problem, "give 0 with --bus mesh"))
    path = scenario or resolve_scenario("valley-survey")
    mission = load_scenario(path)
    require_plain(mission, "swarm bench")
    options = launch_options(
        path,
        len(mission.uavs),
        SimulatedAutopilots(),
        bus_of(bus),
        seed=seed,
        speedup=speedup,
        position_rate_hz=position_rate_hz,
    )
    with progress() as tell:
        done = measure_secure(mission, options, SecureSettings(rounds, claims, flood_hz), tell)
    show(done, json=json)
    return 0 if done.ok else 1
