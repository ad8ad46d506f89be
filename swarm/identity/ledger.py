"""What an authority remembers of all names it ever issued for: role and newest generation.

So the certificate that follows a revoked one bears another name. It holds no secrets.
"""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any, Final

from swarm.identity.roster import Role, RosterEntry

ISSUED_FILE: Final = "issued.json"
_FORMAT: Final = "peckorder authority 1"


@dataclass(frozen=True, slots=True)
class Issued:
    """What was issued for one name."""

    role: Role
    generation: int
    """Of the newest certificate."""


@dataclass(frozen=True, slots=True)
class Ledger:
    """An authority's memory and customs."""

    mission: str
    days: int
    """How long certificates are valid."""
    mesh: bool
    """Whether all may be dialled, not only routers."""
    issued: Mapping[str, Issued]

    def with_next(self, names: Mapping[str, Role]) -> Ledger:
        """The same with ``names`` one generation on; see `why_unfit`."""
        issued = dict(self.issued)
        for name, role in names.items():
            before = issued.get(name)
            issued[name] = Issued(role, 1 if before is None else before.generation + 1)
        return replace(self, issued=issued)

    def why_unfit(self, name: str, role: Role) -> str | None:
        """Why nothing can be issued for ``name`` in ``role``; None if it can."""
        before = self.issued.get(name)
        if before is not None and before.role is not role:
            return f"{name!r} is the name of a {before.role}, and no {role} can get it"
        try:
            RosterEntry(name, role, 1 if before is None else before.generation + 1, bytes(32), 0)
        except ValueError as fault:
            return str(fault)
        return None


def encode_ledger(ledger: Ledger) -> bytes:
    """As text for people, one name a line."""
    days, mesh = json.dumps(ledger.days), json.dumps(ledger.mesh)
    issued = ",\n  ".join(
        f"{json.dumps(name)}: {json.dumps([str(each.role), each.generation])}"
        for name, each in sorted(ledger.issued.items())
    )
    head = f' "format": {json.dumps(_FORMAT)},\n "mission": {json.dumps(ledger.mission)},\n'
    text = f'{{\n{head} "days": {days},\n "mesh": {mesh},\n "issued": {{\n  {issued}\n }}\n}}\n'
    return text.encode("ascii")


def decode_ledger(data: bytes) -> Ledger:
    """The ledger in ``data``.

    Raises:
        ValueError: it holds none.
    """
    document: Any = json.loads(data)
    match document:
        case {
            "format": str(form),
            "mission": str(mission),
            "days": int(days),
            "mesh": bool(mesh),
            "issued": dict(issued),
        } if form == _FORMAT:
            entries = {name: _issued(parts) for name, parts in issued.items()}
            return Ledger(mission, days, mesh, entries)
        case _:
            raise ValueError("it is no list of this version")


def _issued(parts: Any) -> Issued:
    match parts:
        case [str(role), int(generation)]:
            return Issued(Role(role), generation)
        case _:
            raise ValueError("it has an entry that is none")
