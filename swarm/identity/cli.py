"""The commands `swarm keys init`, `add`, `revoke`, `renew`, `publish` and `list`."""

from __future__ import annotations

import json as json_format
import sys
from collections.abc import Iterable
from itertools import groupby
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from swarm.identity.changes import FleetAddress, enact, told, written
from swarm.identity.founding import DEFAULT_DAYS
from swarm.identity.roster import Role
from swarm.runtime.options import (
    BusOption,
    ConnectOption,
    JsonOption,
    ListenOption,
    ScenarioArgument,
)

if TYPE_CHECKING:
    from swarm.identity.authority import Authority
    from swarm.identity.roster import RosterEntry

keys = typer.Typer(
    help="Make the keys of a mission: who may say what, encrypted and signed.",
    rich_markup_mode=None,
    no_args_is_help=True,
)

DirectoryArgument = Annotated[
    Path,
    typer.Argument(
        metavar="DIR", help="The authority's folder, which `swarm keys init` made.", file_okay=False
    ),
]
NamesArgument = Annotated[
    list[str], typer.Argument(metavar="NAME…", help="Of whom.", show_default=False)
]
_PLACES = {
    Role.UAV: "to its companion computer, for swarm agent --keys",
    Role.COORDINATOR: "to the coordinator's machine",
    Role.ROUTER: "to the router's machine",
    Role.VIEWER: "to who looks on: dashboard, recorder, status",
    Role.OPERATOR: "to who commands the fleet",
}
_DAYS_HELP = "How long the certificates are valid."
_MOST_DAYS = 3650
_MOST_ROWS = 12
"""More folders of one role than that are told in one row."""
DaysOption = Annotated[
    int | None,
    typer.Option(
        "--days",
        min=1,
        max=_MOST_DAYS,
        metavar="N",
        help=f"{_DAYS_HELP} Default: as `swarm keys init` was told.",
        show_default=False,
    ),
]


def _count(what: str) -> typer.models.OptionInfo:
    option: typer.models.OptionInfo = typer.Option(
        f"--{what}s", min=0, max=100, metavar="N", help=f"How many {what}s get keys."
    )
    return option


TellOption = Annotated[
    list[str] | None,
    typer.Option(
        "--connect",
        metavar="ENDPOINT",
        help="Tell a running fleet, too, through this router, such as tls/192.168.1.2:7447; with "
        "--bus mesh through these peers; may be repeated.",
        show_default=False,
    ),
]
AsOption = Annotated[
    Path | None,
    typer.Option(
        "--as",
        metavar="DIR",
        help="Keys to tell it with, an operator's or a coordinator's. Default: DIR/operator.",
        show_default=False,
    ),
]


@keys.command("init")
def init(
    scenario: ScenarioArgument,
    out: Annotated[
        Path,
        typer.Option("--out", metavar="DIR", help="The new folder.", show_default=False),
    ],
    days: Annotated[
        int, typer.Option("--days", min=1, max=_MOST_DAYS, metavar="N", help=_DAYS_HELP)
    ] = DEFAULT_DAYS,
    coordinators: Annotated[int, _count("coordinator")] = 1,
    routers: Annotated[int, _count("router")] = 1,
    dashboards: Annotated[int, _count("dashboard")] = 1,
    operators: Annotated[int, _count("operator")] = 1,
    mesh: Annotated[
        bool,
        typer.Option(
            "--mesh", help="For a fleet without routers (--bus mesh): let all dial each other."
        ),
    ] = False,
) -> int:
    """Found the authority of a mission, with keys for everyone.

    Makes DIR, which holds the authority, and in it a folder for every UAV of the scenario,
    for the coordinator, the router, a dashboard and an operator; the second of a kind is named
    router-2 and so on. A folder is what goes to that machine, and what its process is told by
    --keys. A dashboard's keys let it show everything and command nothing; one that is to command
    gets an operator's.

    DIR itself stays off the vehicles: whoever has it can let anybody in. All files are private
    to who made them, and no certificate outlives --days. Valid from a day back, for machines
    whose clocks are behind.

    Each UAV also gets a key for the link to its autopilot (MAVLink 2 signing), as
    UAV/mavlink.key for its agent. DIR/mavlink-keys.csv has the pass phrases from which they are
    made. Enter a UAV's in a ground station that is connected to its autopilot by cable, and send
    it: Mission Planner: Setup, Advanced, Mavlink Signing, Add, then Use; QGroundControl:
    Application Settings, Telemetry (MAVLink), MAVLink 2 Signing, Send to Vehicle; MAVProxy:
    signing setup PHRASE.

    Examples:
        swarm keys init field.toml --out ~/field-keys
        swarm keys init table-1 --out keys --days 30 --coordinators 2 --routers 2
        swarm keys init table-1 --out keys --mesh --routers 0
    """
    from swarm.identity.founding import found_authority
    from swarm.runtime.clock import unix_s
    from swarm.scenario import load_scenario

    mission = load_scenario(scenario)
    with written(out):
        authority = found_authority(
            out,
            mission.name,
            [uav.id for uav in mission.uavs],
            now_s=unix_s(),
            coordinators=coordinators,
            routers=routers,
            dashboards=dashboards,
            operators=operators,
            days=days,
            mesh=mesh,
        )
    print(f"{out}: the authority of {mission.name!r}; keep this folder off the vehicles")
    _tell_folders(authority, authority.roster.entries)
    print(f"{authority.mavlink_table}: pass phrases of the autopilots' links, to be entered there")
    print("(see 'swarm keys init --help')")
    if routers:
        print(f"next: swarm router --keys {authority.folder('router')}")
    return 0


