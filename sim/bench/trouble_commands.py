"""The commands `swarm bench failover` and `swarm bench flood`.

Leaves out: what they do (`sim.bench.failover`, `sim.chaos.flood`).
"""

from __future__ import annotations

import contextlib
from collections.abc import Callable, Iterator
from typing import TYPE_CHECKING, Annotated

import typer

from sim.bench.words import each
from swarm.config import Link
from swarm.errors import Fault, InputError
from swarm.options import JsonOption, LinkOption, SeedOption

if TYPE_CHECKING:
    from sim.bench.failover import What
    from sim.launch.fleet import BusKind

__all__ = ["FAILOVER_HELP", "FLOOD_HELP", "bus_of", "failover", "flood", "progress"]

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
    link: LinkOption = Link.NORMAL,
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
        Settings,
        What,
        failover_as_json,
        failover_as_rich,
        measure,
    )

    wanted = list(What) if what == "all" else each("--what", what, _what)
    settings = Settings(
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
        done = measure(wanted, settings, tell)
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

    from sim.bench.flood import flood_as_json, flood_as_rich
    from sim.bench.machine import this_machine
    from sim.chaos.flood import fly_flooded, times_for

    kind, machine = bus_of(bus), this_machine()
    with progress() as tell:
        done = asyncio.run(fly_flooded(times_for(seconds), seed=seed, bus=kind, on_progress=tell))
    if json:
        typer.echo(dumps(flood_as_json(machine, seed, done), allow_nan=False))
    else:
        Console(highlight=False).print(flood_as_rich(machine, seed, done))
    return 0 if done.ok else 1


@contextlib.contextmanager
def progress() -> Iterator[Callable[[str], None]]:
    """A place to say what is being done: a line that changes, on a terminal only."""
    from rich.console import Console

    from swarm.log import LogLevel, configure_logging

    configure_logging(LogLevel.ERROR)
    console = Console(stderr=True)
    with console.status("", spinner_style="dim") as status:
        yield status.update if console.is_terminal else lambda _: None


def _what(flag: str, word: str) -> What:
    from sim.bench.failover import What

    try:
        return What(word)
    except ValueError:
        remedy = f"choose among {', '.join(What)}, or all"
        raise InputError(Fault(flag, word, "cannot be measured", remedy)) from None


def bus_of(word: str) -> BusKind:
    """The bus of that name.

    Raises:
        InputError: it is none.
    """
    from sim.launch.fleet import BusKind

    if word not in (BusKind.MESH, BusKind.ROUTER):
        raise InputError(Fault("--bus", word, "no such bus", "choose mesh or router"))
    return BusKind(word)


def _fleet_size(flag: str, word: str) -> int:
    if not (word.isascii() and word.isdigit() and 1 <= int(word[:5]) <= 1000):
        raise InputError(Fault(flag, word, "no fleet size", "give numbers within 1..1000"))
    return int(word)
