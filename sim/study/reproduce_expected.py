"""What the paper prints, what has been checked before, and how a figure is held against them.

Leaves out: computing anything.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

__all__ = ["Check", "Expectations", "PaperFigures", "Printed", "printed_check"]


@dataclass(frozen=True, slots=True)
class Printed:
    """A figure and how many of its decimals are printed."""

    value: float
    decimals: int

    def agrees(self, ours: float) -> bool:
        """Whether ``ours`` rounds to the printed digits; either neighbour at a tie."""
        return abs(ours - self.value) <= 0.5 * 10.0**-self.decimals + 1e-9

    def __str__(self) -> str:
        return f"{self.value:.{self.decimals}f}"


@dataclass(frozen=True, slots=True)
class Check:
    """One thing that must come out right."""

    name: str
    ours: str
    expected: str
    ok: bool


def printed_check(name: str, ours: float, expected: Printed) -> Check:
    """Whether ``ours`` is ``expected`` to its printed digits."""
    return Check(name, f"{ours:.{expected.decimals}f}", str(expected), expected.agrees(ours))


@dataclass(frozen=True, slots=True)
class PaperFigures:
    """What the paper reports; shown beside ours."""

    optimum: Printed = Printed(120.3, 1)
    """Table II [value·s]."""
    hierarchical: Printed = Printed(110.7, 1)
    """Table II: the plan of its two-level hierarchy [value·s]."""
    normalised: Mapping[str, Printed] = field(
        default_factory=lambda: {"greedy": Printed(0.88, 2), "lookahead": Printed(0.85, 2)}
    )
    """Average over 50 random problems; worst plan 0, optimum 1."""


@dataclass(frozen=True, slots=True)
class Expectations:
    """Figures that must come out; deviating from one fails the reproduction.

    J is in value·s, sequences and lists are in the paper's numbers, from 1.
    """

    paper: PaperFigures = PaperFigures()
    optimum: Printed = Printed(120.3335, 4)
    optimal_lists: tuple[tuple[int, ...], ...] = ((2, 3, 1), (6, 8, 7), (4, 5))
    worst: Printed = Printed(-141.8787, 4)
    greedy: Mapping[tuple[int, ...], Printed] = field(
        default_factory=lambda: {
            (1, 2, 3): Printed(116.1364, 4),
            (1, 3, 2): Printed(118.4939, 4),
            (2, 1, 3): Printed(104.2051, 4),
            (2, 3, 1): Printed(113.6739, 4),
            (3, 1, 2): Printed(118.4939, 4),
            (3, 2, 1): Printed(113.6739, 4),
        }
    )
    """By priority sequence."""
    lookahead: Mapping[tuple[int, ...], Printed] = field(
        default_factory=lambda: {(3, 1, 2): Printed(115.4152, 4)}
    )
    """The best sequence; the others are below it."""
    guided: Printed = Printed(120.3335, 4)
    optimum_at_horizon: Mapping[float, Printed] = field(
        default_factory=lambda: {
            6.0: Printed(155.53, 2),
            7.0: Printed(190.99, 2),
            8.0: Printed(226.99, 2),
            10.0: Printed(298.99, 2),
        }
    )
    """By D [s]."""
    normalised_at_least: Mapping[str, float] = field(
        default_factory=lambda: {"greedy": 0.96, "guided": 0.999}
    )
    """Average over the random problems that the 95 % interval must reach."""
