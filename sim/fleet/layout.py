"""Which processes fly a mission on one machine, and with which arguments."""

from __future__ import annotations

import os
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field
from enum import StrEnum
from pathlib import Path
from typing import TypeVar

import numpy as np

from coordinator.dashboard.access import ServeAddress
from sim.fleet.autopilots import (
    Autopilots,
    RunningVehicles,
    SimulatedAutopilots,
    VehiclePlace,
)
from sim.fleet.firmware import SitlFirmware
from sim.fleet.keys import RunKeys
from sim.fleet.passthrough import PassthroughOptions
from swarm.bus.config import BusConfig, ClientTopology, MeshTopology, Topology, is_loopback
from swarm.bus.local_runs import LocalRun, begun
from swarm.bus.loopback import free_loopback_endpoints
from swarm.identity import load_identity
from swarm.model import Mission, UavId
from swarm.model.ids import COORDINATOR
from swarm.model.layers import HIGHEST_M, FlightLayers, layers_below, layers_over
from swarm.protocol.timing import PRESETS, UNSTRETCHED_UAVS, LinkKind, LinkPreset, Timing, preset
from swarm.runtime.log import LogFormat
from swarm.separation.fleet_layers import fleet_layers_m

_Member = TypeVar("_Member")
AUTO_MESH_LIMIT = 16
"""Largest fleet for which peers link up directly by default (README of swarm.bus)."""
OWN_AUTOPILOT_LIMIT = 20
"""Largest fleet in which every simulated autopilot is a process of its own."""
VEHICLES_PER_PROCESS = 25
"""Simulated autopilots in one process of a larger fleet."""
LEAST_POSITION_RATE_HZ = 5.0
"""Wall rate of position reports of the largest fleets."""
START_S_PER_UAV = 1.2
"""Simulated vehicles get that long for each of the fleet to get airborne, and as many others wait
in the air for them, where that is longer than usual: one machine starts them all."""
LARGE_LEASE_S = PRESETS[LinkKind.BAD].lease_s
"""Lease of fleets of more than `UNSTRETCHED_UAVS`, on any link: on one machine links never fail by
themselves, but a process may wait for a processor for seconds while all others start."""
ONLOOKER = "onlooker"
DASHBOARD = "the dashboard"
"""What its process is called; no UAV can be."""
MAX_ROUTERS = 8


class BusKind(StrEnum):
    """How the processes of a run reach each other."""

    AUTO = "auto"
    MESH = "mesh"
    ROUTER = "router"

    def for_fleet(self, n_uav: int, agents_per_process: int = 1) -> BusKind:
        """The kind itself, or what suits a fleet of that size; in a mesh each has a process."""
        if self is not BusKind.AUTO:
            return self
        suits_mesh = n_uav <= AUTO_MESH_LIMIT and agents_per_process == 1
        return BusKind.MESH if suits_mesh else BusKind.ROUTER


@dataclass(frozen=True, slots=True)
class LaunchOptions:
    """What is the same for all processes of a run."""

    scenario: Path
    method: str
    seed: int
    speedup: float
    bus: BusKind
    position_rate_hz: float
    """Wall rate of position reports; the agents ask in vehicle time."""
    acceptance_radius_m: float
    start_timeout_s: float
    """Until UAVs that are not airborne are given up [s of mission or wall, whichever is slower]."""
    routers: int = 1
    """How many routers there are, where there are any."""
    link: LinkKind = LinkKind.NORMAL
    """What the network is like: sets lease and timers."""
    address: str = "127.0.0.1"
    """Where routers and peers listen; an address of this machine."""
    autopilots: Autopilots = field(default_factory=SimulatedAutopilots)
    """What flies."""
    passthrough: PassthroughOptions = field(default_factory=PassthroughOptions)
    """What agents and simulated autopilots are told besides."""
    log_format: LogFormat = LogFormat.AUTO
    """What a line of a process's log looks like."""
    dashboard: ServeAddress | None = None
    """Where a page shows the run; nowhere if None."""
    agents_per_process: int = 1
    """How many UAVs' agents share a process."""
    keys: RunKeys | None = None
    """With which the processes prove who they are; None: whoever reaches the bus is believed."""
    router_file: Path | None = None
    """Zenoh configuration file of the routers, instead of what their keys say."""

    def __post_init__(self) -> None:
        if not 1 <= self.routers <= MAX_ROUTERS:
            raise ValueError(f"routers must be within 1..{MAX_ROUTERS}, not {self.routers}")
        if self.agents_per_process < 1:
            raise ValueError(f"agents_per_process must be >= 1, not {self.agents_per_process}")
        if self.agents_per_process > 1 and (self.bus is BusKind.MESH or self.keys is not None):
            raise ValueError("in a mesh, and with keys, each agent has a process of its own")


