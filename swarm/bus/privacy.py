"""Which endpoints nobody else can listen in on: those on this machine, and encrypted ones.

Leaves out: whether an endpoint is well formed (swarm.bus.config).
"""

from __future__ import annotations

import ipaddress

__all__ = ["is_encrypted", "is_loopback"]


def is_loopback(endpoint: str) -> bool:
    """Whether only this machine's own processes are at ``endpoint``, or can reach it.

    A name counts as another machine's, but for ``localhost``: what it means may change. So
    does the address that stands for all of this machine's.

    Args:
        endpoint: ``PROTOCOL/HOST:PORT`` or ``unixsock-stream/PATH``.
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
