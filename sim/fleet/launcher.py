"""The processes of one run, by name: started, killed, paused, resumed and restarted."""

from __future__ import annotations

import asyncio
import tempfile
from collections.abc import AsyncIterator, Awaitable, Callable, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from sim.fleet.autopilots import RunningVehicles, SimulatedAutopilots, VehiclePlace
from sim.fleet.capacity import usable_cores
from sim.fleet.child_process import ChildProcess, ProgramEnvironment
from sim.fleet.firmware import SitlFirmware
from sim.fleet.fork_server import PRELOADED, PRELOADED_FOR_KEYS, ForkServer
from sim.fleet.layout import (
    DASHBOARD,
    DialedLink,
    LaunchOptions,
    Layout,
    agent_groups,
    autopilot_groups,
)
from sim.fleet.start_pace import AT_ONCE_PER_CORE, StartPace
from swarm.model import Mission
from swarm.model.ids import COORDINATOR

OnLog = Callable[[str, str], None]
"""Called with the name of a process and a line of its log."""
Through = Callable[[DialedLink, str], Awaitable[str]]
"""Given a link and the endpoint where it is accepted, where it is to be dialed instead."""


class Launcher:
    """The processes of one run.

    They are called ``router 1`` and so on, ``the dashboard``, ``coordinator``, ``autopilot of …``,
    and by the id of their UAV, or of each of their UAVs. Use from one asyncio loop; `stop` in
    ``finally`` ends whatever is left::

        launch = Launcher(mission, options)
        try:
            await launch.start()
            await launch.child("uav03").kill()
            await launch.restart("uav03")
        finally:
            await launch.stop()

    Args:
        mission: the scenario of ``options``.
        options: of the run.
        on_log: called for everything the processes log.
        on_plan: called with the JSON of each plan the coordinator makes.
        through: puts something between the two ends of each link, such as a relay that
            delays, loses and cuts; links of observers stay direct.
        observers: who else needs a place in a mesh, besides the launcher.
    """

    def __init__(
        self,
        mission: Mission,
        options: LaunchOptions,
        *,
        on_log: OnLog | None = None,
        on_plan: Callable[[dict[str, Any]], None] | None = None,
        through: Through | None = None,
        observers: Sequence[str] = (),
    ) -> None:
        self.mission = mission
        self.options = options
        self.layout = Layout(options, mission, np.random.default_rng(), observers=observers)
        self.lives: list[ChildProcess] = []
        """Every process ever started, in that order; a restarted one more than once."""
        self._on_log = on_log
        self._on_plan = on_plan
        self._through = through
        self._current: dict[str, ChildProcess] = {}
        self._folder: tempfile.TemporaryDirectory[str] | None = None
        self._server: ForkServer | None = None
        self._pace = StartPace(AT_ONCE_PER_CORE * usable_cores())

    async def start(self) -> None:
        """Start everything, in the order in which one needs the other.

        Returns when all have been started; routers and autopilots serve by then. Of agents only
        few join at the same time.

        Raises:
            ChildFailedError: a router, the dashboard or an autopilot did not come up.
        """
        layout, autopilots = self.layout, self.options.autopilots
        more = () if self.options.keys is None else PRELOADED_FOR_KEYS
        self._server = ForkServer.open((*PRELOADED, *more))
        # A process's memory is for its next life in this run, and for nobody after that.
        below = autopilots.workplace if isinstance(autopilots, SitlFirmware) else None
        self._folder = tempfile.TemporaryDirectory(
            prefix="peckorder-", dir=below, ignore_cleanup_errors=True
        )
        layout.state = Path(self._folder.name)
        if self._through is not None:
            for link in layout.links:
                layout.divert(link, await self._through(link, layout.endpoint(link.listener)))
        for router in layout.routers:
            await self._start(router, layout.router(router))
            await self.child(router).ready()
        if self.options.dashboard is not None:
            arguments = layout.dashboard(self.options.dashboard, layout.state)
            await self._start(DASHBOARD, arguments)
            await self.child(DASHBOARD).ready()
        match autopilots:
            case SimulatedAutopilots():
                vehicles = await self._start_simulated()
            case SitlFirmware() as firmware:
                vehicles = await self._start_firmware(firmware, layout.state)
            case RunningVehicles(places):
                vehicles = _there(places)
        await self._start(COORDINATOR, layout.coordinator())
        there = [place async for place in vehicles]
        for group in agent_groups(there, self.mission, self.options):
            await self._pace.room()
            uavs = [place.uav for place in group]
            name = uavs[0] if len(uavs) == 1 else f"agents of {uavs[0]} and {len(uavs) - 1} more"
            child = await self._start(name, layout.agents(group))
            self._current.update(dict.fromkeys(uavs, child))
            self._pace.started(child, len(group))

    async def _start_simulated(self) -> AsyncIterator[VehiclePlace]:
        """Start simulated autopilots; the vehicles come as they are ready."""
        groups = autopilot_groups([uav.id for uav in self.mission.uavs])
        children = [
            await self._start(f"autopilot of {', '.join(group)}", self.layout.autopilot(group))
            for group in groups
        ]

        async def vehicles() -> AsyncIterator[VehiclePlace]:
            for child, group in zip(children, groups, strict=True):
                for said in await child.ready(len(group)):
                    yield VehiclePlace(said["uav"], said["url"], int(said["system_id"]))

        return vehicles()

    async def _start_firmware(
        self, firmware: SitlFirmware, folder: Path
    ) -> AsyncIterator[VehiclePlace]:
        """Start real firmware, each instance in a folder of its own below ``folder``."""
        processes = firmware.processes(self.mission, self.options.speedup)
        children = {}
        for uav, process in processes.items():
            own = folder / process.folder
            own.mkdir()
            for name, text in process.files.items():
                (own / name).write_text(text, encoding="utf-8")
            setting = ProgramEnvironment(own, process.environment)
            name = f"autopilot of {uav}"
            children[uav] = await self._start(name, list(process.command), setting)

        async def vehicles() -> AsyncIterator[VehiclePlace]:
            await asyncio.gather(*(child.settled() for child in children.values()))
            for uav, process in processes.items():
                yield VehiclePlace(uav, process.url, process.system_id)

        return vehicles()

    async def stop(self) -> None:
        """End every process that is left; paused ones too.

        Agents first: each sees its vehicle return, which takes an autopilot.
        """
        self._pace.close()
        for child in self._current.values():
            if child.returncode is None:
                child.resume()
        agents = [
            child for child in self.lives if child.setting is None and child.arguments[0] == "agent"
        ]
        await asyncio.gather(*(child.stop() for child in agents))
        await asyncio.gather(*(child.stop() for child in self.lives))
        if self._server is not None:
            self._server.close()
        if self._folder is not None:
            self._folder.cleanup()

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the processes started so far."""
        return tuple(self._current)

    def child(self, name: str) -> ChildProcess:
        """The newest process of that name.

        Raises:
            ValueError: none of that name has been started.
        """
        if name not in self._current:
            raise ValueError(f"no process is called {name!r}; there are {', '.join(self.names)}")
        return self._current[name]

    def runs(self, name: str) -> bool:
        """Whether there is a process of that name, paused ones included."""
        return name in self._current and self._current[name].returncode is None

    async def restart(self, name: str) -> ChildProcess:
        """Start a process anew with its arguments and endpoints; kills it first if it runs.

        A router serves when this returns; others have only been started.

        Raises:
            ValueError: there is no process of that name, or it simulates autopilots: those
                would be other vehicles, back on the ground.
            ChildFailedError: a router did not come up.
        """
        former = self.child(name)
        if former.setting is not None or former.arguments[0] == "autopilot":
            raise ValueError(f"{name} cannot be restarted: its vehicles would be back at the start")
        await former.kill()
        child = await self._start(former.name, list(former.arguments))
        same = [each for each, process in self._current.items() if process is former]
        self._current.update(dict.fromkeys(same, child))
        if name in self.layout.routers:
            await child.ready()
        return child

    async def _start(
        self, name: str, arguments: list[str], setting: ProgramEnvironment | None = None
    ) -> ChildProcess:
        child = ChildProcess(
            name,
            arguments,
            on_line=self._on_plan if name == COORDINATOR else None,
            on_log=self._on_log,
            setting=setting,
            returns=arguments[0] == "agent"
            and not isinstance(self.options.autopilots, SimulatedAutopilots),
            server=self._server,
        )
        await child.start()
        self.lives.append(child)
        self._current[name] = child
        return child


async def _there(places: Sequence[VehiclePlace]) -> AsyncIterator[VehiclePlace]:
    """Vehicles for which nothing is to be started."""
    for place in places:
        yield place
