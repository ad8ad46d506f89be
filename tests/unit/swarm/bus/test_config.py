"""Wrong bus settings are refused where they are made."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import pytest

from swarm.bus.config import BusConfig, ClientTopology, MeshTopology, RouterConfig

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
    assert RouterConfig(("tcp/127.0.0.1:0",)).lease_s == 1.0
    assert RouterConfig(path=Path("router.json5")).listen == ()
