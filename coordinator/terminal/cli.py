"""The command `swarm status`."""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING, Annotated, Any

import typer

from swarm.bus.connection import DEFAULT_CONNECTION, ConnectionOptions
from swarm.runtime.errors import SwarmError
from swarm.runtime.option_groups import with_options
from swarm.runtime.options import JsonOption, SomeMissionOption, SpeedupOption

if TYPE_CHECKING:
    from rich.console import Console

    from coordinator.mission_view.mission_state import MissionState
    from coordinator.mission_view.scene import Scene
    from swarm.bus.config import BusConfig
    from swarm.protocol.timing import Timing
    from swarm.runtime.clock import ScaledClock

PATIENCE_S = 4.0
"""How long to wait when looking once, unless told otherwise [wall s]."""


@with_options
def status(
    mission: SomeMissionOption = None,
    watch: Annotated[
        bool,
        typer.Option(
            "--watch",
            "-w",
            help="Stay and show the live picture until the mission is over and everybody has "
            "left; with --json one object on a line each second, otherwise off a terminal the "
            "story line by line.",
        ),
    ] = False,
    timeout_s: Annotated[
        float | None,
        typer.Option(
            "--timeout-s",
            min=0.1,
            max=600.0,
            metavar="S",
            help="How long to wait for the bus, and for what is still unknown; wall seconds. "
            f"Default: {PATIENCE_S:g}, with --watch as long as it takes.",
            show_default=False,
        ),
    ] = None,
    seat: ConnectionOptions = DEFAULT_CONNECTION,
    speedup: SpeedupOption = 1.0,
    json: JsonOption = False,
) -> int:
    """Show how a running mission stands, once or live.

    That is its phase, its tasks, what each UAV does and what went wrong. Joins the mission as an
    onlooker, learns, prints and leaves; nobody flies any differently for it. Exit status 1:
    nobody flies the mission. With --watch it waits for the mission, shows it live as `swarm run`
    does, and ends with 0 when the mission is over and nobody is there any more. It goes on when
    processes, the coordinator or its own link to the bus are lost, and shows that. At which
    speed-up the mission is flown it sees by itself.

    Examples:
        swarm status
        swarm status --mission table-1 --json
        swarm status --keys keys/dashboard --connect tls/192.168.1.2:7447
        swarm status --watch
        swarm status --watch --json --mission table-1
    """
    import asyncio

    from rich.console import Console

    from coordinator.joining import check_mission
    from swarm.runtime.clock import ScaledClock
    from swarm.runtime.log import LogLevel, configure_logging
    from swarm.runtime.process import run_until_stopped

    configure_logging(LogLevel.ERROR)
    check_mission(mission)
    seat = seat.found(mission)
    config = seat.config(mission=mission)
    timing = seat.network.timing.scaled(speedup)
    console, clock = Console(highlight=False), ScaledClock(speedup)

    async def work() -> int:
        if watch:
            await _watch(mission, config, timing, clock, timeout_s, console, json=json)
            return 0
        found = await _look(mission, config, timing, clock, timeout_s or PATIENCE_S)
        print_status(found, console, json=json)
        return 0

    return asyncio.run(run_until_stopped(work()))


def print_status(scene: Scene, console: Console, *, json: bool) -> None:
    """Print how a mission stands, as `swarm status` does."""
    from json import dumps

    from coordinator.mission_view.presentation import signs_for
    from coordinator.terminal.status_table import status_as_json, status_table

    if json:
        print(dumps(status_as_json(scene), allow_nan=False))
    else:
        signs = signs_for(console.options.ascii_only)
        console.print(status_table(scene, console.width, signs))


async def _look(
    name: str | None, config: BusConfig, timing: Timing, clock: ScaledClock, patience_s: float
) -> Scene:
    """Learn how a mission stands."""
    from coordinator.joining import joined, observer_shell
    from coordinator.mission_view.observation import MissionObserver
    from coordinator.mission_view.scene import scene_of

    async with joined(name, config, patience_s) as (mission, place):
        observer = MissionObserver(mission, timing, patience_s * clock.speedup)
        if await observer_shell(observer, place, clock, mission, "status").run() != 0:
            raise SwarmError(observer.lack)
        return scene_of(observer.mission_state, clock.now_s())


async def _watch(
    mission: str | None,
    config: BusConfig,
    timing: Timing,
    clock: ScaledClock,
    patience_s: float | None,
    console: Console,
    *,
    json: bool,
) -> None:
    """Stay until the mission is over."""
    from coordinator.joining import watch
    from coordinator.terminal.live_view import LiveView

    if json:
        lines = JsonLines(lambda line: print(line, flush=True), clock.speedup)
        await watch(mission, config, timing, clock, lines, patience_s=patience_s)
        lines.close()
        return
    with LiveView(console, speedup=clock.speedup) as view:
        await watch(mission, config, timing, clock, view, patience_s=patience_s)
    console.print("the mission is over, and everybody has left")


class JsonLines:
    """Tells how a mission stands as a JSON object on a line, every so many seconds."""

    def __init__(self, tell: Callable[[str], object], every_s: float) -> None:
        self._tell = tell
        self._every_s = every_s
        self._due_s = 0.0
        self._untold: dict[str, Any] | None = None

    def wait(self, text: str) -> None:
        """A reader of lines waits for the first one."""

    def update(self, mission_state: MissionState, now_s: float) -> None:
        """Print how the mission stands, if it is time."""
        from coordinator.mission_view.scene import scene_of
        from coordinator.terminal.status_table import status_as_json

        self._untold = status_as_json(scene_of(mission_state, now_s))
        if now_s >= self._due_s:
            self._due_s = now_s + self._every_s
            self.close()

    def close(self) -> None:
        """Print the last state unless it has been."""
        from json import dumps

        if self._untold is not None:
            self._tell(dumps(self._untold, allow_nan=False))
            self._untold = None
