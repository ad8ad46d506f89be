"""Which processes fly a mission on one machine, and with which arguments.

Leaves out: starting and ending them (sim.launch.run).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from enum import StrEnum
from pathlib import Path

import numpy as np

from swarm.bus.config import BusConfig, ClientTopology, MeshTopology
from swarm.bus.endpoints import free_loopback_endpoints
from swarm.model import Mission
from swarm.model.ids import COORDINATOR

__all__ = ["AUTO_MESH_LIMIT", "BusKind", "LaunchOptions", "Layout", "autopilot_groups"]

AUTO_MESH_LIMIT = 16
"""Largest fleet for which peers link up directly by default (README of swarm.bus)."""
OWN_AUTOPILOT_LIMIT = 20
"""Largest fleet in which every simulated autopilot is a process of its own."""
VEHICLES_PER_PROCESS = 25
"""Simulated autopilots in one process of a larger fleet."""
ONLOOKER = "onlooker"


class BusKind(StrEnum):
    """How the processes of a run reach each other."""

    AUTO = "auto"
    MESH = "mesh"
    ROUTER = "router"

    def for_fleet(self, n_uav: int) -> BusKind:
        """The kind itself, or what suits a fleet of that size."""
        if self is not BusKind.AUTO:
            return self
        return BusKind.MESH if n_uav <= AUTO_MESH_LIMIT else BusKind.ROUTER


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


class Layout:
    """Endpoints and arguments of all processes of one run.

    Args:
        options: of the run.
        mission: the scenario.
        router: endpoint of the router; None in a mesh.
        rng: chooses free ports.
    """

    def __init__(
        self,
        options: LaunchOptions,
        mission: Mission,
        router: str | None,
        rng: np.random.Generator,
    ) -> None:
        self._options = options
        self._mission = mission
        self._router = router
        names = [COORDINATOR, *(uav.id for uav in mission.uavs), ONLOOKER]
        endpoints = () if router is not None else free_loopback_endpoints(len(names), rng)
        self._endpoints = dict(zip(names, endpoints, strict=False))

    def bus_of_onlooker(self) -> BusConfig:
        """Seat of the launcher itself."""
        if self._router is not None:
            return BusConfig(ClientTopology((self._router,)))
        listen, dial = self._mesh_place(ONLOOKER)
        return BusConfig(MeshTopology(listen, dial))

    def autopilot(self, uavs: Sequence[str]) -> list[str]:
        """Arguments of the process that simulates the autopilots of ``uavs``."""
        chosen = [argument for uav in uavs for argument in ("--uav", uav)]
        listen = ["--listen", "tcp:127.0.0.1:0"]
        return ["autopilot", str(self._options.scenario), *chosen, *listen, *self._speed()]

    def coordinator(self) -> list[str]:
        """Arguments of the coordinator's process."""
        options = self._options
        return [
            "coordinator",
            str(options.scenario),
            *("--method", options.method, "--seed", str(options.seed), "--json"),
            *("--start-timeout-s", repr(options.start_timeout_s)),
            *self._speed(),
            *self._bus(COORDINATOR),
        ]

    def agent(self, uav: str, url: str, system_id: int) -> list[str]:
        """Arguments of the agent of ``uav``."""
        options = self._options
        rate_hz = options.position_rate_hz / options.speedup
        return [
            "agent",
            *("--mission", self._mission.name, "--uav", uav),
            *("--mavlink", url, "--system-id", str(system_id)),
            *("--position-rate-hz", repr(rate_hz)),
            *("--acceptance-radius-m", repr(options.acceptance_radius_m)),
            *self._speed(),
            *self._bus(uav),
        ]

    def _speed(self) -> list[str]:
        return ["--speedup", repr(self._options.speedup)]

    def _bus(self, name: str) -> list[str]:
        if self._router is not None:
            return ["--bus", "router", "--connect", self._router]
        listen, dial = self._mesh_place(name)
        dialed = [argument for endpoint in dial for argument in ("--connect", endpoint)]
        return ["--bus", "mesh", "--listen", listen, *dialed]

    def _mesh_place(self, name: str) -> tuple[str, tuple[str, ...]]:
        """Own endpoint, and those of all before it in the list: of every two, one dials."""
        names = list(self._endpoints)
        before = names[: names.index(name)]
        return self._endpoints[name], tuple(self._endpoints[each] for each in before)


def default_position_rate_hz(n_uav: int) -> float:
    """Wall rate of each UAV's position reports.

    An arrival is seen at the next report, so legs grow by half an interval; a machine
    handles some 2000 reports a second beside everything else.
    """
    return min(100.0, 2000.0 / max(1, n_uav))


def autopilot_groups(uavs: Sequence[str]) -> list[list[str]]:
    """UAVs whose simulated autopilots share a process."""
    size = 1 if len(uavs) <= OWN_AUTOPILOT_LIMIT else VEHICLES_PER_PROCESS
    return [list(uavs[first : first + size]) for first in range(0, len(uavs), size)]