@keys.command("add")
def add(
    directory: DirectoryArgument,
    names: NamesArgument,
    role: Annotated[
        Role | None,
        typer.Option(
            "--role",
            help="What a new name may do; one that is known keeps its role.",
            show_default=False,
        ),
    ] = None,
    days: DaysOption = None,
    connect: TellOption = None,
    as_: AsOption = None,
    bus: BusOption = "router",
    listen: ListenOption = "",
) -> int:
    """Issue keys for a new name, or anew for a known one.

    Anew before a certificate expires, after it was revoked, or when a machine was set up afresh.
    The new certificate has the next generation: the one before is refused from then on. A UAV
    that was revoked since it got its MAVLink key gets a new one, whose pass phrase its autopilot
    must be given; else it keeps it.

    With --connect a fleet that flies lets the new ones in, and the ones before out, at once.

    Examples:
        swarm keys add keys uav9 --role uav
        swarm keys add keys uav9 --role uav --connect tls/192.168.1.2:7447
        swarm keys add keys recorder --role viewer
        swarm keys add keys uav3 --days 30
    """
    from swarm.identity.authority import open_authority
    from swarm.runtime.clock import unix_s
    from swarm.runtime.errors import Fault, InputError

    authority = open_authority(directory)
    wanted: dict[str, Role] = {}
    for name in names:
        known = authority.issued.get(name)
        given = role or (None if known is None else known.role)
        if given is None:
            remedy = f"give it one: --role {'|'.join(Role)}"
            raise InputError(Fault(str(directory), "", f"{name!r} is new and has no role", remedy))
        wanted[name] = given
    autopilots = authority.mavlink_uavs()

    def issue() -> None:
        roster = authority.issue(wanted, now_s=unix_s(), days=days)
        _tell_folders(authority, (entry for entry in roster.entries if entry.name in wanted))
        if fresh := sorted(authority.mavlink_uavs() - autopilots):
            names = ", ".join(fresh)
            print(f"{authority.mavlink_table}: new pass phrases for the autopilots of {names}")

    fleet = FleetAddress(bus, listen, connect, as_ or directory / "operator")
    print(enact(authority, issue, fleet, wanted))
    return 0


@keys.command("revoke")
def revoke(
    directory: DirectoryArgument,
    names: NamesArgument,
    connect: TellOption = None,
    as_: AsOption = None,
    bus: BusOption = "router",
    listen: ListenOption = "",
) -> int:
    """Take the keys of stolen, lost or sold machines out of force.

    Makes the next roster, in which they are missing. Whoever has it lets them in no more and
    believes nothing they sign; their folders and MAVLink keys are removed here. `swarm keys
    add` gives the name new keys. An autopilot that fell into other hands knows its own pass
    phrase alone.

    With --connect a fleet that flies shuts them out at once and goes on; routers begin anew for
    that. An agent that was revoked and hears of it comes home. Nothing is changed if the fleet
    cannot be reached; exit status 1 also if somebody who was there did not confirm it.

    Examples:
        swarm keys revoke keys uav3
        swarm keys revoke keys uav3 dashboard --connect tls/192.168.1.2:7447
    """
    from swarm.identity.authority import open_authority

    authority = open_authority(directory)

    def take_out() -> None:
        authority.revoke(names)
        print(f"revoked: {', '.join(dict.fromkeys(names))}")

    fleet = FleetAddress(bus, listen, connect, as_ or directory / "operator")
    print(enact(authority, take_out, fleet, names))
    return 0


