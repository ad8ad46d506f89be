"""The commands `swarm start`, `hold`, `resume`, `return`, `abort` and `task add|withdraw`."""

from __future__ import annotations

import sys
from collections.abc import Callable
from typing import TYPE_CHECKING, Annotated

import typer

from coordinator.operator.completion import complete_uav
from coordinator.operator.points import PointsCommand
from coordinator.operator.task_limits import NO_LIMITS, TaskLimits
from swarm.bus.connection import DEFAULT_CONNECTION, ConnectionOptions
from swarm.runtime.errors import Fault, InputError, SwarmError
from swarm.runtime.option_groups import with_options
from swarm.runtime.options import JsonOption, SomeMissionOption, SpeedupOption

if TYPE_CHECKING:
    from coordinator.operator.commands import RequestVerdict
    from coordinator.operator.requests import OperatorClient, OperatorRequest
    from coordinator.operator.submission import MissionConnection
    from coordinator.operator.task_edits import Wgs84
    from swarm.protocol.fields import Point

UavArgument = Annotated[
    str, typer.Argument(metavar="UAV", help="Id of the UAV.", autocompletion=complete_uav)
]
ReasonOption = Annotated[
    str,
    typer.Option(
        "--reason", metavar="TEXT", help="Why; told in status, logs and story.", show_default=False
    ),
]
TimeoutOption = Annotated[
    float,
    typer.Option(
        "--timeout-s",
        min=0.1,
        max=600.0,
        metavar="S",
        help="How long to wait for the mission, and then for the command to take effect; "
        "wall seconds.",
    ),
]


def _of_one_uav(kind: str, help_text: str) -> Callable[..., int]:
    """The command that says ``kind`` to one UAV."""

    @with_options
    def command(
        uav: UavArgument,
        reason: ReasonOption = "",
        mission: SomeMissionOption = None,
        timeout_s: TimeoutOption = 10.0,
        seat: ConnectionOptions = DEFAULT_CONNECTION,
        speedup: SpeedupOption = 1.0,
        json: JsonOption = False,
    ) -> int:
        from coordinator.operator.submission import MissionConnection

        reach = MissionConnection(mission, timeout_s, seat, speedup)
        return _give(kind, uav, reason, reach, json=json)

    command.__doc__ = help_text
    return command


hold = _of_one_uav(
    "hold",
    """Stop one UAV where it is.

    It gives its task up, takes no other and hovers. Before take-off it stays on the ground. The
    others go on, and take over what it leaves. It goes on after `swarm resume`, and comes home
    after `swarm return`; its battery's reserve or the end of its own process bring it home in any
    case. Works without a coordinator. Exit status 1: it was not seen to obey, and the line says
    why.

    Examples:
        swarm hold uav2
        swarm hold uav2 --reason "helicopter in sight" --keys keys/operator
    """,
)

resume = _of_one_uav(
    "resume",
    """Let a UAV go on that was stopped by `swarm hold`.

    It takes part in the mission again. One that was stopped on its way home goes on home.

    Examples:
        swarm resume uav2
    """,
)

return_home = _of_one_uav(
    "return",
    """Send one UAV home for good.

    It gives its task up, lands, and its agent ends with 0. The others take over what it leaves.
    It takes no further part in this flight of the mission, unless its agent is started anew with
    --rejoin.

    Examples:
        swarm return uav2 --reason "camera failed"
    """,
)


@with_options
def start(
    without: Annotated[
        str,
        typer.Option(
            "--without",
            metavar="UAV",
            help="Id of the UAV that is not to be waited for.",
            autocompletion=complete_uav,
        ),
    ],
    reason: ReasonOption = "",
    mission: SomeMissionOption = None,
    timeout_s: TimeoutOption = 10.0,
    seat: ConnectionOptions = DEFAULT_CONNECTION,
    speedup: SpeedupOption = 1.0,
    json: JsonOption = False,
) -> int:
    """Let a mission start without a UAV that does not get ready.

    The others begin as soon as all of them are airborne, at once if they are. The UAV itself is
    told nothing: when it is ready after all, it joins in. Exit status 1: the coordinator was not
    seen to know of it, or the mission has started already.

    Examples:
        swarm start --without uav2
        swarm start --without uav2 --reason "no GPS" --keys keys/operator
    """
    from coordinator.operator.commands import StartRequest
    from coordinator.operator.submission import MissionConnection, check_reason_and_ids

    check_reason_and_ids(reason, ("--mission", mission), ("--without", without))
    reach = MissionConnection(mission, timeout_s, seat, speedup)
    return submit(StartRequest(without, reason), reach, "--without", json=json)


