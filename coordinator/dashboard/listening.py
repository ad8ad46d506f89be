"""A port that is taken before anything else is done, and what a browser calls it.

Leaves out: serving there (coordinator.dashboard.serve).
"""

from __future__ import annotations

import socket

from swarm.errors import Fault, InputError

__all__ = ["listen", "url_of"]


def listen(host: str, port: int, option: str = "--port") -> socket.socket:
    """A socket that accepts connections at ``host``; any free port for 0.

    Raises:
        InputError: there is no such host, or the port is taken or may not be had.
    """
    try:
        family, kind, protocol, _, address = socket.getaddrinfo(
            host.strip("[]"), port, type=socket.SOCK_STREAM, flags=socket.AI_PASSIVE
        )[0]
    except (OSError, UnicodeError) as error:
        problem = f"no such host as {host}: {error}"
        raise InputError(
            Fault("--host", host, problem, "name an address of this machine")
        ) from None
    listening = socket.socket(family, kind, protocol)
    try:
        listening.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        listening.bind(address)
        listening.listen(100)
    except OSError as error:
        listening.close()
        problem = f"cannot listen at {host}, port {port}: {error.strerror or error}"
        remedy = "choose another, or 0 for any that is free"
        raise InputError(Fault(option, "", problem, remedy)) from None
    return listening


def url_of(host: str, port: int) -> str:
    """Where a browser finds what is served there."""
    name = host.strip("[]")
    if name in ("0.0.0.0", "::"):  # noqa: S104 - compared, not bound
        name = socket.gethostname()
    return f"http://{f'[{name}]' if ':' in name else name}:{port}/"
