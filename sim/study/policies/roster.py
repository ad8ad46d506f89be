"""What a policy looks like, and the policies that studies compare, by name.

Each is imported when a study asks for it, and not before.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from difflib import get_close_matches
from importlib import import_module
from typing import TYPE_CHECKING, Any, Protocol

from swarm.model import Mission, Plan

if TYPE_CHECKING:
    from sim.study.policies.clairvoyant import Clairvoyant
    from sim.world.outcome import FlightOutcome
    from sim.world.uncertainty import Realization
    from swarm.runtime.clock import Clock

Planner = Callable[[Mission, str], Plan]
"""The offline plan of what is known of a mission at its start, by method; the same for all
policies that meet the same realization, and worked out once."""


class Policy(Protocol):
    """A way to run a fleet."""

    @property
    def name(self) -> str:
        """By which studies ask for it."""
        ...

    @property
    def what(self) -> str:
        """In a few words, for a table."""
        ...

    def fly(self, fate: Realization, plan: Planner, clock: Clock) -> FlightOutcome:
        """Fly a mission to its end; the clock times decisions, and decides nothing."""
        ...


@dataclass(frozen=True, slots=True)
class PolicyEntry:
    """Where a policy or a bound is made."""

    module: str
    what: str
    """In that module: the policy, or what makes one, from the number behind the colon if any."""
    parameter: str = ""
    """What that number is, with its unit; empty for a policy without."""
    ideal: bool = False
    """Whether it is modelled with ideal communication only."""
    field: str = ""
    """In `sim.study.policies.field_agents`, what flies missions in the field; the same as for plain
    ones when empty, nothing when ``-``."""


@dataclass(frozen=True, slots=True)
class PolicyRoster:
    """Policies by name, and the bound."""

    policies: Mapping[str, PolicyEntry]
    bound: PolicyEntry

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

    def in_field(self, name: str) -> bool:
        """Whether the policy of that name flies missions in the field."""
        return self.policies[name.partition(":")[0]].field != _NOWHERE

    def names(self, *, in_field: bool) -> tuple[str, ...]:
        """All, or those that fly missions in the field."""
        return tuple(name for name in self.policies if not in_field or self.in_field(name))

    def policy(self, name: str, *, in_field: bool = False) -> Policy:
        """The policy of that name; the one for missions ``in_field`` if asked.

        Raises:
            ValueError: there is none.
        """
        stem, _, number = name.partition(":")
        if self.fault(name) is not None:
            raise ValueError(f"no such policy: {name!r}")
        value = _positive(number)
        entry = self.policies[stem]
        if in_field and entry.field:
            entry = PolicyEntry(_FIELD_AGENTS, entry.field)
        policy: Policy = _made(entry, *(() if value is None else (value,)))
        return policy

    def ideal(self, name: str) -> bool:
        """Whether the policy of that name is modelled with ideal communication only."""
        return self.policies[name.partition(":")[0]].ideal

    def make_bound(self) -> Clairvoyant:
        """The bound."""
        bound: Clairvoyant = _made(self.bound)
        return bound


def _positive(text: str) -> float | None:
    """The number > 0 that ``text`` is; None if it is none."""
    try:
        number = float(text)
    except ValueError:
        return None
    return number if 0.0 < number < math.inf else None


def _made(entry: PolicyEntry, *arguments: float) -> Any:
    what = getattr(import_module(entry.module), entry.what)
    return what(*arguments) if callable(what) else what


_PACKAGE = "sim.study.policies"
_AGENTS, _DISPATCHERS = f"{_PACKAGE}.agents", f"{_PACKAGE}.dispatchers"
_REPLANNING = f"{_PACKAGE}.replanning"
_FIELD_AGENTS = f"{_PACKAGE}.field_agents"
_NOWHERE = "-"

ROSTER = PolicyRoster(
    policies={
        "guided": PolicyEntry(_AGENTS, "GUIDED"),
        "guided-alone": PolicyEntry(_AGENTS, "GUIDED_ALONE"),
        "greedy": PolicyEntry(_AGENTS, "GREEDY"),
        "lookahead": PolicyEntry(_AGENTS, "LOOKAHEAD"),
        "central": PolicyEntry(_REPLANNING, "CENTRAL", ideal=True, field="CENTRAL"),
        "central-divert": PolicyEntry(_REPLANNING, "CENTRAL_DIVERT", ideal=True, field=_NOWHERE),
        "interval": PolicyEntry(
            _REPLANNING, "interval", parameter="an interval [s]", ideal=True, field=_NOWHERE
        ),
        "frozen": PolicyEntry(_DISPATCHERS, "FROZEN", ideal=True, field="FROZEN"),
        "cbba": PolicyEntry(_REPLANNING, "CBBA", ideal=True, field="CBBA"),
        "nearest": PolicyEntry(_DISPATCHERS, "NEAREST_FIRST", ideal=True, field="NEAREST"),
        "value-per-time": PolicyEntry(
            _DISPATCHERS, "VALUE_PER_TIME_ONLINE", ideal=True, field="VALUE_PER_TIME"
        ),
    },
    bound=PolicyEntry(f"{_PACKAGE}.clairvoyant", "Clairvoyant"),
)
"""Those of the project."""