@with_options
def abort(
    yes: Annotated[bool, typer.Option("--yes", "-y", help="Do not ask on a terminal.")] = False,
    reason: ReasonOption = "",
    mission: SomeMissionOption = None,
    timeout_s: TimeoutOption = 10.0,
    seat: ConnectionOptions = DEFAULT_CONNECTION,
    speedup: SpeedupOption = 1.0,
    json: JsonOption = False,
) -> int:
    """Bring every UAV home at once and end the mission.

    Works without a coordinator; one that is started later ends the mission, too. Nothing
    takes an abort back. Exit status 1: somebody was not seen to obey, and the line says who.

    Examples:
        swarm abort
        swarm abort --yes --reason "thunderstorm" --mission valley-survey
    """
    from coordinator.operator.submission import MissionConnection
    from swarm.model.ids import FLEET

    reach = MissionConnection(mission, timeout_s, seat, speedup)
    asks = not yes and sys.stdin is not None and sys.stdin.isatty()
    what = "the mission" if mission is None else f"mission {mission}"
    if asks and not typer.confirm(f"Bring every UAV home and end {what}?", err=True):
        raise SwarmError("nothing was aborted")
    return _give("abort", FLEET, reason, reach, json=json)


_ADD_HELP = """Add a task to a running mission: the fleet takes it up like any other.

It is worth as much as the board's middle task unless told otherwise, and gets the next free id
of op1, op2, … (an id in the scenario's manner might be one that is yet to appear there). Works
without a coordinator. Exit status 1: nobody was seen to know of it, or nobody is left to do it.

\b
Examples:
    swarm task add --position 120,80
    swarm task add leak --position=-40,65,10 --value 8 --service-s 20 --kind inspect
    swarm task add --lat-deg 47.3981 --lon-deg 8.5470 --reason "smoke reported"
    swarm task add ridge --path 0,0 200,0 200,80 --opens-s 60 --due-s 600
"""
_WITHDRAW_HELP = """Take a task off the board of a running mission.

Who flies to it gives it up and takes another. Works without a coordinator. Exit status 1:
it is done or withdrawn already, or somebody was not seen to give it up.

\b
Examples:
    swarm task withdraw t7
    swarm task withdraw op1 --reason "seen from the ground"
"""
task = typer.Typer(
    help="Add a task to a running mission, or withdraw one.",
    rich_markup_mode=None,
    no_args_is_help=True,
)
LatOption = Annotated[
    float | None,
    typer.Option(
        "--lat-deg", min=-90.0, max=90.0, metavar="DEG", help="WGS84.", show_default=False
    ),
]
LonOption = Annotated[
    float | None,
    typer.Option(
        "--lon-deg", min=-180.0, max=180.0, metavar="DEG", help="WGS84.", show_default=False
    ),
]
AltOption = Annotated[
    float | None,
    typer.Option(
        "--alt-m",
        min=-1e7,
        max=1e7,
        metavar="M",
        help="Height above mean sea level. Default: that of the mission's origin.",
        show_default=False,
    ),
]


@task.command("add", help=_ADD_HELP, short_help="Add a task.", cls=PointsCommand)
@with_options
def add(
    name: Annotated[
        str | None, typer.Argument(metavar="ID", help="Default: the next free one.")
    ] = None,
    position: Annotated[
        str | None,
        typer.Option(
            "--position",
            metavar="E,N[,U]",
            help="Metres east, north and up of the mission's origin.",
            show_default=False,
        ),
    ] = None,
    lat_deg: LatOption = None,
    lon_deg: LonOption = None,
    alt_m: AltOption = None,
    value: Annotated[
        float | None,
        typer.Option(
            "--value",
            min=0.0,
            max=1e12,
            metavar="V",
            help="What a visit is worth. Default: the median of the board's.",
            show_default=False,
        ),
    ] = None,
    service_s: Annotated[
        float,
        typer.Option("--service-s", min=0.0, max=1e9, metavar="S", help="Time on the spot."),
    ] = 0.0,
    kind: Annotated[
        str | None,
        typer.Option(
            "--kind",
            metavar="KIND",
            help="By which UAVs have their success, as in the scenario.",
            show_default=False,
        ),
    ] = None,
    limits: TaskLimits = NO_LIMITS,
    reason: ReasonOption = "",
    mission: SomeMissionOption = None,
    timeout_s: TimeoutOption = 10.0,
    seat: ConnectionOptions = DEFAULT_CONNECTION,
    speedup: SpeedupOption = 1.0,
    json: JsonOption = False,
) -> int:
    """Add a task to a running mission."""
    from coordinator.operator.submission import MissionConnection, check_reason_and_ids
    from coordinator.operator.task_edits import NewTask

    check_reason_and_ids(reason, ("--mission", mission), ("ID", name), ("--kind", kind))
    path = limits.points
    place = None if path else _place(position, lat_deg, lon_deg, alt_m)
    if path and (position, lat_deg, lon_deg, alt_m) != (None, None, None, None):
        remedy = "give either a place, or the points of a line"
        raise InputError(Fault("swarm task add", "", "a place was given beside a line", remedy))
    try:
        wish = NewTask(
            place,
            name,
            value,
            service_s,
            kind,
            reason,
            limits.due_s,
            limits.opens_s,
            limits.closes_s,
            path,
            limits.height_m,
        )
    except ValueError as fault:
        remedy = "see swarm task add --help"
        raise InputError(Fault("swarm task add", "", str(fault), remedy)) from fault
    reach = MissionConnection(mission, timeout_s, seat, speedup)
    return submit(wish, reach, "ID", json=json)


