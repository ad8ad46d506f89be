"""The command `swarm agent`."""

from __future__ import annotations

import contextlib
from collections.abc import Sequence
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from agent.vehicle.config import CommandStyle
from swarm.bus.connection import DEFAULT_CONNECTION, ConnectionOptions
from swarm.runtime.log import LogFormat, LogLevel
from swarm.runtime.option_groups import with_options
from swarm.runtime.options import (
    CheckOption,
    LifelineOption,
    LogFormatOption,
    LogLevelOption,
    MissionOption,
    SpeedupOption,
    StateOption,
)

if TYPE_CHECKING:
    from agent.lives import Member
    from agent.runner import OnReport, Vehicle
    from swarm.identity import Identity
    from swarm.protocol.messages import MissionConfig
    from swarm.runtime.store import Memory, Store


@with_options
def agent(
    mission: MissionOption,
    uav: Annotated[
        list[str],
        typer.Option(
            "--uav",
            metavar="ID",
            help="UAV this agent flies. May be repeated where vehicles are simulated: one process "
            "is the agents of several UAVs then, and all are gone when it dies.",
        ),
    ],
    mavlink: Annotated[
        list[str],
        typer.Option(
            "--mavlink",
            metavar="URL",
            help="Its autopilot: tcp:HOST:PORT, udpin:HOST:PORT, udpout:HOST:PORT or "
            "serial:DEVICE:BAUD. Of several UAVs one each, in the same order.",
        ),
    ],
    system_id: Annotated[
        list[int] | None,
        typer.Option(
            "--system-id",
            min=1,
            max=255,
            metavar="N",
            help="MAVLink system id of the autopilot; no other vehicle is ever commanded. Of "
            "several UAVs one each; 1 by default.",
            show_default=False,
        ),
    ] = None,
    ground_id: Annotated[
        str,
        typer.Option(
            "--ground-id",
            metavar="SYS[:COMP]",
            help="Our own MAVLink ids towards the autopilot. Its ground station failsafe listens "
            "to system 255; QGroundControl is 255:190.",
        ),
    ] = "255:191",
    position_rate_hz: Annotated[
        float,
        typer.Option(
            "--position-rate-hz",
            min=0.1,
            max=400.0,
            metavar="HZ",
            help="How often the autopilot is asked to report its position.",
        ),
    ] = 10.0,
    acceptance_radius_m: Annotated[
        float,
        typer.Option(
            "--acceptance-radius-m",
            min=0.01,
            max=1000.0,
            metavar="M",
            help="Within this distance of a task, and stopped, the UAV has arrived.",
        ),
    ] = 1.0,
    signing_key: Annotated[
        Path | None,
        typer.Option(
            "--signing-key",
            metavar="FILE",
            help="Key shared with the autopilot, 32 bytes or 64 hexadecimal digits: what is "
            "said to it is signed, and what is not signed is not believed.",
            show_default=False,
        ),
    ] = None,
    forward: Annotated[
        list[str] | None,
        typer.Option(
            "--forward",
            metavar="URL",
            help="Show the vehicle, and what its UAV does, to a ground station at "
            "udp:HOST:PORT, which cannot command the vehicle there; may be repeated.",
            show_default=False,
        ),
    ] = None,
    station_actions: Annotated[
        bool,
        typer.Option(
            "--station-actions",
            help="Let these ground stations hold the UAV, let it go on or start again from a "
            "base, send it home and abort (MAV_CMD_USER_1 to 5). Beyond this machine only with "
            "--signing-key, and only if they sign.",
        ),
    ] = False,
    command: Annotated[
        CommandStyle,
        typer.Option(
            "--command",
            help="How targets are told: each at once, or each as a mission that ends in a "
            "return home, so that the vehicle comes back if its companion dies.",
        ),
    ] = CommandStyle.REPOSITION,
    accept_no_failsafe: Annotated[
        bool,
        typer.Option(
            "--accept-no-failsafe",
            help="Fly the vehicle although its own failsafes would not bring it home if this "
            "agent dies; without this it is not armed then. Missions bring it home anyway.",
        ),
    ] = False,
    battery_reserve: Annotated[
        float | None,
        typer.Option(
            "--battery-reserve",
            min=0.0,
            max=0.99,
            metavar="FRAC",
            help="Below this charge (0.2 is 20 %) the UAV goes home, and is not armed; 0 leaves "
            "the battery to the autopilot. Default: 0.2; of a UAV whose endurance the mission "
            "tells, half of its reserve, which the agent keeps by itself.",
            show_default=False,
        ),
    ] = None,
    keep_jerk: Annotated[
        bool,
        typer.Option(
            "--keep-jerk",
            help="Leave the vehicle's limit of jerk as it is: by default it is raised for the "
            "flight where that spares seconds of each leg (MPC_JERK_AUTO of PX4), and put back "
            "after it.",
        ),
    ] = False,
    ready_by_itself: Annotated[
        bool,
        typer.Option(
            "--ready-by-itself",
            help="The vehicle is simulated: landed for another battery it starts again once that "
            "is full. Without this a person has to say swarm ready first.",
        ),
    ] = False,
    fence_radius_m: Annotated[
        float,
        typer.Option(
            "--fence-radius-m",
            min=1.0,
            max=1e6,
            metavar="M",
            help="Farther than this from the mission's origin no target is flown to, and a UAV "
            "that is there goes home. Set it to your mission: the default is hardly a fence.",
        ),
    ] = 20_000.0,
    fence_height_m: Annotated[
        float,
        typer.Option(
            "--fence-height-m",
            min=1.0,
            max=1e5,
            metavar="M",
            help="The same for the height above the origin, or below it; set it too.",
        ),
    ] = 1_000.0,
    without_bus_s: Annotated[
        float | None,
        typer.Option(
            "--without-bus-s",
            min=0.1,
            max=86400.0,
            metavar="S",
            help="Go home when the own link to the bus has been down for that long, in wall "
            "seconds. Default: fly on with what is known.",
            show_default=False,
        ),
    ] = None,
    state: StateOption = None,
    rejoin: Annotated[
        bool,
        typer.Option(
            "--rejoin",
            help="Take part again although this UAV left the mission under way, sent home or "
            "taken over by its pilot.",
        ),
    ] = False,
    seat: ConnectionOptions = DEFAULT_CONNECTION,
    speedup: SpeedupOption = 1.0,
    check: CheckOption = False,
    lifeline: LifelineOption = False,
    log_level: LogLevelOption = LogLevel.INFO,
    log_format: LogFormatOption = LogFormat.AUTO,
) -> int:
    """Fly one UAV: decide, claim and command its autopilot.

    The agent learns the mission from the bus, so it needs no scenario file. Start one for
    each UAV, with the autopilot simulated or real. Prints one JSON object when it has joined.

    Examples:
      swarm agent --mission table-1 --uav uav1 --mavlink tcp:127.0.0.1:5760

      swarm agent --mission valley-survey --uav quad-2 --mavlink serial:/dev/ttyAMA0:921600
      --keys keys/quad-2 --connect tls/192.168.1.2:7447 --state /var/lib/peckorder
    """
    from agent.core.agent_core import AgentCore
    from agent.core.path_clearance import PATH_CLEARANCE_M
    from agent.core.verticals import Verticals
    from agent.links.mavlink_vehicle import MavlinkVehicle
    from agent.lives import Life, live, members_of
    from agent.vehicle.config import BridgeConfig, status_rate_for
    from agent.vehicle.signing import load_signing_key
    from swarm.bus.zenoh_bus import open_zenoh_bus
    from swarm.identity import Role
    from swarm.model import Origin
    from swarm.runtime.clock import ScaledClock, incarnation
    from swarm.runtime.log import configure_logging

    # A life begins with its process: of two agents of one UAV the one started last counts.
    life = incarnation()
    alone = {"uav": uav[0]} if len(uav) == 1 else {}
    configure_logging(log_level, log_format, mission=mission, **alone, incarnation=life)
    _check_ids(mission, uav)
    network = seat.network
    config = seat.config(mission=mission, roles=(Role.UAV,), name=uav[0])
    members = members_of(uav, mavlink, system_id or [1] * len(uav), config)
    shown = forward or ()
    _check_links(mavlink, shown, heeds=station_actions, signed=signing_key is not None)
    own_system_id, own_component_id = _ground_ids(ground_id)
    key = None if signing_key is None else load_signing_key(signing_key)
    if check:
        return 0
    if config.identity is not None and key is None:
        _tell_unsigned(uav[0], config.identity)

    def vehicle(flown: Member, brief: MissionConfig, report: OnReport) -> Vehicle:
        _tell_joined(mission, flown.uav)
        settings = BridgeConfig(
            system_id=flown.system_id,
            origin=Origin(*brief.origin),
            ground_system_id=own_system_id,
            ground_component_id=own_component_id,
            command=command,
            accept_no_failsafe=accept_no_failsafe,
            acceptance_radius_m=acceptance_radius_m,
            position_rate_hz=position_rate_hz,
            status_rate_hz=status_rate_for(position_rate_hz),
            battery_reserve_frac=_reserve_frac(battery_reserve, brief, flown.uav),
            raises_jerk=not keep_jerk,
            ready_by_itself=ready_by_itself,
            zones=tuple(spec.zone() for spec in brief.zones),
            zone_margin_m=brief.zone_margin_m,
            terrain=None if brief.terrain is None else brief.terrain.terrain(),
            fence_radius_m=fence_radius_m,
            fence_height_m=fence_height_m,
        ).for_speedup(speedup)
        asked = report if station_actions else None
        return MavlinkVehicle(
            settings, flown.mavlink, clock, report, key=key, forward=shown, on_asked=asked
        )

    def core(flown: Member, memory: Memory | None) -> AgentCore:
        return AgentCore(
            mission,
            flown.uav,
            life,
            network.timing.scaled(speedup),
            None if memory is None else memory.snapshot,
            0.0 if memory is None else memory.age_s,
            rejoin=rejoin,
            without_bus_s=None if without_bus_s is None else without_bus_s * speedup,
            path_clearance_m=PATH_CLEARANCE_M,
            verticals=Verticals(),
            shows_stations=bool(shown),
        )

    clock = ScaledClock(speedup)
    kept = partial(_store, state, mission, speedup)
    lives = [Life(m.uav, partial(core, m), partial(vehicle, m), kept(m.uav)) for m in members]
    seated = partial(open_zenoh_bus, config)
    answer_s = network.answer_s
    return live(lives, seated, clock, mission=mission, answer_s=answer_s, lifeline=lifeline)


