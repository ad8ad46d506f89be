"""The options by which every command finds the bus, in one place.

A command has one parameter ``seat: ConnectionOptions = DEFAULT_CONNECTION`` and is decorated
with `with_options`; on the command line it has the options of the fields of
`ConnectionOptions` instead.
"""

from __future__ import annotations

import os
import re
import socket
from collections.abc import Collection
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING

from swarm.bus.config import DEFAULT_ROUTER, bus_config
from swarm.protocol.timing import LinkKind, LinkPreset, preset
from swarm.runtime.errors import Fault, InputError
from swarm.runtime.options import (
    BusOption,
    ConnectOption,
    KeysOption,
    LeaseOption,
    LinkOption,
    ListenOption,
    UnencryptedOption,
)

if TYPE_CHECKING:
    from swarm.bus.config import BusConfig
    from swarm.bus.local_runs import LocalRun
    from swarm.identity import Role

RUN = "run"
"""What `--bus` is told for a run of this machine; ``run:PID`` for one of several."""
_DIAL_S = 0.1
_TCP = re.compile(r"(?:tcp|tls)/(\[[^\]]+\]|[^:]+):(\d+)")


@dataclass(frozen=True, slots=True)
class ConnectionOptions:
    """How a process reaches the others, as the common options have it."""

    bus: BusOption = "router"
    listen: ListenOption = ""
    connect: ConnectOption = None
    keys: KeysOption = None
    unencrypted: UnencryptedOption = False
    link: LinkOption = LinkKind.NORMAL
    lease_s: LeaseOption = None

    @property
    def network(self) -> LinkPreset:
        """Timers and lease that suit the kind of link."""
        return preset(self.link, self.lease_s)

    def found(self, mission: str | None, *, operator: bool = False) -> ConnectionOptions:
        """This seat, or where nothing names a place one beside a run of this machine.

        Args:
            mission: name of the mission that is meant; None for the only one there is.
            operator: whether something is to be said there, which needs other keys.

        Raises:
            InputError: it is not clear which run is meant, or its keys are out of reach.
        """
        kind, _, number = self.bus.partition(":")
        wanted = kind == RUN
        if (self.is_named and not wanted) or (self.keys is not None and not wanted):
            return self
        from swarm.bus.local_runs import local_runs

        runs = [
            run
            for run in local_runs()
            if mission in (None, run.mission) and number in ("", str(run.pid))
        ]
        named = ", ".join(map(str, runs))
        if not runs and not wanted:
            return self
        if not runs:
            what = "no run" if mission is None else f"no run of {mission}"
            problem = f"{what} of this user is on here"
            raise InputError(Fault("--bus", self.bus, problem, "start one with 'swarm run'"))
        if not wanted and accepts(DEFAULT_ROUTER):
            problem = f"a run of {named} and a router at {DEFAULT_ROUTER} are both on here"
            remedy = f"give --bus run for the run, or --connect {DEFAULT_ROUTER} for the router"
            raise InputError(Fault("command line", "", problem, remedy))
        if len(runs) > 1:
            several = len({run.mission for run in runs}) > 1
            remedy = "name one with --mission" if several else f"give --bus run:{runs[0].pid}"
            raise InputError(Fault("--mission", "", f"several runs are on here: {named}", remedy))
        return self._beside(runs[0], operator=operator)

    def _beside(self, run: LocalRun, *, operator: bool) -> ConnectionOptions:
        folder = run.operator_keys if operator else run.viewer_keys
        keys = None if folder is None else self.keys or Path(folder)
        if keys is not None and not os.access(keys, os.R_OK | os.X_OK):
            role = "an operator" if operator else "a viewer"
            problem = f"the run of {run} has keys, and this user cannot read {keys}"
            raise InputError(Fault("--keys", "", problem, f"give --keys DIR with those of {role}"))
        listen = ""
        if run.mesh:
            import numpy as np

            from swarm.bus.loopback import free_loopback_endpoints

            (listen,) = free_loopback_endpoints(1, np.random.default_rng())
            protocol = "tcp" if keys is None else "tls"
            listen = f"{protocol}/{listen.partition('/')[2]}"
        return replace(
            self,
            bus="mesh" if run.mesh else "router",
            listen=listen,
            connect=list(run.endpoints),
            keys=keys,
            unencrypted=run.unencrypted,
            link=run.link,
        )

    @property
    def is_named(self) -> bool:
        """Whether a place was named, rather than left to the default."""
        return bool(self.connect or self.listen or self.bus != "router")

    def config(
        self,
        *,
        mission: str | None = None,
        roles: Collection[Role] = (),
        name: str | None = None,
    ) -> BusConfig:
        """Settings of the seat; reads the keys, if there are any.

        Those have to be for ``mission``, of one of ``roles``, and of ``name``, where that is given.

        Raises:
            InputError: options contradict each other, or do not fit the keys.
        """
        identity = None
        if self.keys is not None:
            from swarm.identity import load_identity

            identity = load_identity(self.keys, mission=mission, roles=roles, name=name)
        return bus_config(
            self.bus,
            self.listen,
            self.connect or (),
            self.network.lease_s,
            identity=identity,
            unencrypted=self.unencrypted,
        )

    def arguments(self) -> list[str]:
        """What to tell a process that finds the bus the same way; in a mesh it needs its own."""
        words = ["--bus", self.bus, "--link", self.link]
        for endpoint in self.connect or ():
            words += ["--connect", endpoint]
        if self.keys is not None:
            words += ["--keys", str(self.keys)]
        if self.unencrypted:
            words.append("--unencrypted")
        if self.lease_s is not None:
            words += ["--lease-s", repr(self.lease_s)]
        return words


DEFAULT_CONNECTION = ConnectionOptions()


def accepts(endpoint: str) -> bool:
    """Whether somebody accepts connections there, by a short look."""
    match = _TCP.fullmatch(endpoint)
    if match is None:
        return False
    try:
        socket.create_connection((match[1].strip("[]"), int(match[2])), _DIAL_S).close()
    except OSError:
        return False
    return True
