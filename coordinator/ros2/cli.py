"""The command `swarm ros2`."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from swarm.bus.config import ENDPOINT, ENDPOINT_REMEDY, is_encrypted, is_loopback
from swarm.bus.connection import DEFAULT_CONNECTION, ConnectionOptions
from swarm.runtime.errors import BusError, Fault, InputError
from swarm.runtime.log import LogFormat, LogLevel
from swarm.runtime.option_groups import with_options
from swarm.runtime.options import (
    CheckOption,
    LifelineOption,
    LogFormatOption,
    LogLevelOption,
    SomeMissionOption,
    SpeedupOption,
)

if TYPE_CHECKING:
    from swarm.bus.port import Bus

MOST_DOMAIN_ID = 232
"""As far as ROS 2 takes them on every system."""


@with_options
def ros2(
    mission: SomeMissionOption = None,
    ros_router: Annotated[
        str,
        typer.Option(
            "--ros-router",
            metavar="ENDPOINT",
            help="Zenoh router of the ROS 2 graph on this machine, such as rmw_zenohd.",
        ),
    ] = "tcp/127.0.0.1:7447",
    ros_config: Annotated[
        Path | None,
        typer.Option(
            "--ros-config",
            metavar="FILE",
            help="Zenoh configuration file of the session with ROS 2, instead of a router on this "
            "machine: it is taken as it is, and may name other machines and certificates.",
            show_default=False,
        ),
    ] = None,
    domain_id: Annotated[
        int,
        typer.Option(
            "--domain-id",
            min=0,
            max=MOST_DOMAIN_ID,
            envvar="ROS_DOMAIN_ID",
            metavar="N",
            help="Domain of the ROS 2 graph.",
        ),
    ] = 0,
    node: Annotated[
        str,
        typer.Option("--node", metavar="NAME", help="Name of the node; its topics begin with it."),
    ] = "peckorder",
    rate_hz: Annotated[
        float,
        typer.Option(
            "--rate-hz",
            min=0.1,
            max=10.0,
            metavar="HZ",
            help="How often to look for what has changed; what has not is repeated every second.",
        ),
    ] = 2.0,
    services: Annotated[
        bool,
        typer.Option(
            "--services",
            help="Offer services that add and withdraw tasks, hold, resume and return: whoever is "
            "in the ROS 2 graph may then give such orders. Keys have to be an operator's.",
        ),
    ] = False,
    seat: ConnectionOptions = DEFAULT_CONNECTION,
    speedup: SpeedupOption = 1.0,
    check: CheckOption = False,
    lifeline: LifelineOption = False,
    log_level: LogLevelOption = LogLevel.INFO,
    log_format: LogFormatOption = LogFormat.AUTO,
) -> int:
    """Show a mission to ROS 2, and take orders from there.

    Joins a mission as an observer, or waits for one, and tells status, claims, tasks, plan and
    positions as ROS 2 messages by the keys of rmw_zenoh, so that ros2 topic list, rviz and nodes
    of one's own see them. ROS 2 need not be installed here. Nobody flies any differently while
    nobody asks for it. Ctrl-C ends it, and nothing else.

    Examples:
        swarm ros2
        swarm ros2 --services --ros-router tcp/127.0.0.1:7448
        swarm ros2 --keys keys/viewer --connect tls/192.168.1.2:7447 --ros-config zenoh.json5
    """
    import asyncio

    from coordinator.dashboard.live_mission import LiveMission
    from coordinator.joining import check_mission
    from coordinator.ros2.bridge import LOOK_S, RosBridge
    from coordinator.ros2.graph import open_ros_graph
    from swarm.bus.zenoh_bus import open_zenoh_bus
    from swarm.identity import Role
    from swarm.runtime.clock import ScaledClock, SystemClock
    from swarm.runtime.log import configure_logging, get_logger
    from swarm.runtime.process import SERVICE_NOTIFIER, run_until_stopped

    configure_logging(log_level, log_format)
    check_mission(mission)
    place = _place(ros_router, ros_config)
    _check_node(node)
    seat = seat.found(mission, operator=services)
    network = seat.network
    roles = (Role.OPERATOR,) if services else (Role.VIEWER, Role.OPERATOR)
    config = seat.config(mission=mission, roles=roles)
    if check:
        return 0
    wall = SystemClock()

    async def open_bus() -> Bus:
        while True:
            try:
                return await open_zenoh_bus(config)
            except BusError as fault:
                get_logger("ros2").warning("no bus yet", reason=str(fault))

    source = LiveMission(
        mission or config.mission,
        open_bus,
        network,
        ScaledClock(speedup),
        speedup,
        may_order=services,
        complete=True,
    )

    async def work() -> int:
        graph = await open_ros_graph(place, domain_id, node)
        bridge = RosBridge(source, graph, node, period_s=1.0 / rate_hz, takes_orders=services)
        looking_on = asyncio.get_running_loop().create_task(source.run())
        SERVICE_NOTIFIER.ready(f"tells ROS 2 as /{node}")
        get_logger("ros2").info("in the graph", node=f"/{node}", domain=domain_id)
        try:
            while not looking_on.done():
                bridge.look(wall.now_s())
                await asyncio.wait((looking_on,), timeout=LOOK_S)
            looking_on.result()
        finally:
            looking_on.cancel()
            await asyncio.gather(looking_on, return_exceptions=True)
            bridge.end("swarm ros2 has ended")
            graph.close()
        return 0

    return asyncio.run(run_until_stopped(work(), lifeline=lifeline))


def _place(router: str, file: Path | None) -> str | Path:
    """Where the ROS 2 graph is found."""
    if file is not None:
        if not file.is_file():
            raise InputError(Fault("--ros-config", "", f"no such file: {file}", "give one"))
        return file
    if ENDPOINT.fullmatch(router) is None:
        raise InputError(Fault("--ros-router", "", f"not an endpoint: {router!r}", ENDPOINT_REMEDY))
    if not is_loopback(router) or is_encrypted(router):
        problem = f"{router} is another machine's or encrypted"
        remedy = "say how in a Zenoh configuration file, and give that as --ros-config"
        raise InputError(Fault("--ros-router", "", problem, remedy))
    return router


def _check_node(name: str) -> None:
    from coordinator.ros2.wire import is_node_name

    if not is_node_name(name):
        remedy = "use letters, digits and single underscores, beginning with no digit"
        raise InputError(Fault("--node", "", f"{name!r} cannot name a node of ROS 2", remedy))
