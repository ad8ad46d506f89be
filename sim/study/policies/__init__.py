"""The policies that studies compare, found by name.

Each is imported when a study asks for it, and not before. Leaves out: what they do.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from difflib import get_close_matches
from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from sim.study.policy import Bound, Policy

__all__ = ["ROSTER", "Entry", "Roster"]


@dataclass(frozen=True, slots=True)
class Entry:
    """Where a policy or a bound is made."""

    module: str
    what: str
    """In that module: the policy, or a class of policies, which is called without arguments or
    with the number behind the colon."""
    parameter: str = ""
    """What that number is, with its unit; empty for a policy without."""
    ideal: bool = False
    """Whether it is modelled with ideal communication only."""


@dataclass(frozen=True, slots=True)
class Roster:
    """Policies by name, and the bound."""

    policies: Mapping[str, Entry]
    bound: Entry

    def fault(self, name: str) -> tuple[str, str] | None:
        """What is wrong with ``name`` and what would be right; None for a policy's name."""
        stem, colon, number = name.partition(":")
        entry = self.policies.get(stem)
        if entry is None:
            close = get_close_matches(stem, self.policies, n=1)
            names = ", ".join(self.policies)
            remedy = f"did you mean {close[0]!r}?" if close else f"the policies are {names}"
            return f"no such policy {name!r}", remedy
        if not colon:
            return None
        if not entry.parameter:
            return f"{name!r} has a number, and {stem} takes none", f"write {stem!r}"
        if _positive(number) is None:
            right = f"give {entry.parameter} > 0, such as {stem + ':60'!r}"
            return f"{name!r} has no number > 0 behind the colon", right
        return None

    def policy(self, name: str) -> Policy:
        """The policy of that name.

        Raises:
            ValueError: there is none.
        """
        stem, _, number = name.partition(":")
        if self.fault(name) is not None:
            raise ValueError(f"no such policy: {name!r}")
        value = _positive(number)
        policy: Policy = _made(self.policies[stem], *(() if value is None else (value,)))
        return policy

    def ideal(self, name: str) -> bool:
        """Whether the policy of that name is modelled with ideal communication only."""
        return self.policies[name.partition(":")[0]].ideal

    def make_bound(self) -> Bound:
        """The bound."""
        bound: Bound = _made(self.bound)
        return bound


def _positive(text: str) -> float | None:
    """The number > 0 that ``text`` is; None if it is none."""
    try:
        number = float(text)
    except ValueError:
        return None
    return number if 0.0 < number < math.inf else None


def _made(entry: Entry, *arguments: float) -> Any:
    what = getattr(import_module(entry.module), entry.what)
    return what(*arguments) if isinstance(what, type) else what


_PACKAGE = "sim.study.policies"
_AGENTS = f"{_PACKAGE}.agents"
ROSTER = Roster(
    policies={
        "guided": Entry(_AGENTS, "GUIDED"),
        "guided-alone": Entry(_AGENTS, "GUIDED_ALONE"),
        "greedy": Entry(_AGENTS, "GREEDY"),
        "lookahead": Entry(_AGENTS, "LOOKAHEAD"),
        "central": Entry(f"{_PACKAGE}.central", "Central", ideal=True),
        "central-divert": Entry(f"{_PACKAGE}.central", "CentralDivert", ideal=True),
        "interval": Entry(
            f"{_PACKAGE}.central", "Interval", parameter="an interval [s]", ideal=True
        ),
        "frozen": Entry(f"{_PACKAGE}.lists", "Frozen", ideal=True),
        "cbba": Entry(f"{_PACKAGE}.auction", "Cbba", ideal=True),
        "nearest": Entry(f"{_PACKAGE}.rules", "NEAREST_FIRST", ideal=True),
        "value-per-time": Entry(f"{_PACKAGE}.rules", "VALUE_PER_TIME_ONLINE", ideal=True),
    },
    bound=Entry(f"{_PACKAGE}.clairvoyant", "Clairvoyant"),
)
"""Those of the project."""