@dataclass(frozen=True, slots=True)
class DialedLink:
    """A connection that one process of a run dials and another accepts."""

    dialer: str
    listener: str


class Layout:
    """Endpoints and arguments of all processes of one run.

    Processes are called ``coordinator``, by the id of their UAV, or ``router 1`` and so on;
    ``observers`` have places in a mesh, too. Of every two that are linked, one dials. All
    endpoints are chosen beforehand and stay, so that a process can be started again with the same
    arguments.
    """

    def __init__(
        self,
        options: LaunchOptions,
        mission: Mission,
        rng: np.random.Generator,
        *,
        observers: Sequence[str] = (),
    ) -> None:
        self._options = options
        self._mission = mission
        self._seats = [COORDINATOR, *(uav.id for uav in mission.uavs)]
        pages = [] if options.dashboard is None else [DASHBOARD]
        self._observers = [ONLOOKER, *pages, *observers]
        kind = options.bus.for_fleet(len(mission.uavs), options.agents_per_process)
        count = options.routers if kind is BusKind.ROUTER else 0
        self.routers = tuple(f"router {number}" for number in range(1, count + 1))
        """Names of the routers; none in a mesh."""
        listeners = self.routers or (*self._seats, *self._observers)
        ports = [each.rpartition(":")[2] for each in free_loopback_endpoints(len(listeners), rng)]
        protocol = "tcp" if options.keys is None else "tls"
        endpoints = [f"{protocol}/{options.address}:{port}" for port in ports]
        self._endpoints = dict(zip(listeners, endpoints, strict=True))
        self._diverted: dict[DialedLink, str] = {}
        self.state: Path | None = None
        """Folder in which agents and coordinator keep their memory; nowhere if None."""

    @property
    def links(self) -> tuple[DialedLink, ...]:
        """All links but those of observers."""
        dialers = (*self.routers, *self._seats)
        return tuple(DialedLink(dialer, to) for dialer in dialers for to in self._listeners(dialer))

    def endpoint(self, name: str) -> str:
        """Where a process listens."""
        return self._endpoints[name]

    def divert(self, link: DialedLink, endpoint: str) -> None:
        """Let a link be dialed at ``endpoint``, where somebody passes it on."""
        self._diverted[link] = endpoint

    def observer_seat(self, name: str = ONLOOKER) -> BusConfig:
        """Seat of the launcher itself, or of another observer."""
        dialed, lease_s = self._dialed(name), self._network.lease_s
        topology: Topology
        if self.routers:
            topology = ClientTopology(dialed)
        else:
            topology = MeshTopology(self._endpoints[name], dialed)
        if (folder := self._keys_of(name)) is None:
            return BusConfig(topology, lease_s, unencrypted=self._unencrypted)
        return BusConfig(topology, lease_s, load_identity(folder, mission=self._mission.name))

    @property
    def local_run(self) -> LocalRun:
        """How others on this machine find the run that this process starts."""
        keys, pid = self._options.keys, os.getpid()
        return LocalRun(
            pid=pid,
            begun=begun(pid),
            mission=self._mission.name,
            mesh=not self.routers,
            endpoints=tuple(self._endpoints.values()),
            link=self._options.link,
            viewer_keys=None if keys is None else str(keys.of_observer(ONLOOKER).absolute()),
            operator_keys=None if keys is None else str(keys.of_operator().absolute()),
            unencrypted=self._unencrypted,
        )

    def router(self, name: str) -> list[str]:
        """Arguments of a router's process."""
        dialed = _repeated("--connect", self._dialed(name))
        listen = ["--listen", self._endpoints[name]]
        file = self._options.router_file
        trust = self._trust(name) if file is None else ["--config", str(file)]
        return [
            "router",
            "--json",
            *listen,
            *dialed,
            *trust,
            *self._link(),
            *self._log(),
        ]

    def autopilot(self, uavs: Sequence[str]) -> list[str]:
        """Arguments of the process that simulates the autopilots of ``uavs``."""
        options, vehicles = self._options, self._options.autopilots
        return [
            *("autopilot", str(options.scenario)),
            *_repeated("--uav", uavs),
            *("--listen", "tcp:127.0.0.1:0"),
            *(["--flavour", vehicles.flavour] if isinstance(vehicles, SimulatedAutopilots) else []),
            *options.passthrough.to_autopilot(uavs),
            *self._log(),
            *self._speed(),
        ]

    def coordinator(self) -> list[str]:
        """Arguments of the coordinator's process."""
        options = self._options
        return [
            "coordinator",
            str(options.scenario),
            *("--method", options.method, "--seed", str(options.seed), "--json"),
            *("--start-timeout-s", repr(options.start_timeout_s)),
            *("--hover-s", repr(self._hover_s)),
            *("--layer-spacing-m", repr(flight_layers(self._mission, options).spacing_m)),
            *self._log(),
            *self._memory(),
            *self._speed(),
            *self.seat_arguments(COORDINATOR),
        ]

    def dashboard(self, place: ServeAddress, folder: Path) -> list[str]:
        """Arguments of the process that serves the page at ``place``; ``folder`` is its own."""
        return [
            *("dashboard", "--mission", self._mission.name, "--json"),
            *place.arguments(folder),
            *self._log(),
            *self._speed(),
            *self.seat_arguments(DASHBOARD),
        ]

    def agent(self, uav: str, url: str, system_id: int) -> list[str]:
        """Arguments of the agent of ``uav``."""
        return self.agents([VehiclePlace(uav, url, system_id)])

    def agents(self, places: Sequence[VehiclePlace]) -> list[str]:
        """Arguments of the process that is the agent of all these, one of `agent_groups`."""
        options, uav = self._options, places[0].uav
        rate_hz = options.position_rate_hz / options.speedup
        return [
            "agent",
            *("--mission", self._mission.name),
            *_repeated("--uav", [place.uav for place in places]),
            *_repeated("--mavlink", [place.url for place in places]),
            *_repeated("--system-id", [str(place.system_id) for place in places]),
            *("--position-rate-hz", repr(rate_hz)),
            *("--acceptance-radius-m", repr(options.acceptance_radius_m)),
            *options.passthrough.to_agent(uav),
            *self._log(),
            *self._memory(),
            *self._speed(),
            *self.seat_arguments(uav),
        ]

    @property
    def _network(self) -> LinkPreset:
        """Timers and lease of all processes."""
        usual = preset(self._options.link)
        if len(self._mission.uavs) <= UNSTRETCHED_UAVS or usual.lease_s >= LARGE_LEASE_S:
            return usual
        return preset(self._options.link, LARGE_LEASE_S)

    @property
    def _hover_s(self) -> float:
        """How long the first in the air wait for the last [wall s]; simulated ones may for long."""
        usual_s = Timing().hover_s
        if not isinstance(self._options.autopilots, SimulatedAutopilots):
            return usual_s
        return max(usual_s, START_S_PER_UAV * len(self._mission.uavs))

    def _link(self) -> list[str]:
        kind, lease_s = self._options.link, self._network.lease_s
        own = [] if lease_s == preset(kind).lease_s else ["--lease-s", repr(lease_s)]
        return ["--link", kind, *own]

    def _log(self) -> list[str]:
        form = self._options.log_format
        return [] if form is LogFormat.AUTO else ["--log-format", form]

    def _speed(self) -> list[str]:
        return ["--speedup", repr(self._options.speedup)]

    def _memory(self) -> list[str]:
        return [] if self.state is None else ["--state", str(self.state)]

    @property
    def _unencrypted(self) -> bool:
        """Whether processes talk in the clear beyond loopback, as on networks made for a test."""
        clear = [*self._endpoints.values(), *self._diverted.values()]
        return self._options.keys is None and not all(map(is_loopback, clear))

    def seat_arguments(self, name: str) -> list[str]:
        """Arguments with which a process, or an observer by that name, finds the bus."""
        rest = [*_repeated("--connect", self._dialed(name)), *self._trust(name)]
        rest += self._link()
        if self.routers:
            return ["--bus", "router", *rest]
        return ["--bus", "mesh", "--listen", self._endpoints[name], *rest]

    def _trust(self, name: str) -> list[str]:
        """Arguments by which a process knows whom to trust: its keys, or whoever is there."""
        if (folder := self._keys_of(name)) is not None:
            return ["--keys", str(folder)]
        return ["--unencrypted"] if self._unencrypted else []

    def _keys_of(self, name: str) -> Path | None:
        """The folder of keys of the process, or observer, by that name; None without keys."""
        keys = self._options.keys
        if keys is None:
            return None
        if name in self.routers:
            return keys.of_router(self.routers.index(name))
        if name in self._seats:
            return keys.of_seat(name)
        return keys.of_operator() if name == DASHBOARD else keys.of_observer(name)

    def _dialed(self, name: str) -> tuple[str, ...]:
        """Endpoints that a process is told to dial."""
        links = [DialedLink(name, listener) for listener in self._listeners(name)]
        return tuple(self._diverted.get(link, self._endpoints[link.listener]) for link in links)

    def _listeners(self, name: str) -> tuple[str, ...]:
        """Whom a process dials: in a list of all, those before it.

        A client dials one router at a time. Clients take turns in which router they
        prefer, so that each serves its part of the fleet while all are there.
        """
        if not self.routers or name in self.routers:
            listeners = list(self._endpoints)
            return tuple(listeners[: listeners.index(name)])
        if name not in self._seats:
            return self.routers
        first = self._seats.index(name) % len(self.routers)
        return self.routers[first:] + self.routers[:first]


