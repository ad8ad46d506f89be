"""The command `swarm run`."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from coordinator.recording.options import RecordOption
from sim.options import MethodOption, ReportOption, check_flight
from swarm.protocol.timing import LinkKind
from swarm.runtime.errors import Fault, InputError, remedy_for_name
from swarm.runtime.options import (
    JsonOption,
    LinkOption,
    ScenarioArgument,
    SeedOption,
    SpeedupOption,
    complete_among,
)

if TYPE_CHECKING:
    from sim.fleet.autopilots import Autopilots
    from sim.fleet.layout import BusKind, LaunchOptions
    from sim.fleet.shown_run import ShownRun
    from swarm.model import Mission


def run(
    scenario: ScenarioArgument,
    method: MethodOption = "guided",
    speedup: SpeedupOption = 1.0,
    seed: SeedOption = 0,
    bus: Annotated[
        str,
        typer.Option(
            "--bus",
            metavar="auto|mesh|router",
            autocompletion=complete_among("auto", "mesh", "router"),
            help="How the processes reach each other; auto takes a mesh for small fleets.",
        ),
    ] = "auto",
    routers: Annotated[
        int,
        typer.Option(
            "--routers",
            min=1,
            max=8,
            metavar="N",
            help="Where routers are used: so many, linked to each other. With two or more the "
            "fleet keeps a router when one dies.",
        ),
    ] = 1,
    agents_per_process: Annotated[
        int,
        typer.Option(
            "--agents-per-process",
            min=1,
            max=100,
            metavar="N",
            help="How many UAVs' agents share a process, which costs less memory and processor "
            "time; when it dies, all of them are gone. Not with keys, and not for vehicles that "
            "run already.",
        ),
    ] = 1,
    link: LinkOption = LinkKind.NORMAL,
    autopilot: Annotated[
        str,
        typer.Option(
            "--autopilot",
            metavar="sim|sim-px4|ardupilot|px4|URL,…",
            autocompletion=complete_among("sim", "sim-px4", "ardupilot", "px4"),
            help="What flies: an autopilot simulated like ArduCopter or like PX4, real firmware "
            "in software-in-the-loop (PX4 1.16 or newer), or vehicles that run already, one URL "
            "for each UAV in the scenario's order or as UAV=URL; #ID at its end is the vehicle's "
            "system id, by default the UAV's place in the scenario.",
        ),
    ] = "sim",
    firmware: Annotated[
        Path | None,
        typer.Option(
            "--firmware",
            metavar="PATH",
            help="With ardupilot: the arducopter binary; default: SWARM_SITL_ARDUCOPTER (rovers "
            "and planes of the scenario: by SWARM_SITL_ROVER and SWARM_SITL_PLANE). With px4: "
            "a build folder such as build/px4_sitl_default; default: SWARM_SITL_PX4.",
        ),
    ] = None,
    command: Annotated[
        str | None,
        typer.Option(
            "--command",
            metavar="STYLE|UAV=STYLE,…",
            help="How vehicles are commanded: reposition or mission, for all or by UAV.",
        ),
    ] = None,
    forward: Annotated[
        list[str] | None,
        typer.Option(
            "--forward",
            metavar="udp:HOST:PORT",
            help="Show every vehicle to a ground station there, which cannot command them; may "
            "be repeated.",
        ),
    ] = None,
    station_actions: Annotated[
        bool,
        typer.Option(
            "--station-actions",
            help="Let these ground stations hold UAVs, let them go on, send them home and abort. "
            "See swarm agent.",
        ),
    ] = False,
    signing_key: Annotated[
        Path | None,
        typer.Option(
            "--signing-key",
            metavar="PATH",
            help="Sign what is said to the vehicles, and believe nothing that is not; see swarm "
            "agent. Of a folder made by swarm keys, each vehicle has its UAV's own.",
        ),
    ] = None,
    battery_reserve: Annotated[
        float | None,
        typer.Option(
            "--battery-reserve",
            min=0.0,
            max=0.99,
            metavar="FRAC",
            help="Charge below which a UAV goes home; 0 leaves the battery to the autopilot. See "
            "swarm agent.",
        ),
    ] = None,
    keep_jerk: Annotated[
        bool,
        typer.Option(
            "--keep-jerk",
            help="Leave the vehicles' limits of jerk as they are. See swarm agent.",
        ),
    ] = False,
    fence_radius_m: Annotated[
        float | None,
        typer.Option(
            "--fence-radius-m",
            min=1.0,
            max=1e6,
            metavar="M",
            help="Distance from the mission's origin beyond which no UAV is sent, and from where "
            "it goes home. Default: 1.2 times that of the farthest start or task, and 200 m.",
        ),
    ] = None,
    fence_height_m: Annotated[
        float | None,
        typer.Option(
            "--fence-height-m",
            min=1.0,
            max=1e5,
            metavar="M",
            help="The same for the height above the origin, or below it. Default: 50 m above the "
            "highest layer over the highest start or task.",
        ),
    ] = None,
    accept_no_failsafe: Annotated[
        bool,
        typer.Option(
            "--accept-no-failsafe",
            help="Fly vehicles that run already although their own failsafes would not bring "
            "them home; see swarm agent. What a run starts itself is flown anyway.",
        ),
    ] = False,
    without_bus_s: Annotated[
        float | None,
        typer.Option(
            "--without-bus-s",
            min=0.1,
            max=86400.0,
            metavar="S",
            help="UAVs go home when their link to the bus has been down for so many wall "
            "seconds; see swarm agent.",
        ),
    ] = None,
    fault: Annotated[
        list[str] | None,
        typer.Option(
            "--fault",
            metavar="UAV:KIND@T+DURATION",
            help="Something that befalls a simulated autopilot; may be repeated. See swarm "
            "autopilot.",
        ),
    ] = None,
    position_rate_hz: Annotated[
        float | None,
        typer.Option(
            "--position-rate-hz",
            min=1.0,
            max=200.0,
            metavar="HZ",
            help="Position reports of each autopilot per wall second. Default: 100 of simulated "
            "ones, less for more than 20 UAVs; 50 of firmware, less for more than 10; else 10.",
        ),
    ] = None,
    acceptance_radius_m: Annotated[
        float | None,
        typer.Option(
            "--acceptance-radius-m",
            min=0.01,
            max=1000.0,
            metavar="M",
            help="Within this distance of a task, and stopped, a UAV has arrived. Default: 0.5 "
            "for simulated autopilots, else 2.",
        ),
    ] = None,
    start_timeout_s: Annotated[
        float | None,
        typer.Option(
            "--start-timeout-s",
            min=1.0,
            metavar="S",
            help="UAVs that are not airborne by then are given up; mission seconds, or wall "
            "seconds where the mission runs faster. Default: 120 for simulated autopilots, more "
            "for more than 100 UAVs, else 300.",
        ),
    ] = None,
    dashboard: Annotated[
        str | None,
        typer.Option(
            "--dashboard",
            metavar="[ADDRESS:]PORT",
            help="Also show the run in a browser, and let an operator step in there, until it "
            "ends; 0: any port that is free. See swarm dashboard.",
        ),
    ] = None,
    secure: Annotated[
        bool,
        typer.Option(
            "--secure",
            help="Fly with new keys, made for this run alone: encrypted links, access control, "
            "signed statements and, with simulated autopilots, signed MAVLink.",
        ),
    ] = False,
    keys: Annotated[
        Path | None,
        typer.Option(
            "--keys",
            metavar="DIR",
            help="The same with keys made before: the folder in which swarm keys init made them.",
        ),
    ] = None,
    report: ReportOption = None,
    record: RecordOption = None,
    logs: Annotated[
        Path | None,
        typer.Option(
            "--logs",
            metavar="DIR",
            help="Keep what every process logs: a file of JSON lines each, in that folder.",
        ),
    ] = None,
    any_size: Annotated[
        bool,
        typer.Option(
            "--any-size", help="Fly the fleet although this machine seems too small for it."
        ),
    ] = False,
    json: JsonOption = False,
    verbose: Annotated[
        bool, typer.Option("--verbose", help="Show what every process logs, instead of a picture.")
    ] = False,
) -> int:
    """Fly a mission with real processes on this machine, and report.

    Starts the bus, the coordinator and, for every UAV, an agent and a simulated autopilot;
    shows the mission live and ends with a report. Exit status 0: every task was done.
    Instead of simulated autopilots it starts real firmware, or none where vehicles run.

    Examples:
        swarm run table-1
        swarm run valley-survey --speedup 20 --report flight.md --logs logs
        swarm run valley-survey --dashboard 8080
        swarm run valley-survey --secure --speedup 20
        swarm run valley-survey --autopilot sim-px4 --command mission --speedup 20
        swarm run valley-survey --speedup 20 --fault uav03:pilot@60
        swarm run meadow --autopilot ardupilot --firmware ~/ardupilot/build/sitl/bin/arducopter
        SWARM_SITL_PX4=~/PX4-Autopilot/build/px4_sitl_default swarm run meadow --autopilot px4
        swarm run pair.toml --autopilot udpin:0.0.0.0:14550,serial:/dev/ttyUSB0:57600#7
        swarm run table-1 --json
    """
    import os

    from coordinator.dashboard.access import parse_serve_address
    from sim.fleet.autopilots import (
        RunningVehicles,
        SimulatedAutopilots,
        check_commanded,
        check_speedup,
        parse_autopilots,
    )
    from sim.fleet.firmware import SitlFirmware
    from sim.fleet.layout import LaunchOptions, defaults_for
    from sim.fleet.passthrough import (
        PassthroughOptions,
        check_passthrough,
        fence_around,
        parse_command_styles,
    )
    from sim.fleet.shown_run import Outputs, ShownRun
    from swarm.model.mission import kinds_of
    from swarm.protocol.timing import preset
    from swarm.runtime.log import LogFormat, LogLevel, configure_logging
    from swarm.scenario import load_scenario

    check_flight(method, report, record)
    mission = load_scenario(scenario)
    uavs = [uav.id for uav in mission.uavs]
    autopilots = parse_autopilots(autopilot, uavs, firmware, os.environ, kinds_of(mission))
    check_speedup(autopilots, speedup)
    if isinstance(autopilots, SimulatedAutopilots) and not any_size:
        _check_size(scenario, mission, agents_per_process)
    if agents_per_process > 1:
        _check_sharing(autopilots, bus, secure=secure or keys is not None)
    passthrough = PassthroughOptions(
        command=parse_command_styles(command, uavs),
        forward=tuple(forward or ()),
        station_actions=station_actions,
        signing_key=signing_key,
        battery_reserve=battery_reserve,
        keep_jerk=keep_jerk,
        fence=fence_around(mission, fence_radius_m, fence_height_m),
        without_bus_s=without_bus_s,
        # Firmware that is started here flies in a simulator, with parameters of its own.
        accept_no_failsafe=accept_no_failsafe or isinstance(autopilots, SitlFirmware),
        ready_by_itself=not isinstance(autopilots, RunningVehicles),
        faults=tuple(fault or ()),
    )
    check_commanded(mission, passthrough.command)
    check_passthrough(passthrough, autopilots, uavs)
    defaults = defaults_for(autopilots, len(uavs))
    plain = LaunchOptions(
        scenario=scenario,
        method=method,
        seed=seed,
        speedup=speedup,
        bus=_bus_kind(bus),
        position_rate_hz=position_rate_hz or defaults.position_rate_hz,
        acceptance_radius_m=acceptance_radius_m or defaults.acceptance_radius_m,
        start_timeout_s=start_timeout_s or defaults.start_timeout_s,
        routers=routers,
        agents_per_process=agents_per_process,
        link=link,
        autopilots=autopilots,
        passthrough=passthrough,
        dashboard=None if dashboard is None else parse_serve_address(dashboard),
        log_format=LogFormat.AUTO if logs is None else LogFormat.JSON,
    )
    configure_logging(LogLevel.WARNING)
    shown = ShownRun(
        mission,
        Path(scenario),
        speedup,
        preset(link).timing.scaled(speedup),
        Outputs(json=json, report=report, record=record, logs=logs, verbose=verbose),
    )
    shown.warn(plain)
    return _fly(shown, mission, plain, secure=secure, keys=keys)


def _fly(
    shown: ShownRun, mission: Mission, plain: LaunchOptions, *, secure: bool, keys: Path | None
) -> int:
    """Fly it, protected as asked; the exit status of the command."""
    import asyncio

    from sim.fleet.security import protected
    from swarm.runtime.process import run_until_stopped

    with protected(mission, plain, secure=secure, keys=keys) as options:
        return asyncio.run(run_until_stopped(shown.fly(options)))


def _check_sharing(autopilots: Autopilots, bus: str, *, secure: bool) -> None:
    """Refuse to let UAVs share a process that are to depend on nothing but their own."""
    from sim.fleet.autopilots import RunningVehicles

    problem = None
    if isinstance(autopilots, RunningVehicles):
        problem = "vehicles that run already have a process each"
    elif secure:
        problem = "each UAV has keys of its own, and a process those of one"
    elif bus == "mesh":
        problem = "in a mesh each UAV has a process of its own"
    if problem is not None:
        raise InputError(Fault("--agents-per-process", "", problem, "leave it out"))


def _check_size(scenario: Path, mission: Mission, agents_per_process: int) -> None:
    """Refuse a fleet that this machine cannot fly, before anything starts."""
    from sim.fleet.capacity import MANY, memory_bytes, too_large, usable_cores
    from sim.fleet.layout import VEHICLES_PER_PROCESS

    machine = len(mission.uavs), usable_cores(), memory_bytes()
    apart = mission.separation_m is not None
    reason = too_large(*machine, agents_per_process, keeps_apart=apart)
    if reason is None:
        return
    shared = too_large(*machine, MANY, keeps_apart=apart) is None
    way = f"let UAVs share processes with --agents-per-process {VEHICLES_PER_PROCESS}"
    way = way if shared else "fly it on several machines (deploy/README.md)"
    remedy = f"{way}, or all the same with --any-size"
    raise InputError(Fault(str(scenario), "uav", reason, remedy))


def _bus_kind(text: str) -> BusKind:
    from sim.fleet.layout import BusKind

    try:
        return BusKind(text)
    except ValueError:
        remedy = remedy_for_name(text, BusKind)
        raise InputError(Fault("--bus", text, "no such bus", remedy)) from None
