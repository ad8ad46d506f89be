"""Wrong bus settings are refused where they are made."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import pytest

from swarm.bus.config import (
    DEFAULT_LEASE_S,
    DEFAULT_ROUTER,
    BusConfig,
    ClientTopology,
    FileTopology,
    MeshTopology,
    RouterConfig,
    bus_config,
)
from swarm.runtime.errors import InputError

A = "tcp/127.0.0.1:7447"
B = "tcp/127.0.0.1:7448"


@pytest.mark.parametrize(
    "endpoint",
    [
        A,
        "tls/router.example.org:7447",
        "quic/[fe80::1%eth0]:7447",
        "ws/10.0.0.1:80",
        "tcp/[::1]:7447#iface=lo",
        "unixsock-stream//run/swarm.sock",
    ],
)
def test_reliable_endpoints_are_taken(endpoint: str) -> None:
    assert ClientTopology((endpoint,)).routers == (endpoint,)


@pytest.mark.parametrize(
    "make",
    [
        lambda: ClientTopology(()),
        lambda: ClientTopology((A, A)),
        lambda: ClientTopology(("127.0.0.1:7447",)),
        lambda: ClientTopology(("udp/127.0.0.1:7447",)),
        lambda: ClientTopology(("tcp/127.0.0.1",)),
        lambda: ClientTopology(("tcp/127.0.0.1:0",)),
        lambda: ClientTopology(("tcp/127.0.0.1:65536",)),
        lambda: ClientTopology(("tcp/with space:1",)),
        lambda: ClientTopology((f"{A}\n",)),
        lambda: MeshTopology("", (A,)),
        lambda: MeshTopology(A, (A,)),
        lambda: MeshTopology(A, (B, B)),
        lambda: BusConfig(MeshTopology(A), lease_s=0.1),
        lambda: BusConfig(MeshTopology(A), lease_s=float("nan")),
        RouterConfig,
        lambda: RouterConfig((A,), connect=(A,)),
        lambda: RouterConfig((A,), lease_s=61.0),
    ],
)
def test_wrong_settings_are_refused(make: Callable[[], object]) -> None:
    with pytest.raises(ValueError, match=r".+"):
        make()


def test_peers_and_routers_may_listen_on_any_port() -> None:
    assert MeshTopology("tcp/127.0.0.1:0", (A,)).dial == (A,)
    assert RouterConfig(("tcp/127.0.0.1:0",)).lease_s == DEFAULT_LEASE_S
    assert RouterConfig(path=Path("router.json5")).listen == ()


def test_command_line_names_a_topology(tmp_path: Path) -> None:
    file = tmp_path / "zenoh.json5"
    file.touch()

    assert bus_config("mesh", A, [B], 2.0) == BusConfig(MeshTopology(A, (B,)), 2.0)
    assert bus_config("router", "", [B, A]) == BusConfig(ClientTopology((B, A)))
    assert bus_config("router", "", []) == BusConfig(ClientTopology((DEFAULT_ROUTER,)))
    assert bus_config(str(file), "", []) == BusConfig(FileTopology(file))


@pytest.mark.parametrize(
    ("kind", "listen", "connect", "says"),
    [
        ("mesh", "", [A], "needs --listen"),
        ("mesh", A, ["nowhere"], "not an endpoint: 'nowhere'"),
        ("router", A, [], "--listen is for --bus mesh only"),
        ("no/such/file", "", [], "no such Zenoh configuration file"),
        ("no/such/file", "", [A], "for --bus mesh or router only"),
    ],
)
def test_command_line_that_contradicts_itself_is_refused(
    kind: str, listen: str, connect: list[str], says: str
) -> None:
    with pytest.raises(InputError, match=says):
        bus_config(kind, listen, connect)