def _store(folder: Path | None, mission: str, speedup: float, uav: str) -> Store | None:
    from swarm.runtime.store import Store

    return None if folder is None else Store(folder, mission, uav, speedup=speedup)


def _check_links(
    links: Sequence[str], forward: Sequence[str], *, heeds: bool, signed: bool
) -> None:
    from agent.vehicle.config import check_station_actions, parse_forward, parse_link

    for url in links:
        parse_link(url)
    for url in forward:
        parse_forward(url)
    if heeds:
        check_station_actions(forward, signed=signed)


def _tell_joined(mission: str, uav: str) -> None:
    """Tell whoever has started this process that it knows the mission and takes part."""
    import json

    with contextlib.suppress(OSError):  # nobody listens any more
        print(json.dumps({"mission": mission, "uav": uav}), flush=True)


def _tell_unsigned(uav: str, identity: Identity) -> None:
    from swarm.runtime.log import get_logger

    hint = f"give the autopilot its pass phrase, and --signing-key {identity.mavlink_key_path}"
    get_logger(uav).warning("what is said to the autopilot is not signed", hint=hint)


_RESERVE_FRAC = 0.2
_LAST_FRAC = 0.5
"""Of the reserve that an agent plans with: below that its plan has failed."""


def _reserve_frac(asked: float | None, brief: MissionConfig, uav: str) -> float | None:
    """Charge below which the bridge has the UAV go home; None leaves that to the autopilot."""
    if asked is not None:
        return asked or None
    for spec in brief.uavs:
        if spec.id == uav and spec.endurance_s is not None:
            return _LAST_FRAC * spec.reserve_frac or None
    return _RESERVE_FRAC


