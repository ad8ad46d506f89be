"""Where a dashboard is served, and who may look at it or command by it.

Address and port, names of this server, other pages, token, and how often a client may ask. A page
of another origin that a person has open may send requests here; a browser tells its `Origin`. A
name that an attacker's DNS turns to this machine makes that page one of ours; the `Host` tells.
"""

from __future__ import annotations

import hmac
import ipaddress
import os
import re
import secrets
import socket
import stat
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path

from swarm.runtime.errors import Fault, InputError
from swarm.runtime.extras import require_extra

TOKEN_VARIABLE = "SWARM_DASHBOARD_TOKEN"  # noqa: S105 - a variable's name
LEAST_TOKEN = 16
"""Characters of a token; fewer could be guessed."""
_LOOPBACK_NAMES = frozenset({"localhost", "127.0.0.1", "[::1]"})


@dataclass(frozen=True, slots=True)
class AccessRules:
    """What a request has to show."""

    names: frozenset[str]
    """Hosts under which this server may be asked for, in lower case."""
    any_address: bool
    """Whether it may be asked for under any IP address, too: no attacker's DNS makes those."""
    token: str | None
    """Needed for everything that tells of a mission or commands it; None for nothing."""

    def knows_host(self, host: str | None) -> bool:
        """Whether the header ``Host`` names this server."""
        name = _name_of(host or "")
        return name in self.names or (self.any_address and _address(name) is not None)

    def same_origin(self, origin: str | None, host: str | None) -> bool:
        """Whether a request comes from a page of this server, or from no page at all."""
        if origin is None:
            return True
        scheme, _, authority = origin.partition("://")
        return scheme in ("http", "https") and authority.lower() == (host or "").lower()

    def admits(self, token: str | None) -> bool:
        """Whether ``token`` is the one, or none is needed; takes as long for any."""
        if self.token is None:
            return True
        return token is not None and hmac.compare_digest(
            token.encode(errors="replace"), self.token.encode()
        )


@dataclass(slots=True)
class RateLimit:
    """How often each client may ask for something: a burst, and so many a second on average.

    Args:
        clients: at most so many are remembered; the longest unheard of is forgotten.
    """

    burst: float = 20.0
    per_s: float = 4.0
    clients: int = 1000
    _left: dict[str, tuple[float, float]] = field(default_factory=dict)
    """Client -> what it has left, and since when [s]."""

    def allows(self, client: str, now_s: float) -> bool:
        """Whether ``client`` may ask now; counts as asking if it may."""
        left, since_s = self._left.pop(client, (self.burst, now_s))
        left = min(self.burst, left + (now_s - since_s) * self.per_s)
        allowed = left >= 1.0
        self._left[client] = (left - allowed, now_s)
        if len(self._left) > self.clients:
            self._left.pop(next(iter(self._left)))
        return allowed


def access_for(host: str, allowed: Sequence[str], token: str | None) -> tuple[AccessRules, bool]:
    """What requests to a server at ``host`` have to show, and whether the token is a new one.

    ``allowed`` are other names under which it may be asked for. Without a ``token`` it gets one of
    its own where it can be reached from elsewhere.
    """
    names = {_bracketed(name).lower() for name in (*allowed, host)} | _LOOPBACK_NAMES
    if is_loopback(host):
        return AccessRules(frozenset(names), any_address=False, token=token), False
    names.add(socket.gethostname().lower())  # by which people are told where to find it
    made = secrets.token_urlsafe(18) if token is None else token
    return AccessRules(frozenset(names), any_address=True, token=made), token is None


def is_loopback(host: str) -> bool:
    """Whether only this machine reaches a server at ``host``."""
    address = _address(host)
    return host.lower() == "localhost" or (address is not None and address.is_loopback)


