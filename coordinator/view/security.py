"""What protected a run, and how much was refused by it: for the picture and the report.

Leaves out: protecting (swarm.bus, swarm.wire, agent.mavlink).
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field

from coordinator.view.comparison import Fact

__all__ = ["Security", "refusals"]

_HARMLESS = frozenset({"stale", "not forwarded"})
"""Reasons for which honest messages are dropped as well."""


def refusals(dropped: Iterable[Mapping[str, int]]) -> Counter[str]:
    """What was refused, by reason: all that was dropped but what honest ones drop, too.

    Args:
        dropped: messages and frames dropped, by reason, of each process that tells.
    """
    total: Counter[str] = Counter()
    for counts in dropped:
        total.update({reason: n for reason, n in counts.items() if reason not in _HARMLESS})
    return +total


@dataclass(frozen=True, slots=True)
class Security:
    """Of a run with keys."""

    measures: tuple[str, ...]
    """What was on, in words."""
    lacking: tuple[str, ...] = ()
    """What was not, and why."""
    refused: Mapping[str, int] = field(default_factory=dict)
    """Messages and MAVLink frames refused by the UAVs and the onlooker, by reason."""

    @property
    def fact(self) -> Fact:
        """In a line of a report."""
        total = sum(self.refused.values())
        told = f"{total} refused" if total else "nothing was refused"
        by = tuple(f"{count} {reason}" for reason, count in sorted(self.refused.items()))
        parts = "; ".join((", ".join(self.measures), *self.lacking, told))
        return Fact("secure", parts, by, bad=bool(total))

    def as_json(self) -> dict[str, object]:
        """Ready for `json.dumps`."""
        return {
            "measures": list(self.measures),
            "lacking": list(self.lacking),
            "refused": dict(self.refused),
        }