def _repeated(option: str, values: Sequence[str]) -> list[str]:
    return [word for value in values for word in (option, value)]


def flight_layers(mission: Mission, options: LaunchOptions) -> FlightLayers:
    """Heights at which the UAVs fly: simulated ones never so high that they climb for long."""
    usual = layers_over(mission.terrain)
    if not isinstance(options.autopilots, SimulatedAutopilots):
        return usual
    return layers_below(HIGHEST_M, len(mission.uavs), usual)


def default_position_rate_hz(n_uav: int) -> float:
    """Wall rate of each UAV's position reports.

    An arrival is seen at the next report, so legs grow by half an interval; a machine
    handles some 1000 reports a second beside everything else.
    """
    return max(LEAST_POSITION_RATE_HZ, min(100.0, 1000.0 / max(1, n_uav)))


@dataclass(frozen=True, slots=True)
class RunDefaults:
    """What suits the kind of autopilots, where nothing is asked for."""

    position_rate_hz: float
    acceptance_radius_m: float
    start_timeout_s: float


def defaults_for(autopilots: Autopilots, n_uav: int) -> RunDefaults:
    """Simulated vehicles are exact and quick; firmware and real ones are neither.

    Firmware waits for its estimator, half a minute and more of its own time, and drifts in
    what it takes for wind and noise of its GPS; a vehicle that runs already may be at the
    other end of a radio, and somebody may have to switch it on first.
    """
    match autopilots:
        case SimulatedAutopilots():
            timeout_s = max(120.0, START_S_PER_UAV * n_uav)
            return RunDefaults(default_position_rate_hz(n_uav), 0.5, timeout_s)
        case SitlFirmware():
            return RunDefaults(min(50.0, 500.0 / max(1, n_uav)), 2.0, 300.0)
        case RunningVehicles():
            return RunDefaults(10.0, 2.0, 300.0)