def read_token(file: Path | None, environment: Mapping[str, str]) -> str | None:
    """The token that a file or the environment holds, the file first; None without any.

    Raises:
        InputError: the file cannot be read or others may read it, or the token is too short or
            not made of printable ASCII signs.
    """
    if file is None:
        text, where = environment.get(TOKEN_VARIABLE, ""), TOKEN_VARIABLE
        return _checked(text, where) if text else None
    where = f"--token-file {file}"
    try:
        with file.open(encoding="ascii", errors="replace") as opened:
            mode = os.fstat(opened.fileno()).st_mode
            text = opened.read(4096)
    except OSError as error:
        problem = f"cannot be read: {error.strerror or error}"
        raise InputError(Fault(where, "", problem, "name a file with a token")) from None
    if stat.S_ISREG(mode) and mode & (stat.S_IRGRP | stat.S_IROTH):
        raise InputError(Fault(where, "", "others may read it", f"run: chmod 600 {file}"))
    return _checked(text, where)


def _checked(text: str, where: str) -> str:
    token = text.strip()
    if len(token) < LEAST_TOKEN or not (token.isascii() and token.isprintable()) or " " in token:
        problem = f"no token: it must be one word of at least {LEAST_TOKEN} ASCII signs"
        remedy = "make one by: python3 -c 'import secrets; print(secrets.token_urlsafe())'"
        raise InputError(Fault(where, "", problem, remedy))
    return token


def _name_of(host: str) -> str:
    """``Host`` without its port, in lower case."""
    if host.startswith("["):
        return host.partition("]")[0].lower() + "]"
    return host.partition(":")[0].lower()


def _address(host: str) -> ipaddress.IPv4Address | ipaddress.IPv6Address | None:
    try:
        return ipaddress.ip_address(host.strip("[]"))
    except ValueError:
        return None


def _bracketed(host: str) -> str:
    return f"[{host}]" if ":" in host and not host.startswith("[") else host


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


OPTION = "--dashboard"
_PLACE = re.compile(r"(?:(?P<host>\[[0-9A-Fa-f:.]+\]|[^\s:/\[\]]+):)?(?P<port>\d{1,5})")
TOKEN_FILE = "dashboard-token"  # noqa: S105 - a file's name


@dataclass(frozen=True, slots=True)
class ServeAddress:
    """Where a dashboard is served."""

    host: str
    port: int
    url: str
    token: str | None
    """A new one, which nobody knows yet; None where none is needed, or the operator gave one."""

    def arguments(self, folder: Path) -> list[str]:
        """Arguments of `swarm dashboard`; a new token is put into a file in ``folder``."""
        words = ["--host", self.host, "--port", str(self.port)]
        if self.token is None:
            return words
        file = folder / TOKEN_FILE
        file.touch(mode=0o600)
        file.write_text(self.token, encoding="ascii")
        return [*words, "--token-file", str(file)]

    @property
    def lines(self) -> list[str]:
        """What a person is told."""
        token = [] if self.token is None else [f"token: {self.token}"]
        return [f"dashboard: {self.url}", *token]


def parse_serve_address(
    text: str, environment: Mapping[str, str] = os.environ, *, must_be_free: bool = True
) -> ServeAddress:
    """The place that ``[HOST:]PORT`` names; of port 0 any that is free.

    The ``environment`` may hold the token. That a port is taken is a fault if it ``must_be_free``.

    Raises:
        InputError: it is no place, it is taken, or what serves is not installed.
    """
    require_extra("ground", OPTION)
    match = _PLACE.fullmatch(text)
    if match is None or int(match["port"]) > 0xFFFF:
        problem = f"{text!r} is no place to listen at"
        raise InputError(Fault(OPTION, "", problem, "give PORT or ADDRESS:PORT; 0 is any port"))
    host, port = (match["host"] or "127.0.0.1").strip("[]"), int(match["port"])
    access, made = access_for(host, (), read_token(None, environment))
    if must_be_free or port == 0:
        with listen(host, port, OPTION) as taken:
            port = int(taken.getsockname()[1])
    return ServeAddress(host, port, url_of(host, port), access.token if made else None)
