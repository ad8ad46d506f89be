"""The command `swarm autopilot`.

Leaves out: everything but options and output.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Annotated

import typer

from sim.autopilot.flavours import FlavourName
from swarm.options import JsonOption, LifelineOption, ScenarioArgument, SpeedupOption

if TYPE_CHECKING:
    from sim.autopilot.endpoint import Endpoint
    from sim.autopilot.fleet import FleetMember

__all__ = ["autopilot"]


def autopilot(
    scenario: ScenarioArgument,
    uav: Annotated[
        list[str] | None,
        typer.Option(
            "--uav",
            metavar="ID",
            help="Simulate this UAV only; may be repeated.",
            show_default=False,
        ),
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
        FlavourName, typer.Option("--flavour", help="Whose firmware the vehicles behave like.")
    ] = FlavourName.ARDUPILOT,
    speedup: SpeedupOption = 1.0,
    system_id: Annotated[
        int | None,
        typer.Option(
            "--system-id",
            min=1,
            max=254,
            metavar="N",
            help="MAVLink system id of the first vehicle; default: its place in the scenario.",
            show_default=False,
        ),
    ] = None,
    json: JsonOption = False,
    lifeline: LifelineOption = False,
) -> int:
    """Simulate the autopilots of a scenario's UAVs, speaking MAVLink 2 like ArduCopter or PX4.

    Prints one JSON object per vehicle with the address to connect to, then runs
    until interrupted. With --json nothing else is printed.

    Examples:
        swarm autopilot table-1
        swarm autopilot table-1 --uav uav1 --listen udpin:127.0.0.1:14550 --speedup 5
        swarm autopilot table-1 --flavour px4
    """
    import asyncio

    from sim.autopilot.endpoint import ENDPOINT_RULE, parse_endpoint
    from sim.autopilot.fleet import fleet_of
    from swarm.errors import Fault, InputError
    from swarm.model import UavId
    from swarm.process import run_until_stopped
    from swarm.scenario import load_scenario

    mission = load_scenario(scenario)
    known = [member.id for member in mission.uavs]
    unknown = [name for name in uav or () if name not in known]
    if unknown:
        remedy = f"the scenario has {', '.join(known)}"
        raise InputError(*(Fault("--uav", "", f"no UAV {name!r}", remedy) for name in unknown))
    try:
        endpoint = parse_endpoint(listen)
    except ValueError as error:
        raise InputError(Fault("--listen", "", str(error).partition(";")[0], ENDPOINT_RULE)) from (
            error
        )
    wanted = [UavId(name) for name in dict.fromkeys(uav)] if uav else None
    fleet = fleet_of(mission, wanted, system_id)
    return asyncio.run(
        run_until_stopped(_serve(fleet, endpoint, flavour, speedup, quiet=json), lifeline=lifeline)
    )


async def _serve(
    fleet: tuple[FleetMember, ...],
    endpoint: Endpoint,
    flavour: FlavourName,
    speedup: float,
    *,
    quiet: bool,
) -> int:
    """Serve every vehicle until cancelled."""
    import asyncio
    import json
    import sys

    from sim.autopilot.flavours import flavour_of
    from sim.autopilot.server import VehicleServer
    from sim.autopilot.vehicle import Vehicle
    from swarm.clock import ScaledClock
    from swarm.errors import Fault, InputError

    clock = ScaledClock(speedup)
    servers: list[VehicleServer] = []
    try:
        for place, member in enumerate(fleet):
            vehicle = Vehicle(member.config, flavour_of(flavour), clock.now_s())
            own = endpoint.shifted(place)
            server = VehicleServer(vehicle, own, clock)
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
            print(f"{flown} at {speedup:g} times wall speed; Ctrl-C ends.", file=sys.stderr)
        await asyncio.Event().wait()
    finally:
        for server in servers:
            await server.close()
    return 0
