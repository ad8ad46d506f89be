"""Chosen endpoints are free, distinct and out of the way of outgoing connections."""

from __future__ import annotations

import socket
from pathlib import Path

import numpy as np
import pytest

from swarm.bus import loopback
from swarm.bus.loopback import free_loopback_endpoints


def ports(chosen: tuple[str, ...]) -> list[int]:
    assert all(endpoint.startswith("tcp/127.0.0.1:") for endpoint in chosen)
    return [int(endpoint.rpartition(":")[2]) for endpoint in chosen]


def test_ports_are_distinct_and_below_the_ephemeral_range() -> None:
    first = int(Path("/proc/sys/net/ipv4/ip_local_port_range").read_text().split()[0])
    chosen = ports(free_loopback_endpoints(50, np.random.default_rng(1)))

    assert len(set(chosen)) == 50
    assert all(1024 < port < first for port in chosen)


def test_same_seed_chooses_the_same_unless_one_is_taken() -> None:
    chosen = free_loopback_endpoints(3, np.random.default_rng(2))
    assert free_loopback_endpoints(3, np.random.default_rng(2)) == chosen

    with socket.create_server(("127.0.0.1", ports(chosen)[1])):
        again = free_loopback_endpoints(3, np.random.default_rng(2))
    assert again[0] == chosen[0]
    assert again[1] == chosen[2]


@pytest.mark.parametrize("content", [None, "", "nonsense", "1024 60999"])
def test_unusable_range_falls_back(
    content: str | None, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    file = tmp_path / "ip_local_port_range"
    if content is not None:
        file.write_text(content)
    monkeypatch.setattr(loopback, "PORT_RANGE_FILE", file)

    assert all(
        port < 32768 for port in ports(free_loopback_endpoints(20, np.random.default_rng(3)))
    )


def test_none_wanted_none_given() -> None:
    assert free_loopback_endpoints(0, np.random.default_rng()) == ()
    with pytest.raises(ValueError, match="n must be >= 0"):
        free_loopback_endpoints(-1, np.random.default_rng())


def test_more_than_there_are_is_an_error() -> None:
    with pytest.raises(OSError, match="free TCP ports wanted"):
        free_loopback_endpoints(40_000, np.random.default_rng())