def _ground_ids(text: str) -> tuple[int, int]:
    """Our own system and component id."""
    from agent.vehicle.config import ONBOARD_COMPUTER
    from swarm.runtime.errors import Fault, InputError

    system, marked, component = text.partition(":")
    parts = [system, component if marked else str(ONBOARD_COMPUTER)]
    for part in parts:
        if not (part.isascii() and part.isdigit() and len(part) < 4 and 1 <= int(part) <= 255):
            problem = f"{part!r} is not a whole number within 1..255"
            raise InputError(Fault("--ground-id", text, problem, "give SYS or SYS:COMP"))
    return int(parts[0]), int(parts[1])


def _check_ids(mission: str, uavs: Sequence[str]) -> None:
    from swarm.model.ids import ID_RULE, RESERVED, valid_id
    from swarm.runtime.errors import Fault, InputError

    faults = [
        Fault(option, "", f"{text!r} is no id", f"give {ID_RULE}")
        for option, text in (("--mission", mission), *(("--uav", uav) for uav in uavs))
        if not valid_id(text)
    ]
    for uav in uavs:
        if uav in RESERVED:
            problem = f"{uav!r} is the name of {RESERVED[uav]}"
            faults.append(Fault("--uav", "", problem, "give a UAV's id"))
    if faults:
        raise InputError(*faults)
