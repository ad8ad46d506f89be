"""How a process reaches the others: settings, checked when made.

Also which endpoints nobody else can listen in on: those on this machine, and encrypted ones.
"""

from __future__ import annotations

import ipaddress
import re
from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING

from swarm.protocol.timing import PRESETS, LinkKind
from swarm.runtime.errors import Fault, InputError, remedy_for_name

if TYPE_CHECKING:
    from swarm.identity import Identity


def is_loopback(endpoint: str) -> bool:
    """Whether only this machine's own processes are at ``endpoint``, or can reach it.

    A name counts as another machine's, but for ``localhost``: what it means may change. So
    does the address that stands for all of this machine's.
    """
    protocol, _, place = endpoint.partition("/")
    if protocol == "unixsock-stream":
        return True
    host = place.partition("?")[0].partition("#")[0].rpartition(":")[0].strip("[]")
    if host == "localhost":
        return True
    try:
        address = ipaddress.ip_address(host.partition("%")[0])
    except ValueError:
        return False
    mapped = address.ipv4_mapped if isinstance(address, ipaddress.IPv6Address) else None
    return (mapped or address).is_loopback


def is_encrypted(endpoint: str) -> bool:
    """Whether what goes by ``endpoint`` is encrypted, and both ends prove who they are."""
    return endpoint.startswith(("tls/", "quic/"))


MIN_LEASE_S, MAX_LEASE_S = 0.2, 60.0
DEFAULT_LEASE_S = PRESETS[LinkKind.NORMAL].lease_s
DEFAULT_ROUTER = "tcp/127.0.0.1:7447"
DEFAULT_SECURE_ROUTER = "tls/127.0.0.1:7447"
"""The one with keys."""

# udp is left out: over it, Zenoh's "reliable" does not retransmit.
ENDPOINT = re.compile(
    r"(?:tcp|tls|quic|ws)/(?:\[[0-9A-Fa-f:.%\w]+\]|[^\s:/?#\[\]]+):(\d{1,5})(?:[?#]\S*)?"
)
UNIX_ENDPOINT = re.compile(r"unixsock-stream/\S+")
ENDPOINT_REMEDY = "write PROTOCOL/HOST:PORT with tcp, tls, quic or ws, as in tcp/127.0.0.1:7447"


@dataclass(frozen=True, slots=True)
class MeshTopology:
    """Peers linked to each other directly; of every two, exactly one dials.

    Dialing both ways left neighbours unaware of a cut for 10 s (measured), so the
    one who starts the processes gives each the endpoints of those before it.
    """

    listen: str
    """Own endpoint."""
    dial: tuple[str, ...] = ()
    """Endpoints of the peers this one calls."""

    def __post_init__(self) -> None:
        _check_endpoints((self.listen,), self.dial)


@dataclass(frozen=True, slots=True)
class ClientTopology:
    """Client of one router at a time."""

    routers: tuple[str, ...]
    """Endpoints of routers, the preferred one first."""

    def __post_init__(self) -> None:
        if not self.routers:
            raise ValueError("a client needs the endpoint of at least one router")
        _check_endpoints((), self.routers)


@dataclass(frozen=True, slots=True)
class FileTopology:
    """What a Zenoh configuration file of the user's says, and nothing else."""

    path: Path


Topology = MeshTopology | ClientTopology | FileTopology


@dataclass(frozen=True, slots=True)
class BusConfig:
    """Settings of one process's seat on the bus.

    Raises:
        ValueError: a setting is out of range, or others could listen in and nobody has said
            that they may.
    """

    topology: Topology
    lease_s: float = DEFAULT_LEASE_S
    """Silence after which the other side takes this process for lost [s]; not used with a file."""
    identity: Identity | None = field(default=None, compare=False)
    """Who this process is and proves to be; None: it talks in the clear."""
    unencrypted: bool = False
    """Whether it may talk in the clear with other machines."""

    def __post_init__(self) -> None:
        _check_lease(self.lease_s)
        _check_encryption(self.endpoints, self.identity, unencrypted=self.unencrypted)

    @property
    def mission(self) -> str | None:
        """The one that the keys are for; None without keys."""
        return None if self.identity is None else self.identity.mission

    @property
    def place(self) -> str:
        """Where the bus is, for who waits for it."""
        if isinstance(self.topology, ClientTopology):
            return f"a router at {' or '.join(self.topology.routers)}"
        return "the bus"

    @property
    def endpoints(self) -> tuple[str, ...]:
        """Those that it listens on and dials; none that a file alone names."""
        match self.topology:
            case MeshTopology(listen, dial):
                return (listen, *dial)
            case ClientTopology(routers):
                return routers
            case FileTopology():
                return ()


