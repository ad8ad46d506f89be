"""Loopback addresses for processes that are about to start."""

from __future__ import annotations

import errno
import socket
from pathlib import Path

import numpy as np

LOOPBACK = "127.0.0.1"
FIRST_PORT = 10_000
"""Below are many well-known services."""
FALLBACK_END_PORT = 32_768
PORT_RANGE_FILE = Path("/proc/sys/net/ipv4/ip_local_port_range")


def free_loopback_endpoints(n: int, rng: np.random.Generator) -> tuple[str, ...]:
    """Choose ``n`` distinct endpoints ``tcp/127.0.0.1:PORT`` that nobody listens on now.

    Ports come from below the kernel's range for outgoing connections, so that none
    of these can take one between choice and use. Seed ``rng`` differently in every
    process that chooses: two with the same seed may choose the same.

    Raises:
        OSError: fewer than ``n`` ports are free.
    """
    if n < 0:
        raise ValueError(f"n must be >= 0, not {n}")
    endpoints: list[str] = []
    candidates = rng.permutation(np.arange(FIRST_PORT, _first_ephemeral_port()))
    for port in candidates.tolist():
        if len(endpoints) == n:
            break
        if _is_free(port):
            endpoints.append(f"tcp/{LOOPBACK}:{port}")
    if len(endpoints) < n:
        raise OSError(errno.EADDRNOTAVAIL, f"{n} free TCP ports wanted, {len(endpoints)} found")
    return tuple(endpoints)


def _first_ephemeral_port() -> int:
    try:
        first = int(PORT_RANGE_FILE.read_text().split()[0])
    except (OSError, ValueError, IndexError):
        return FALLBACK_END_PORT
    # A range opened down to the bottom leaves nothing below it; then take what others do.
    return first if first > FIRST_PORT + 1000 else FALLBACK_END_PORT


def _is_free(port: int) -> bool:
    with socket.socket(socket.AF_INET, socket.SOCK_STREAM) as probe:
        # As servers do, or a port would look taken for a minute after its last use.
        probe.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        try:
            probe.bind((LOOPBACK, port))
        except OSError:
            return False
        return True
