"""The commands `swarm run` and `swarm simulate`.

Leaves out: what they do (sim.launch, sim.world) and how it is shown (coordinator.view).
"""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from sim.uncertainty_options import (
    CoordinatorLostOption,
    DelayOption,
    JitterOption,
    LegSdOption,
    LossOption,
    MessageLossOption,
    OutcomesOption,
    PartitionLengthOption,
    PartitionRateOption,
    PopupOption,
    PopupRateOption,
    PositionErrorOption,
    ReattemptOption,
    SpeedSdOption,
    SurvivalOption,
    WindOption,
    WithdrawRateOption,
    asked_for,
    with_reattempts,
)
from swarm.config import Link
from swarm.errors import Fault, InputError
from swarm.options import JsonOption, LinkOption, ScenarioArgument, SeedOption, SpeedupOption

if TYPE_CHECKING:
    from coordinator.view.report import MissionReport
    from sim.launch.fleet import BusKind

__all__ = ["run", "simulate"]

MethodOption = Annotated[
    str,
    typer.Option("--method", metavar="METHOD", help="Decision rule: greedy, lookahead or guided."),
]

ReportOption = Annotated[
    Path | None,
    typer.Option(
        "--report",
        metavar="FILE",
        help="Also write the report, as .json or .md.",
        show_default=False,
    ),
]


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
    link: LinkOption = Link.NORMAL,
    autopilot: Annotated[
        str,
        typer.Option(
            "--autopilot",
            metavar="sim|sim-px4|ardupilot|px4|URL,…",
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
            help="With ardupilot: the arducopter binary; default: SWARM_SITL_ARDUCOPTER. With "
            "px4: a build folder such as build/px4_sitl_default; default: SWARM_SITL_PX4.",
            show_default=False,
        ),
    ] = None,
    command: Annotated[
        str | None,
        typer.Option(
            "--command",
            metavar="STYLE|UAV=STYLE,…",
            help="How vehicles are commanded: reposition or mission, for all or by UAV.",
            show_default=False,
        ),
    ] = None,
    forward: Annotated[
        list[str] | None,
        typer.Option(
            "--forward",
            metavar="udp:HOST:PORT",
            help="Show every vehicle to a ground station there, which cannot command them; may "
            "be repeated.",
            show_default=False,
        ),
    ] = None,
    signing_key: Annotated[
        Path | None,
        typer.Option(
            "--signing-key",
            metavar="FILE",
            help="Sign what is said to the vehicles, and believe nothing that is not; see swarm "
            "agent.",
            show_default=False,
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
            show_default=False,
        ),
    ] = None,
    fence_radius_m: Annotated[
        float | None,
        typer.Option(
            "--fence-radius-m",
            min=1.0,
            max=1e6,
            metavar="M",
            help="Distance from the mission's origin beyond which no UAV is sent, and from where "
            "it goes home. Default: 1.2 times that of the farthest start or task, and 200 m.",
            show_default=False,
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
            show_default=False,
        ),
    ] = None,
    without_bus_s: Annotated[
        float | None,
        typer.Option(
            "--without-bus-s",
            min=0.1,
            max=86400.0,
            metavar="S",
            help="UAVs go home when their link to the bus has been down for so many wall "
            "seconds; see swarm agent.",
            show_default=False,
        ),
    ] = None,
    fault: Annotated[
        list[str] | None,
        typer.Option(
            "--fault",
            metavar="UAV:KIND@T+DURATION",
            help="Something that befalls a simulated autopilot; may be repeated. See swarm "
            "autopilot.",
            show_default=False,
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
            show_default=False,
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
            show_default=False,
        ),
    ] = None,
    start_timeout_s: Annotated[
        float | None,
        typer.Option(
            "--start-timeout-s",
            min=1.0,
            metavar="S",
            help="UAVs that are not airborne by then are given up; mission seconds, or wall "
            "seconds where the mission runs faster. Default: 120 for simulated autopilots, "
            "else 300.",
            show_default=False,
        ),
    ] = None,
    report: ReportOption = None,
    json: JsonOption = False,
    verbose: Annotated[
        bool, typer.Option("--verbose", help="Show what every process logs, instead of a picture.")
    ] = False,
) -> int:
    """Fly a mission with real processes on this machine and report how it went.

    Starts the bus, the coordinator and, for every UAV, an agent and a simulated autopilot;
    shows the mission live and ends with a report. Exit status 0: every task was done.
    Instead of simulated autopilots it starts real firmware, or none where vehicles run.

    Examples:
        swarm run table-1
        swarm run valley-survey --speedup 20 --report flight.md
        swarm run valley-survey --autopilot sim-px4 --command mission --speedup 20
        swarm run valley-survey --speedup 20 --fault uav03:pilot@60
        swarm run meadow --autopilot ardupilot --firmware ~/ardupilot/build/sitl/bin/arducopter
        SWARM_SITL_PX4=~/PX4-Autopilot/build/px4_sitl_default swarm run meadow --autopilot px4
        swarm run pair.toml --autopilot udpin:0.0.0.0:14550,serial:/dev/ttyUSB0:57600#7
        swarm run table-1 --json
    """
    import asyncio
    import os
    import sys

    from rich.console import Console

    from coordinator.planner.plan import check_online_method
    from coordinator.view.live import LiveView
    from coordinator.view.report import MissionReport, check_report_path
    from sim.launch.autopilots import check_speedup, parse_autopilots
    from sim.launch.fence import fence_around
    from sim.launch.fleet import LaunchOptions, defaults_for
    from sim.launch.handed_on import HandedOn, check_handed_on, parse_command_styles
    from sim.launch.run import fly
    from swarm.log import LogLevel, configure_logging
    from swarm.process import run_until_stopped
    from swarm.scenario import load_scenario

    check_online_method(method)
    if report is not None:
        check_report_path(report)
    mission = load_scenario(scenario)
    uavs = [uav.id for uav in mission.uavs]
    autopilots = parse_autopilots(autopilot, uavs, firmware, os.environ)
    check_speedup(autopilots, speedup)
    handed_on = HandedOn(
        command=parse_command_styles(command, uavs),
        forward=tuple(forward or ()),
        signing_key=signing_key,
        battery_reserve=battery_reserve,
        fence=fence_around(mission, fence_radius_m, fence_height_m),
        without_bus_s=without_bus_s,
        faults=tuple(fault or ()),
    )
    check_handed_on(handed_on, autopilots, uavs)
    defaults = defaults_for(autopilots, len(uavs))
    options = LaunchOptions(
        scenario=scenario,
        method=method,
        seed=seed,
        speedup=speedup,
        bus=_bus_kind(bus),
        position_rate_hz=position_rate_hz or defaults.position_rate_hz,
        acceptance_radius_m=acceptance_radius_m or defaults.acceptance_radius_m,
        start_timeout_s=start_timeout_s or defaults.start_timeout_s,
        routers=routers,
        link=link,
        autopilots=autopilots,
        handed_on=handed_on,
    )
    configure_logging(LogLevel.WARNING)
    # With every process's log on the screen, a picture would only be torn apart.
    console = Console(stderr=True, force_terminal=False if verbose else None)

    def log(name: str, line: str) -> None:
        print(f"{name}: {line}", file=sys.stderr)

    async def work() -> int:
        try:
            with LiveView(console, speedup=speedup) as view:
                flight = await fly(
                    mission, options, on_frame=view.update, on_log=log if verbose else None
                )
        except asyncio.CancelledError:
            console.print("interrupted: the mission was given up and every process ended")
            raise
        told = MissionReport(
            mission=flight.observer.mission,
            plan=flight.plan,
            result=flight.result,
            story=tuple(flight.observer.story),
            takeoff_s=flight.takeoff_s,
            wall_s=flight.wall_s,
            speedup=speedup,
            fates=flight.fates,
        )
        return _tell(told, json=json, report=report)

    return asyncio.run(run_until_stopped(work()))