@task.command("withdraw", help=_WITHDRAW_HELP, short_help="Take a task off the board.")
@with_options
def withdraw(
    name: Annotated[str, typer.Argument(metavar="ID", help="Id of the task.")],
    reason: ReasonOption = "",
    mission: SomeMissionOption = None,
    timeout_s: TimeoutOption = 10.0,
    seat: ConnectionOptions = DEFAULT_CONNECTION,
    speedup: SpeedupOption = 1.0,
    json: JsonOption = False,
) -> int:
    """Take a task off the board of a running mission."""
    from coordinator.operator.submission import MissionConnection, check_reason_and_ids
    from coordinator.operator.task_edits import TaskWithdrawal

    check_reason_and_ids(reason, ("--mission", mission), ("ID", name))
    reach = MissionConnection(mission, timeout_s, seat, speedup)
    return submit(TaskWithdrawal(name, reason), reach, "ID", json=json)


def _place(
    position: str | None, lat_deg: float | None, lon_deg: float | None, alt_m: float | None
) -> Point | Wgs84:
    """The place that the options tell of.

    Raises:
        InputError: they tell of none, or of two.
    """
    from coordinator.operator.task_edits import FARTHEST_M, Wgs84

    remedy = "give either --position, or --lat-deg and --lon-deg"
    if position is None:
        if lat_deg is None or lon_deg is None:
            raise InputError(Fault("swarm task add", "", "no place was given", remedy))
        return Wgs84(lat_deg, lon_deg, alt_m)
    if (lat_deg, lon_deg, alt_m) != (None, None, None):
        raise InputError(Fault("swarm task add", "", "two places were given", remedy))
    try:
        metres = [float(part) for part in position.split(",")]
    except ValueError:
        metres = []
    if len(metres) not in (2, 3):
        example = "give metres east, north and maybe up, such as 120,80 or 120,80,15"
        raise InputError(Fault("--position", "", f"{position!r} is no place", example))
    if not all(abs(each) <= FARTHEST_M for each in metres):
        bound = f"give metres within ±{FARTHEST_M:g}"
        raise InputError(Fault("--position", "", f"{position!r} is too far away", bound))
    return metres[0], metres[1], metres[2] if len(metres) == 3 else 0.0


def _give(name: str, target: str, reason: str, reach: MissionConnection, *, json: bool) -> int:
    """Give the command of that name, and say what came of it."""
    from coordinator.operator.commands import CommandRequest
    from coordinator.operator.submission import check_reason_and_ids
    from swarm.protocol.messages import CommandKind

    check_reason_and_ids(reason, ("--mission", reach.mission), ("UAV", target))
    return submit(CommandRequest(CommandKind(name), target, reason), reach, "UAV", json=json)


def submit(wish: OperatorRequest, reach: MissionConnection, source: str, *, json: bool) -> int:
    """Say what is wanted, and tell what came of it; ``source`` is the argument that it is about."""
    from json import dumps

    from coordinator.operator.submission import submit_request

    def tell(mission: str, client: OperatorClient, verdict: RequestVerdict) -> None:
        if json:
            print(dumps({"mission": mission} | client.as_json))
        elif client.obeyed:
            print(verdict.text)

    return submit_request(wish, reach, source=source, tell=tell)