@keys.command("publish")
def publish(
    directory: Annotated[
        Path,
        typer.Argument(
            metavar="DIR",
            help="The authority's folder, or that of an operator or a coordinator.",
            file_okay=False,
        ),
    ],
    connect: ConnectOption = None,
    as_: AsOption = None,
    bus: BusOption = "router",
    listen: ListenOption = "",
) -> int:
    """Tell a running fleet the roster of a folder.

    For changes that were made without --connect, such as on a machine that reaches no fleet.
    Who gets it goes by it at once, keeps it, and tells who comes later. Exit status 1: somebody
    who was there did not confirm it.

    Examples:
        swarm keys publish keys --connect tls/192.168.1.2:7447
        swarm keys publish ~/operator
    """
    from swarm.bus.roster_publishing import publish as tell
    from swarm.identity.folder import AUTHORITY_KEY_FILE, ROSTER_FILE
    from swarm.identity.listing import read_lists

    roster, _ = read_lists(directory)
    own = directory / "operator" if (directory / AUTHORITY_KEY_FILE).exists() else directory
    signed = (directory / ROSTER_FILE).read_bytes()
    config = FleetAddress(bus, listen, connect, as_ or own).config(signed)
    print(told(roster.version, tell(config, lambda: signed)))
    return 0


@keys.command("renew")
def renew(directory: DirectoryArgument, days: DaysOption = None) -> int:
    """Issue everything anew, so that nothing from before counts.

    Between flights, for the whole fleet: all certificates get the next generation and a new end.
    What was signed before is worth nothing afterwards, so nobody can replay what they recorded,
    and no folder from before is let in. All machines must be given their new folders. MAVLink
    keys stay, as the autopilots know them.

    Examples:
        swarm keys renew keys
        swarm keys renew keys --days 30
    """
    from swarm.identity.authority import open_authority
    from swarm.runtime.clock import unix_s

    authority = open_authority(directory)
    with written(directory):
        roster = authority.renew(now_s=unix_s(), days=days)
    _tell_folders(authority, roster.entries)
    print("every folder from before is worthless now: give all machines their new ones")
    print(f"processes that run from folders in {directory} end: start them anew")
    return 0


@keys.command("list")
def list_keys(
    directory: Annotated[
        Path,
        typer.Argument(
            metavar="DIR", help="The authority's folder, or that of one machine.", file_okay=False
        ),
    ],
    json: JsonOption = False,
) -> int:
    """Show who has keys, in which role, and until when.

    From a machine's own folder it shows those in force as that machine knows them; the revoked
    are known to the authority alone. It shows no secrets.

    Examples:
        swarm keys list keys
        swarm keys list keys/uav1 --json
    """
    from swarm.identity.listing import (
        attention,
        listing_as_json,
        listing_rows,
        listing_table,
        read_lists,
    )
    from swarm.runtime.clock import unix_s

    roster, issued = read_lists(directory)
    rows = listing_rows(roster, issued, unix_s())
    if json:
        print(json_format.dumps(listing_as_json(roster, rows)))
        return 0
    from rich.console import Console

    print(f"{roster.mission}: roster version {roster.version}, series {roster.series.hex()[:8]}")
    Console(highlight=False).print(listing_table(rows))
    warning = attention(rows, str(directory))
    if warning is not None:
        print(warning, file=sys.stderr)
    return 0


def _tell_folders(authority: Authority, entries: Iterable[RosterEntry]) -> None:
    """Say which folder goes where, and until when it is good."""
    from swarm.identity.folder import shown_time

    by_role = sorted(entries, key=lambda entry: (list(Role).index(entry.role), entry.name))
    rows = []
    for role, alike in groupby(by_role, key=lambda entry: entry.role):
        names = [entry.name for entry in alike]
        if len(names) > _MOST_ROWS:
            ends = f"{authority.folder(names[0])} … {names[-1]}"
            rows.append((f"{ends} ({len(names)})", f"each {_PLACES[role]}"))
        else:
            rows += [(str(authority.folder(name)), _PLACES[role]) for name in names]
    width = max(len(folder) for folder, _ in rows)
    for folder, place in rows:
        print(f"  {folder:<{width}}  {place}")
    print(f"valid until {shown_time(by_role[0].not_after_s)}; keep the folders private on the way")
