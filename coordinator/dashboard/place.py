"""Where a command that flies or coordinates lets its dashboard be served, and under which token.

Leaves out: serving it (coordinator.dashboard.cli).
"""

from __future__ import annotations

import os
import re
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

from coordinator.dashboard.access import access_for, read_token
from coordinator.dashboard.listening import listen, url_of
from swarm.errors import Fault, InputError

__all__ = ["Place", "parse_place"]

OPTION = "--dashboard"
_PLACE = re.compile(r"(?:(?P<host>\[[0-9A-Fa-f:.]+\]|[^\s:/\[\]]+):)?(?P<port>\d{1,5})")
TOKEN_FILE = "dashboard-token"  # noqa: S105 - a file's name


@dataclass(frozen=True, slots=True)
class Place:
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


def parse_place(
    text: str, environment: Mapping[str, str] = os.environ, *, must_be_free: bool = True
) -> Place:
    """The place that ``[HOST:]PORT`` names; of port 0 any that is free.

    Args:
        text: what was given.
        environment: may hold the token.
        must_be_free: whether a port that is taken is a fault now.

    Raises:
        InputError: it is no place, or it is taken.
    """
    match = _PLACE.fullmatch(text)
    if match is None or int(match["port"]) > 0xFFFF:
        problem = f"{text!r} is no place to listen at"
        raise InputError(Fault(OPTION, "", problem, "give PORT or ADDRESS:PORT; 0 is any port"))
    host, port = (match["host"] or "127.0.0.1").strip("[]"), int(match["port"])
    access, made = access_for(host, (), read_token(None, environment))
    if must_be_free or port == 0:
        with listen(host, port, OPTION) as taken:
            port = int(taken.getsockname()[1])
    return Place(host, port, url_of(host, port), access.token if made else None)
