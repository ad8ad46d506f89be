"""From the rows of a study to what they say together, per setting and policy.

Every figure stands on whole trials, which are independent of each other. Comparisons use the trials
that both sides have flown, pair by pair, since these met the same realization.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import asdict, dataclass, field
from statistics import median
from typing import TYPE_CHECKING

from sim.study.statistics import Estimate, difference_of, mean_of, ratio_of, share_of
from sim.study.trial import BOUND, TrialRow
from sim.world.uncertainty import Uncertainty

if TYPE_CHECKING:
    from rich.console import RenderableType

Flights = Mapping[int, TrialRow]
"""Rows of one setting and policy by trial."""

_COUNTED = (
    "done",
    "failed",
    "missed",
    "duplicate_visits",
    "makespan_s",
    "lost_uavs",
    "epochs",
    "moved",
    "released",
    "messages",
    "decisions",
    "required_left",
    "breaches",
)
"""Columns of rows of which means are taken."""
_ROUNDING = 1e-9
"""Of values summed in different orders, relative to them."""


@dataclass(frozen=True, slots=True)
class StudyDescription:
    """What a study is of; whatever is left out is not told."""

    missions: str = ""
    """In words, such as ``random missions of 10 UAVs and 50 tasks``."""
    uncertainty: Uncertainty | None = None
    """The study's own setting."""
    seed: int | None = None
    machine: str = ""
    """On which decisions were timed."""
    ideal: frozenset[str] = frozenset()
    """Policies that are modelled with ideal communication only."""
    what: Mapping[str, str] = field(default_factory=dict)
    """What each policy does, in a few words."""


@dataclass(frozen=True, slots=True)
class WallTimes:
    """Wall times of one policy's decisions on the machine of the study [s]."""

    median_s: float
    """Median over the trials of each trial's median."""
    p99_s: float
    """Median over the trials of each trial's 99 % quantile."""
    max_s: float
    """Longest of all."""


@dataclass(frozen=True, slots=True)
class PolicyResult:
    """One policy in one setting; what it does not have is None."""

    policy: str
    value: Estimate
    """Mean over its trials [value·s]."""
    ratio: Estimate | None
    """Of its mean value to the reference's; of negative ones the greater is worth less."""
    difference: Estimate | None
    """Of its value from the reference's [value·s]."""
    better: Estimate | None
    """Share of trials in which it is worth more than the reference."""
    of_bound: Estimate | None
    """Ratio of its mean value to the clairvoyant bound's."""
    complete: Estimate | None
    """Share of trials in which no task was failed or missed."""
    means: Mapping[str, Estimate]
    """Means over the trials of the row's columns, and of moved + released as ``churn``."""
    wall: WallTimes | None

    @property
    def trials(self) -> int:
        """How many were flown."""
        return self.value.n

    def as_json(self) -> dict[str, object]:
        """Ready for `json.dumps`."""
        names = ("value", "ratio", "difference", "better", "of_bound", "complete")
        found: list[Estimate | None] = [getattr(self, name) for name in names]
        estimates = [None if each is None else each.as_json() for each in found]
        return {
            "trials": self.trials,
            **dict(zip(names, estimates, strict=True)),
            "means": {name: mean.as_json() for name, mean in self.means.items()},
            "decision_wall_s": None
            if self.wall is None
            else {
                "median": self.wall.median_s,
                "p99": self.wall.p99_s,
                "max": self.wall.max_s,
            },
        }


@dataclass(frozen=True, slots=True)
class PointSummary:
    """All policies in one setting of the uncertainty."""

    point: int
    vary: str
    """See sim.study.trial.TrialRow."""
    at: float | None
    trials: int
    """In which anything was flown."""
    policies: Mapping[str, PolicyResult]
    """The bound among them, under its name."""


