"""The command `swarm autopilot`."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from sim.autopilot.firmware import FirmwareModelName, check_simulated
from swarm.runtime.errors import remedy_for_name
from swarm.runtime.log import LogFormat, LogLevel, configure_logging, get_logger
from swarm.runtime.options import (
    JsonOption,
    LifelineOption,
    LogFormatOption,
    LogLevelOption,
    ScenarioArgument,
    SeedOption,
    SpeedupOption,
)

if TYPE_CHECKING:
    from agent.vehicle.signing import SigningKey
    from sim.autopilot.config import FleetMember
    from sim.autopilot.faults import VehicleFault
    from sim.autopilot.options import Endpoint

_FAULT_HELP = """Let something happen to a UAV: UAV:KIND@T or UAV:KIND@T+DURATION, in vehicle
seconds; T 0 is power-up, any other counts from the first arming. KIND: reboot, gps-lost,
battery-low (battery-low=0.2 says how low), silent, stuck, pilot, failsafe-rtl, refuse-arming,
reject-mission, wrong-id. May be repeated."""


def autopilot(
    scenario: ScenarioArgument,
    uav: Annotated[
        list[str] | None,
        typer.Option("--uav", metavar="ID", help="Simulate this UAV only; may be repeated."),
    ] = None,
    listen: Annotated[
        str,
        typer.Option(
            "--listen",
            metavar="URL",
            help="Where the first vehicle is offered: tcp:HOST:PORT, udpin:HOST:PORT or "
            "udpout:HOST:PORT; the next ones take the ports that follow. Port 0 takes free ones.",
        ),
    ] = "tcp:127.0.0.1:0",
    flavour: Annotated[
        FirmwareModelName,
        typer.Option("--flavour", help="Whose firmware the vehicles behave like."),
    ] = FirmwareModelName.ARDUPILOT,
    speedup: SpeedupOption = 1.0,
    system_id: Annotated[
        int | None,
        typer.Option(
            "--system-id",
            min=1,
            max=254,
            metavar="N",
            help="MAVLink system id of the first vehicle; default: its place in the scenario.",
        ),
    ] = None,
    signing_key: Annotated[
        Path | None,
        typer.Option(
            "--signing-key",
            metavar="PATH",
            help="Key of every vehicle, 32 bytes or 64 hexadecimal digits: it signs what it "
            "says and hears nobody who does not. Of a folder made by swarm keys, each takes its "
            "UAV's own.",
        ),
    ] = None,
    acceleration_m_s2: Annotated[
        float | None,
        typer.Option(
            "--acceleration-m-s2",
            min=0.01,
            metavar="A",
            help="Greatest acceleration [m/s²]; default: the scenario's, else at once.",
        ),
    ] = None,
    wind_m_s: Annotated[
        str | None,
        typer.Option(
            "--wind-m-s",
            metavar="EAST,NORTH",
            help="Steady wind, by where it blows to [m/s]; default: the scenario's.",
        ),
    ] = None,
    gust_m_s: Annotated[
        float,
        typer.Option("--gust-m-s", min=0.0, metavar="G", help="Speed of gusts [m/s]."),
    ] = 0.0,
    seed: SeedOption = 0,
    endurance_s: Annotated[
        float | None,
        typer.Option(
            "--endurance-s",
            min=1.0,
            metavar="S",
            help="Armed time that empties a battery [s]; default: the airborne time that the "
            "scenario says, else it stays full.",
        ),
    ] = None,
    swap_reboot: Annotated[
        bool,
        typer.Option(
            "--swap-reboot/--no-swap-reboot",
            help="Whether an autopilot loses its power while its battery is changed at a base.",
        ),
    ] = True,
    battery_failsafe: Annotated[
        bool,
        typer.Option(
            "--battery-failsafe", help="The firmware returns at 20 % of charge, and lands at 10 %."
        ),
    ] = False,
    position_failsafe_s: Annotated[
        float | None,
        typer.Option(
            "--position-failsafe-s",
            min=0.01,
            metavar="S",
            help="Without GPS for so long, the firmware lands [s]; default: it hovers.",
        ),
    ] = None,
    fault: Annotated[
        list[str] | None,
        typer.Option("--fault", metavar="UAV:KIND@T[+DURATION]", help=_FAULT_HELP),
    ] = None,
    json: JsonOption = False,
    lifeline: LifelineOption = False,
    log_level: LogLevelOption = LogLevel.INFO,
    log_format: LogFormatOption = LogFormat.AUTO,
) -> int:
    """Simulate autopilots that speak MAVLink 2 as firmwares do.

    They are those of a scenario's UAVs, like ArduCopter's or PX4's. Prints one JSON object per
    vehicle with the address to connect to, then runs until interrupted. With --json nothing else
    is printed.

    Examples:
        swarm autopilot table-1
        swarm autopilot table-1 --uav uav1 --listen udpin:127.0.0.1:14550 --speedup 5
        swarm autopilot table-1 --flavour px4
        swarm autopilot table-1 --acceleration-m-s2 2.5 --fault uav2:gps-lost@30+10
    """
    import asyncio
    import math

    from agent.vehicle.signing import load_signing_key, signing_key_of
    from sim.autopilot.config import BatteryFailsafe, Physics, fleet_of
    from sim.autopilot.options import (
        ENDPOINT_RULE,
        check_wind,
        faults_by_uav,
        parse_endpoint,
        parse_wind,
        require_finite,
    )
    from swarm.model import UavId
    from swarm.runtime.errors import Fault, InputError
    from swarm.runtime.process import run_until_stopped
    from swarm.scenario import load_scenario

    mission = load_scenario(scenario)
    configure_logging(log_level, log_format, mission=mission.name)
    known = [member.id for member in mission.uavs]
    unknown = [name for name in uav or () if name not in known]
    if unknown:
        told = ((name, remedy_for_name(name, known, "the scenario has")) for name in unknown)
        raise InputError(*(Fault("--uav", "", f"no UAV {name!r}", what) for name, what in told))
    try:
        endpoint = parse_endpoint(listen)
    except ValueError as error:
        problem = str(error).partition(";")[0]
        raise InputError(Fault("--listen", "", problem, ENDPOINT_RULE)) from error
    wanted = [UavId(name) for name in dict.fromkeys(uav)] if uav else None
    require_finite(
        acceleration_m_s2=acceleration_m_s2,
        gust_m_s=gust_m_s,
        endurance_s=endurance_s,
        position_failsafe_s=position_failsafe_s,
    )
    physics = Physics(
        acceleration_m_s2=acceleration_m_s2,
        wind_enu_m_s=None if wind_m_s is None else parse_wind(wind_m_s),
        gust_m_s=gust_m_s,
        seed=seed,
        endurance_s=endurance_s,
        battery_failsafe=BatteryFailsafe() if battery_failsafe else None,
        position_failsafe_s=position_failsafe_s,
        swap_reboots=swap_reboot,
    )
    if physics.wind_enu_m_s is not None:
        still = fleet_of(mission, wanted, system_id, Physics(wind_enu_m_s=(0.0, 0.0)))
        check_wind(math.hypot(*physics.wind_enu_m_s), still)
    faults = faults_by_uav(fault or (), known)
    fleet = fleet_of(mission, wanted, system_id, physics)
    check_simulated(flavour, [member.config.vehicle for member in fleet], "--flavour")
    keys: dict[str, SigningKey] = {}
    if signing_key is not None:
        keys = {each.uav: load_signing_key(signing_key_of(each.uav, signing_key)) for each in fleet}
    return asyncio.run(
        run_until_stopped(
            _serve(fleet, faults, endpoint, flavour, speedup, keys, quiet=json), lifeline=lifeline
        )
    )


async def _serve(
    fleet: tuple[FleetMember, ...],
    faults: dict[str, tuple[VehicleFault, ...]],
    endpoint: Endpoint,
    flavour: FirmwareModelName,
    speedup: float,
    keys: Mapping[str, SigningKey],
    *,
    quiet: bool,
) -> int:
    """Serve every vehicle until cancelled."""
    import asyncio
    import json

    from sim.autopilot.faulty_vehicle import FaultyAutopilot
    from sim.autopilot.firmware import firmware_model
    from sim.autopilot.server import ServedVehicle, VehicleServer
    from sim.autopilot.vehicle import SimulatedAutopilot
    from swarm.runtime.clock import ScaledClock
    from swarm.runtime.errors import Fault, InputError

    clock = ScaledClock(speedup)
    servers: list[VehicleServer] = []
    try:
        for place, member in enumerate(fleet):
            start_s = clock.now_s()
            vehicle: ServedVehicle
            vehicle = sound = SimulatedAutopilot(
                member.config, firmware_model(flavour, member.config.vehicle), start_s
            )
            if own_faults := faults.get(member.uav):
                vehicle = FaultyAutopilot(sound, own_faults, start_s)
            own = endpoint.shifted(place)
            key = keys.get(member.uav)
            secret = None if key is None else key.secret
            server = VehicleServer(vehicle, own, clock, signing_secret=secret)
            servers.append(server)
            try:
                await server.start()
            except (OSError, OverflowError) as error:
                where = f"{own.transport}:{own.host}:{own.port}"
                remedy = "choose another address, or port 0 for a free one"
                fault = Fault("--listen", where, f"cannot be opened ({error})", remedy)
                raise InputError(fault) from error
            line = {"uav": member.uav, "system_id": member.config.system_id, "url": server.url}
            print(json.dumps(line), flush=True)
        if not quiet:
            flown = f"{len(fleet)} simulated vehicle{'s' if len(fleet) > 1 else ''}"
            names = ", ".join(member.uav for member in fleet)
            text = f"{flown} at {speedup:g} times wall speed; Ctrl-C ends"
            get_logger("autopilot").info(text, uavs=names)
        await asyncio.Event().wait()
    finally:
        for server in servers:
            await server.close()
    return 0