def simulate(
    scenario: ScenarioArgument,
    method: MethodOption = "greedy",
    seed: SeedOption = 0,
    loss: LossOption = None,
    popup: PopupOption = None,
    popup_rate: PopupRateOption = None,
    withdraw_rate: WithdrawRateOption = None,
    outcomes: OutcomesOption = None,
    reattempt: ReattemptOption = None,
    survival: SurvivalOption = None,
    speed_sd: SpeedSdOption = None,
    leg_sd: LegSdOption = None,
    wind: WindOption = None,
    position_error_m: PositionErrorOption = None,
    message_loss: MessageLossOption = None,
    delay_s: DelayOption = None,
    jitter_s: JitterOption = None,
    partition_rate: PartitionRateOption = None,
    partition_s: PartitionLengthOption = None,
    coordinator_lost_s: CoordinatorLostOption = None,
    faults: Annotated[
        str | None,
        typer.Option(
            "--faults",
            metavar="KINDS|FILE",
            help="Let more go wrong: kinds of fault with commas between, all, or a file with a "
            "schedule of them.",
            show_default=False,
        ),
    ] = None,
    report: ReportOption = None,
    json: JsonOption = False,
) -> int:
    """Fly a mission in virtual time: the agents' and the coordinator's real code, no sockets.

    Unless told otherwise nothing is uncertain: vehicles and network are ideal, and the lists flown
    are exactly those planned. Each kind of uncertainty is drawn from the seed by itself, so asking
    for one leaves what the others draw as it was.
    With --faults the network and the clocks are like real ones, what goes wrong is told
    on standard error in lines that a file may hold, and the invariants of a fleet are watched.
    Exit status 0: every task was done, and no invariant broken.

    Examples:
        swarm simulate table-1
        swarm simulate valley-survey --loss 0.3 --popup 0.3 --seed 7
        swarm simulate valley-survey --method guided --loss 0.3 --coordinator-lost-s 0
        swarm simulate table-1 --outcomes --reattempt --seed 1
        swarm simulate valley-survey --speed-sd 0.1 --leg-sd 0.1 --wind 5
        swarm simulate valley-survey --message-loss 0.2 --delay-s 0.05 --jitter-s 0.05
        swarm simulate valley-survey --faults cut,crash --seed 7
    """
    import sys

    from coordinator.planner.plan import check_online_method
    from coordinator.view.report import MissionReport, check_report_path
    from sim.faults.replay import fly_with_faults
    from sim.faults.schedule import format_schedule
    from sim.simulate import simulate_mission
    from sim.uncertainty import Uncertainty
    from swarm.scenario import load_scenario

    check_online_method(method)
    if report is not None:
        check_report_path(report)
    uncertainty = asked_for(Uncertainty(), loss=loss, popup=popup, popups_per_min=popup_rate)
    beside_faults = uncertainty
    uncertainty = asked_for(
        uncertainty,
        withdrawals_per_min=withdraw_rate,
        outcomes=outcomes,
        survival=survival,
        speed_sd_frac=speed_sd,
        leg_sd_frac=leg_sd,
        wind_m_s=wind,
        position_error_m=position_error_m,
        message_loss=message_loss,
        delay_s=delay_s,
        jitter_s=jitter_s,
        partitions_per_min=partition_rate,
        partition_s=partition_s,
    )
    mission = with_reattempts(load_scenario(scenario), reattempt=reattempt)
    if faults is None:
        flown = simulate_mission(
            mission,
            method=method,
            seed=seed,
            uncertainty=uncertainty,
            coordinator_lost_s=coordinator_lost_s,
        )
        if not flown.in_time:
            print("broken off: somebody would have waited for ever", file=sys.stderr)
        told = MissionReport(
            mission=flown.world.mission,
            plan=flown.world.observer.plan,
            result=flown.result,
            story=tuple(flown.world.observer.story),
            lost_because=flown.lost_because,
            value=flown.value,
        )
        return _tell(told, json=json, report=report)
    if uncertainty != beside_faults or coordinator_lost_s is not None:
        problem = "goes with --loss, --popup and --popup-rate only"
        remedy = "leave the others out, or ask for kinds of fault such as weather, cut or slow"
        raise InputError(Fault("--faults", faults, problem, remedy))
    verdict = fly_with_faults(
        mission, method=method, seed=seed, uncertainty=uncertainty, faults=faults
    )
    print(format_schedule(verdict.case.schedule), end="", file=sys.stderr)
    if verdict.broken is not None:
        print(f"broken: {verdict.broken}", file=sys.stderr)
    world = verdict.world
    told = MissionReport(
        mission=world.observer.mission,
        plan=world.observer.plan,
        result=world.observer.result(),
        story=tuple(world.observer.story),
    )
    status = _tell(told, json=json, report=report)
    return status if verdict.broken is None else 1


def _bus_kind(text: str) -> BusKind:
    from sim.launch.fleet import BusKind

    try:
        return BusKind(text)
    except ValueError:
        remedy = f"choose one of {', '.join(BusKind)}"
        raise InputError(Fault("--bus", text, "no such bus", remedy)) from None


def _tell(told: MissionReport, *, json: bool, report: Path | None) -> int:
    """Print and write the report; the exit status of the command."""
    from json import dumps

    from rich.console import Console

    from coordinator.view.report import mission_ok, write_report

    if json:
        print(dumps(told.as_json(), allow_nan=False))
    else:
        told.render(Console(highlight=False))
    if report is not None:  # last: a full disk must not hide the result
        write_report(told, report)
    return 0 if mission_ok(told.result) else 1