@dataclass(frozen=True, slots=True)
class StudySummary:
    """What a study says."""

    reference: str
    """The policy to which the others are compared."""
    settings: tuple[PointSummary, ...]
    """By point."""
    about: StudyDescription = field(default_factory=StudyDescription)

    def of(self, setting: PointSummary) -> list[PolicyResult]:
        """All policies of one setting, in the order of `policies`."""
        return [setting.policies[name] for name in self.policies if name in setting.policies]

    @property
    def own(self) -> PointSummary | None:
        """The study's own setting, if it was flown."""
        return next((each for each in self.settings if each.at is None), None)

    @property
    def varied(self) -> dict[str, list[PointSummary]]:
        """Settings by the quantity that is varied to them, each list by its value."""
        found: dict[str, list[PointSummary]] = {}
        for each in self.settings:
            if each.at is not None:
                found.setdefault(each.vary, []).append(each)
        return {name: sorted(them, key=lambda each: each.at or 0.0) for name, them in found.items()}

    @property
    def policies(self) -> list[str]:
        """Best first, by the first setting in which they can be compared; the bound last."""
        better_by: dict[str, float] = {}
        names: dict[str, None] = {}
        for setting in self.settings:
            for name, each in setting.policies.items():
                names[name] = None
                if each.difference is not None:
                    better_by.setdefault(name, each.difference.value)
        return sorted(names, key=lambda name: (name == BOUND, -better_by.get(name, 0.0), name))

    def markdown(self, *, every_setting: bool = False) -> str:
        """Tables for a document; those of ``every_setting`` beside the study's own on request."""
        from sim.study.tables import as_markdown

        return as_markdown(self, every_setting=every_setting)

    def table(self) -> RenderableType:
        """Tables for a terminal."""
        from sim.study.tables import TerminalTables

        return TerminalTables(self)

    def as_json(self) -> dict[str, object]:
        """Ready for `json.dumps`.

        An estimate is ``{"value", "low_95", "high_95", "n"}``, n being the trials it stands on,
        and null for what is undefined or unbounded. ``settings`` lists for every setting
        ``point``, ``vary`` and ``at`` (null for the study's own), ``trials`` and ``policies``,
        by name: ``trials``; the estimates ``value`` [value·s], ``ratio`` and ``difference`` to
        the reference, ``better`` (share of trials worth more than the reference), ``of_bound``
        and ``complete`` (share of trials without a failed or missed task), each null if there is
        none; ``means`` per mission, by column; ``decision_wall_s`` with ``median``, ``p99`` and
        ``max``, null for those that decide nothing.
        """
        about = self.about
        return {
            "reference": self.reference,
            "missions": about.missions,
            "uncertainty": None if about.uncertainty is None else asdict(about.uncertainty),
            "seed": about.seed,
            "machine": about.machine,
            "ideal_communication": sorted(about.ideal),
            "settings": [
                {
                    "point": each.point,
                    "vary": each.vary or None,
                    "at": each.at,
                    "trials": each.trials,
                    "policies": {result.policy: result.as_json() for result in self.of(each)},
                }
                for each in self.settings
            ],
        }


def summarise(
    rows: Iterable[TrialRow], reference: str, about: StudyDescription | None = None
) -> StudySummary:
    """What ``rows`` say together, in whatever order they are, also while some are missing."""
    flown: dict[tuple[int, str, float | None], dict[str, dict[int, TrialRow]]] = {}
    for row in rows:
        setting = flown.setdefault((row.point, row.vary, row.at), {})
        setting.setdefault(row.policy, {})[row.trial] = row
    settings = [
        PointSummary(
            point=point,
            vary=vary,
            at=at,
            trials=len({trial for flights in policies.values() for trial in flights}),
            policies={
                name: _measured(name, flights, policies.get(reference, {}), policies.get(BOUND, {}))
                for name, flights in policies.items()
            },
        )
        for (point, vary, at), policies in flown.items()
    ]
    ordered = tuple(sorted(settings, key=lambda each: each.point))
    return StudySummary(reference, ordered, about or StudyDescription())


def _measured(policy: str, flights: Flights, reference: Flights, bound: Flights) -> PolicyResult:
    rows = [flights[trial] for trial in sorted(flights)]
    ours, theirs = _paired(flights, reference)
    won = [a - b > _ROUNDING * abs(b) for a, b in zip(ours, theirs, strict=True)]
    undone = _sums(rows, "failed", "missed")
    under, above = _paired(flights, bound)
    return PolicyResult(
        policy=policy,
        value=mean_of([row.value for row in rows]),
        ratio=ratio_of(ours, theirs) if ours else None,
        difference=difference_of(ours, theirs) if ours else None,
        better=share_of(sum(won), len(won)) if won else None,
        of_bound=ratio_of(under, above) if under else None,
        complete=share_of(undone.count(0.0), len(undone)) if undone else None,
        means=_means(rows),
        wall=_wall(rows),
    )


def _paired(flights: Flights, others: Flights) -> tuple[list[float], list[float]]:
    """Values of the trials that both have, in the same order."""
    both = sorted(flights.keys() & others.keys())
    return [flights[trial].value for trial in both], [others[trial].value for trial in both]


def _means(rows: Sequence[TrialRow]) -> dict[str, Estimate]:
    columns = {name: _column(rows, name) for name in _COUNTED}
    columns["churn"] = _sums(rows, "moved", "released")
    return {name: mean_of(values) for name, values in columns.items() if values}


def _wall(rows: Sequence[TrialRow]) -> WallTimes | None:
    medians_s = _column(rows, "decision_median_wall_s")
    p99s_s = _column(rows, "decision_p99_wall_s")
    longest_s = _column(rows, "decision_max_wall_s")
    if not medians_s or not p99s_s or not longest_s:
        return None
    return WallTimes(median(medians_s), median(p99s_s), max(longest_s))


def _column(rows: Sequence[TrialRow], name: str) -> list[float]:
    """What the rows have in it."""
    return [float(value) for row in rows if (value := getattr(row, name)) is not None]


def _sums(rows: Sequence[TrialRow], one: str, other: str) -> list[float]:
    """Sum of two columns, of rows that have both or neither."""
    return [a + b for a, b in zip(_column(rows, one), _column(rows, other), strict=True)]
