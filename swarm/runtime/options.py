"""Arguments and options that several commands share, so that they look alike.

Use them as annotations of a command's parameters; the default stays with the
parameter::

    def plan(scenario: ScenarioArgument, json: JsonOption = False, seed: SeedOption = 0) -> int: ...

Those by which a command finds the bus come together, by one parameter of the kind
`swarm.bus.connection.ConnectionOptions`.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable
from pathlib import Path
from typing import Annotated, Any

import typer

from swarm.protocol.timing import LinkKind
from swarm.runtime.log import LogFormat, LogLevel
from swarm.scenario.files import resolve_scenario, shipped_scenarios


def complete_among(*words: str) -> Callable[[str], list[str]]:
    """Completes with those of ``words`` that continue what has been typed."""
    return complete_from(lambda: words)


def complete_from(words: Callable[[], Iterable[str]]) -> Callable[[str], list[str]]:
    """The same for words that are asked for when something is completed, and not before."""

    def complete(incomplete: str) -> list[str]:
        return [word for word in words() if word.startswith(incomplete)]

    return complete


def _complete_scenario(incomplete: str) -> list[tuple[str, str]]:
    """Shipped names and TOML files that continue what has been typed."""
    names = [(name, "shipped") for name in shipped_scenarios() if name.startswith(incomplete)]
    folder, _, beginning = incomplete.rpartition("/")
    prefix = f"{folder}/" if "/" in incomplete else ""
    try:
        entries = sorted(Path(prefix or ".").iterdir())
    except OSError:
        entries = []
    for entry in entries:
        if not entry.name.startswith(beginning):
            continue
        if entry.is_dir() and not entry.name.startswith("."):
            names.append((f"{prefix}{entry.name}/", "folder"))
        elif entry.suffix == ".toml":
            names.append((f"{prefix}{entry.name}", "file"))
    return names


def _scenario_argument(metavar: str) -> Any:
    return typer.Argument(
        metavar=metavar,
        help="Scenario file, or the name of a shipped one such as table-1.",
        parser=resolve_scenario,
        autocompletion=_complete_scenario,
        show_default=False,
    )


ScenarioArgument = Annotated[Path, _scenario_argument("SCENARIO")]
"""Path of an existing scenario file; shipped names are resolved already."""

OptionalScenarioArgument = Annotated[Path | None, _scenario_argument("[SCENARIO]")]
"""The same for commands that can do without; None without one."""

JsonOption = Annotated[
    bool,
    typer.Option("--json", help="Print one JSON object on standard output, nothing else there."),
]

SeedOption = Annotated[
    int,
    typer.Option("--seed", min=0, metavar="N", help="Seed of everything random."),
]

TimeLimitOption = Annotated[
    float | None,
    typer.Option(
        "--time-limit-s",
        min=0.0,
        metavar="S",
        help="Be done after this many seconds, with the best found so far.",
        show_default=False,
    ),
]

BoundTimeOption = Annotated[
    float | None,
    typer.Option(
        "--bound-s",
        min=0.01,
        metavar="S",
        help="Spend S on that bound, beyond the time limit.",
        show_default=False,
    ),
]

LogLevelOption = Annotated[
    LogLevel,
    typer.Option("--log-level", envvar="SWARM_LOG_LEVEL", help="How much to log."),
]

LogFormatOption = Annotated[
    LogFormat,
    typer.Option("--log-format", envvar="SWARM_LOG_FORMAT", help="What a log line looks like."),
]

CheckOption = Annotated[
    bool,
    typer.Option("--check", help="Only see whether these options are right, keys included."),
]
"""Leave with status 0 where the process would begin to touch anything."""

LifelineOption = Annotated[bool, typer.Option("--lifeline", hidden=True)]
"""End when standard input does: the parent process holds its other end."""

SpeedupOption = Annotated[
    float,
    typer.Option(
        "--speedup",
        min=0.01,
        max=1000.0,
        metavar="X",
        help="Mission seconds per wall second; the same for every process of a mission.",
    ),
]

MissionOption = Annotated[
    str,
    typer.Option("--mission", metavar="NAME", help="Name of the mission: its scenario's name."),
]

SomeMissionOption = Annotated[
    str | None,
    typer.Option(
        "--mission",
        metavar="NAME",
        help="Name of the mission. Default: the only one on the bus.",
        show_default=False,
    ),
]

BusOption = Annotated[
    str,
    typer.Option(
        "--bus",
        metavar="mesh|router|FILE",
        autocompletion=complete_among("mesh", "router"),
        help="How processes reach each other: as peers, through routers, or as a Zenoh "
        "configuration file says. Those that look on or command find a 'swarm run' of this "
        "machine by themselves where nothing is named; run names it, run:PID one of several.",
    ),
]

ListenOption = Annotated[
    str,
    typer.Option(
        "--listen",
        metavar="ENDPOINT",
        help="Mesh: own endpoint, such as tls/192.168.1.7:7448.",
        show_default=False,
    ),
]

ConnectOption = Annotated[
    list[str] | None,
    typer.Option(
        "--connect",
        metavar="ENDPOINT",
        help="Router to use, or with --bus mesh a peer to dial; may be repeated. "
        "Default with --bus router: tcp/127.0.0.1:7447, with --keys tls/127.0.0.1:7447.",
        show_default=False,
    ),
]

KeysOption = Annotated[
    Path | None,
    typer.Option(
        "--keys",
        metavar="DIR",
        envvar="SWARM_KEYS",
        help="Folder with this process's keys, made by 'swarm keys': it then speaks encrypted, "
        "by tls/ or quic/, and with the same mission's processes alone. What the keys say about "
        "security overrides a Zenoh file.",
        show_default=False,
    ),
]

UnencryptedOption = Annotated[
    bool,
    typer.Option(
        "--unencrypted",
        help="Without keys, talk to other machines all the same: who reaches the network can "
        "listen to everything, and steer.",
    ),
]

LinkOption = Annotated[
    LinkKind,
    typer.Option(
        "--link",
        help="What the network is like, which sets lease and timers; the same for every process "
        "of a mission. clean: one machine or wired; normal: up to 5 % loss and 30 ms; bad: up "
        "to 20 % and 100 ms.",
    ),
]

LeaseOption = Annotated[
    float | None,
    typer.Option(
        "--lease-s",
        min=0.2,
        max=60.0,
        metavar="S",
        help="Silence after which the others take this process for lost, instead of --link's.",
        show_default=False,
    ),
]

StateOption = Annotated[
    Path | None,
    typer.Option(
        "--state",
        metavar="DIR",
        help="Keep what this process knows in a file there, and resume from it when it is "
        "started anew.",
        show_default=False,
    ),
]

HostOption = Annotated[
    str,
    typer.Option(
        "--host",
        metavar="ADDRESS",
        help="Where to listen. Beyond this machine everyone needs the token.",
    ),
]

PortOption = Annotated[
    int,
    typer.Option("--port", min=0, max=65535, metavar="PORT", help="0: any that is free."),
]