@dataclass(frozen=True, slots=True)
class RouterConfig:
    """Settings of a router process."""

    listen: tuple[str, ...] = ()
    """Where clients reach it; port 0 means any free one."""
    connect: tuple[str, ...] = ()
    """Endpoints of other routers it links up with."""
    path: Path | None = None
    """A Zenoh configuration file; the endpoints above, if any, replace the file's."""
    lease_s: float = DEFAULT_LEASE_S
    """Silence after which clients take the router for lost [s]; not used with a file."""
    identity: Identity | None = field(default=None, compare=False)
    """Who the router is, and whom it knows; None: it lets everybody in."""
    unencrypted: bool = False
    """Whether it may talk in the clear with other machines."""

    def __post_init__(self) -> None:
        if not self.listen and self.path is None:
            raise ValueError("a router needs an endpoint to listen on")
        _check_endpoints(self.listen, self.connect)
        _check_lease(self.lease_s)
        endpoints = (*self.listen, *self.connect)
        if self.path is not None and self.identity is None:  # the file may have certificates
            endpoints = tuple(each for each in endpoints if not is_encrypted(each))
        _check_encryption(endpoints, self.identity, unencrypted=self.unencrypted)


def bus_config(
    kind: str,
    listen: str,
    connect: Sequence[str],
    lease_s: float = DEFAULT_LEASE_S,
    *,
    identity: Identity | None = None,
    unencrypted: bool = False,
) -> BusConfig:
    """Settings from what was given on a command line.

    ``kind`` is ``mesh``, ``router`` or the path of a Zenoh configuration file. The default router
    is `DEFAULT_ROUTER`, with keys `DEFAULT_SECURE_ROUTER`.

    Raises:
        InputError: the options contradict each other, an endpoint is wrong, or others could
            listen in.
    """

    def seat(topology: Topology) -> BusConfig:
        return BusConfig(topology, lease_s, identity, unencrypted)

    try:
        if kind == "router":
            if listen:
                raise ValueError("--listen is for --bus mesh only")
            default = DEFAULT_ROUTER if identity is None else DEFAULT_SECURE_ROUTER
            return seat(ClientTopology(tuple(connect) or (default,)))
        if kind == "mesh":
            if not listen:
                raise ValueError("--bus mesh needs --listen with this process's own endpoint")
            return seat(MeshTopology(listen, tuple(connect)))
        if listen or connect:
            raise ValueError("--listen and --connect are for --bus mesh or router only")
        if not Path(kind).is_file():
            remedy = remedy_for_name(
                kind, ("mesh", "router"), "give a file that is there, or one of"
            )
            problem = f"no such Zenoh configuration file: {kind}"
            raise InputError(Fault("command line", "--bus", problem, remedy))
        return seat(FileTopology(Path(kind)))
    except ValueError as fault:
        problem, _, remedy = str(fault).partition("; ")
        options = "--bus, --listen, --connect"
        raise InputError(Fault("command line", options, problem, remedy or "see --help")) from None


def config_file_fault(path: Path, problem: str) -> InputError:
    """The error for a Zenoh configuration file that cannot be used."""
    return InputError(
        Fault(str(path), "", problem, "give a Zenoh configuration file in JSON5, JSON or YAML")
    )


def _check_endpoints(listen: tuple[str, ...], dial: tuple[str, ...]) -> None:
    for endpoint in listen:
        _check_endpoint(endpoint, port_zero=True)
    for endpoint in dial:
        _check_endpoint(endpoint, port_zero=False)
        if endpoint in listen:
            raise ValueError(f"{endpoint} is the own endpoint; dial the others")
    if len(set(dial)) != len(dial):
        raise ValueError(f"an endpoint is named twice in {', '.join(dial)}")


def _check_endpoint(endpoint: str, *, port_zero: bool) -> None:
    if UNIX_ENDPOINT.fullmatch(endpoint):
        return
    if endpoint.startswith("udp/"):
        raise ValueError(f"{endpoint}: lost UDP packets stay lost; use tcp, tls or quic")
    match = ENDPOINT.fullmatch(endpoint)
    if match is None:
        raise ValueError(f"not an endpoint: {endpoint!r}; {ENDPOINT_REMEDY}")
    lowest = 0 if port_zero else 1
    if not lowest <= int(match[1]) <= 0xFFFF:
        raise ValueError(f"{endpoint}: the port must be within {lowest}..65535")


def _check_encryption(
    endpoints: tuple[str, ...], identity: Identity | None, *, unencrypted: bool
) -> None:
    """See that nobody is talked to in the clear, or in cipher, who should not be.

    A configuration file is the user's own word: what it names is not looked at.
    """
    if identity is not None and unencrypted:
        raise ValueError("--keys and --unencrypted contradict each other; give one of them")
    for endpoint in endpoints:
        if identity is not None and not is_encrypted(endpoint):
            raise ValueError(f"{endpoint} is not encrypted; with --keys write tls/… or quic/…")
        if identity is None and is_encrypted(endpoint):
            raise ValueError(f"{endpoint} needs keys; give --keys DIR, which 'swarm keys' makes")
        if identity is None and not unencrypted and not is_loopback(endpoint):
            raise ValueError(
                f"{endpoint} is another machine, or open to others, and anybody on the way could "
                "steer the fleet; give --keys DIR, which 'swarm keys' makes, and tls/…, or, if "
                "that network is yours alone, --unencrypted"
            )


def _check_lease(lease_s: float) -> None:
    if not MIN_LEASE_S <= lease_s <= MAX_LEASE_S:
        raise ValueError(f"lease_s must be within {MIN_LEASE_S}..{MAX_LEASE_S}, not {lease_s}")