def autopilot_groups(uavs: Sequence[str]) -> list[list[str]]:
    """UAVs whose simulated autopilots share a process, as their agents may."""
    size = 1 if len(uavs) <= OWN_AUTOPILOT_LIMIT else VEHICLES_PER_PROCESS
    return _in_turn(uavs, size)


def uavs_by_height(mission: Mission, options: LaunchOptions) -> list[UavId]:
    """All UAVs, from the one that begins the mission lowest above the ground."""
    heights_m = fleet_layers_m(mission, flight_layers(mission, options))
    rising = sorted(zip(heights_m, mission.uavs, strict=True), key=lambda each: each[0])
    return [uav.id for _, uav in rising]


def agent_groups(
    places: Iterable[VehiclePlace], mission: Mission, options: LaunchOptions
) -> list[list[VehiclePlace]]:
    """UAVs whose agents share a process, of those that are told the same, as they are to start.

    Whoever begins higher climbs for longer. So the highest start first, in all processes: agents of
    one begin one after the other.
    """
    rank = {uav: number for number, uav in enumerate(uavs_by_height(mission, options))}
    alike: dict[tuple[str, ...], list[VehiclePlace]] = {}
    for place in sorted(places, key=lambda place: -rank[UavId(place.uav)]):
        alike.setdefault(tuple(options.passthrough.to_agent(place.uav)), []).append(place)
    groups = [
        group for same in alike.values() for group in _in_turn(same, options.agents_per_process)
    ]
    return sorted(groups, key=lambda group: -rank[UavId(group[0].uav)])


def _in_turn(members: Sequence[_Member], size: int) -> list[list[_Member]]:
    """As few groups as hold them by ``size``, joined in turn, so that none has the last alone."""
    count = -(-len(members) // size)
    return [list(members[first::count]) for first in range(count)]
