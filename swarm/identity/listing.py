"""Who has which keys, until when, and what needs attention: as rows, a table or JSON.

It reads and shows nothing secret.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from datetime import UTC, datetime
from pathlib import Path
from typing import Any, Final

from swarm.identity.folder import AUTHORITY_FILE, ROSTER_FILE
from swarm.identity.ledger import ISSUED_FILE, Issued, decode_ledger
from swarm.identity.private_files import checked, decoded
from swarm.identity.roster import Role, Roster, decode_roster
from swarm.runtime.errors import Fault, InputError
from swarm.runtime.table import Column, ResultTable

SOON_DAYS: Final = 14
"""Certificates that end within this time are warned of."""
_DAY_S: Final = 86_400.0
_RESTORE: Final = "put a copy of the folder back"


@dataclass(frozen=True, slots=True)
class IdentityRow:
    """One name."""

    name: str
    role: Role
    generation: int
    not_after_s: int | None
    """When its certificate expires [unix s]; None for one that is not in force."""
    days_left: int | None
    """Whole days until then, below 0 once it has expired; None for one not in force."""

    @property
    def state(self) -> str:
        """``in force``, ``expires soon``, ``expired`` or ``revoked``."""
        if self.days_left is None:
            return "revoked"
        if self.days_left < 0:
            return "expired"
        return "expires soon" if self.days_left < SOON_DAYS else "in force"


def read_lists(directory: Path) -> tuple[Roster, Mapping[str, Issued]]:
    """The roster in an authority's folder, or in a machine's, and what was ever issued.

    Of the latter a machine's folder knows nothing.

    Raises:
        InputError: it is no such folder, or a file in it is missing or damaged.
    """
    from swarm.identity.certificates import public_bytes, read_certificate

    certificate_path = directory / AUTHORITY_FILE
    if not certificate_path.exists():
        problem = "holds no keys" if directory.exists() else "no such folder"
        remedy = "give a folder that 'swarm keys' made"
        raise InputError(Fault(str(directory), "", problem, remedy))
    certificate = decoded(certificate_path, read_certificate, _RESTORE)
    public_key = checked(certificate_path, public_bytes, certificate, _RESTORE)
    roster = decoded(
        directory / ROSTER_FILE, lambda data: decode_roster(data, public_key), _RESTORE
    )
    if not (directory / ISSUED_FILE).exists():
        return roster, {}
    return roster, decoded(directory / ISSUED_FILE, decode_ledger, _RESTORE).issued


def listing_rows(roster: Roster, issued: Mapping[str, Issued], now_s: float) -> list[IdentityRow]:
    """Everyone in ``roster``, and those of ``issued`` who are not; by role, then by name."""
    rows = [
        IdentityRow(
            entry.name,
            entry.role,
            entry.generation,
            entry.not_after_s,
            math.floor((entry.not_after_s - now_s) / _DAY_S),
        )
        for entry in roster.entries
    ]
    rows += [
        IdentityRow(name, each.role, each.generation, None, None)
        for name, each in issued.items()
        if roster.entry(name) is None
    ]
    roles = list(Role)
    return sorted(rows, key=lambda row: (roles.index(row.role), len(row.name), row.name))


def listing_table(rows: list[IdentityRow]) -> ResultTable:
    """The rows for a terminal."""
    from rich.text import Text

    titles = ("name", "role", "generation", "expires", "")
    columns = [Column(title, words=title != "generation") for title in titles]
    cells = []
    for row in rows:
        style = {"expired": "red", "expires soon": "yellow", "revoked": "dim"}.get(row.state, "")
        ends = "" if row.not_after_s is None else _date(row.not_after_s)
        words = (row.name, row.role, str(row.generation), ends, _words(row))
        cells.append([Text(word, style) for word in words])
    return ResultTable(columns, cells)


def attention(rows: list[IdentityRow], folder: str) -> str | None:
    """What is to be done about certificates that end; None if nothing is."""
    ending = [row.name for row in rows if row.state in ("expired", "expires soon")]
    if not ending:
        return None
    names = ", ".join(ending[:5]) + (f" and {len(ending) - 5} more" if len(ending) > 5 else "")
    remedy = (
        f"swarm keys add {folder} {' '.join(ending)}"
        if len(ending) < 5
        else f"swarm keys renew {folder}"
    )
    return f"expired, or within {SOON_DAYS} days: {names}; issue anew: {remedy}"


def listing_as_json(roster: Roster, rows: list[IdentityRow]) -> dict[str, Any]:
    """The same for programs."""
    keys = ("name", "role", "generation", "state", "not_after_s", "days_left")
    return {
        "mission": roster.mission,
        "series": roster.series.hex(),
        "version": roster.version,
        "identities": [{key: getattr(row, key) for key in keys} for row in rows],
    }


def _words(row: IdentityRow) -> str:
    if row.state == "expires soon":
        return "ends today" if row.days_left == 0 else f"ends in {row.days_left} d"
    return "" if row.state == "in force" else row.state


def _date(time_s: float) -> str:
    return datetime.fromtimestamp(time_s, UTC).strftime("%Y-%m-%d")
