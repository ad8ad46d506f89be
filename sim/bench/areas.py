"""How soon an area is covered by our lists, by a fixed split and by OR-Tools' lists.

Undisturbed, and with one UAV lost. Coverage is of what is allowed: the areas without their holes
and without zones with their margin.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import asdict, dataclass, field, fields
from itertools import groupby
from statistics import fmean
from typing import Any, NamedTuple

from rich.console import RenderableType

from sim.bench.area_coverage import CoverageCurve
from sim.bench.area_methods import METHODS, AreaCase, AreaFlight, Loss, SearchTimes
from sim.bench.machine import this_machine
from sim.bench.results import BenchResult, Progress, table_of, unheard
from sim.study.baselines import ortools_field
from swarm.model import Mission
from swarm.runtime.clock import Clock
from swarm.runtime.table import Column, ResultTable

COVERED_FRAC = 0.995
"""What counts as covered."""
UNDISTURBED, ONE_LOSS = "undisturbed", "one loss"


@dataclass(frozen=True, slots=True)
class AreaRun:
    """One mission flown by one method."""

    case: str
    method: str
    seed: int | None
    """None where the method has none and nothing is drawn."""
    lost: str | None
    """Which UAV was lost."""
    lost_s: float | None
    """And when [s mission time]."""
    lines: int
    """Flown to their ends."""
    broken: int
    """On lists that could not be flown where they stood."""
    objective: float
    """J of eq. 1 [value·s]."""
    covered: float
    """In the end."""
    covered_s: float | None
    """When `COVERED_FRAC` was covered [s mission time]; None: never."""
    makespan_s: float
    """End of the last line [s mission time]."""
    mean_covered: float
    """Over the time until all methods that meet this future have ended."""
    curve: CoverageCurve = field(repr=False)


@dataclass(frozen=True, slots=True)
class AreaRow:
    """All runs of one case by one method, as a line of the table; means over seeds."""

    case: str
    method: str
    runs: int
    mean_covered: float
    mean_ratio: float
    """Of mean coverages to the best method's with the same seed."""
    least_mean_ratio: float
    covered_s: float | None
    """None where one run never came to it, as in what follows."""
    covered_ratio: float | None
    """Of times to the best method's with the same seed."""
    worst_covered_ratio: float | None
    covered: float
    """The least."""
    makespan_s: float


@dataclass(frozen=True, slots=True)
class AreasBench(BenchResult):
    """Everything measured in one run."""

    mission: str
    n_uav: int
    n_line: int
    guided_s: float
    """How long ours searched [s]."""
    ortools_s: float
    """And OR-Tools [s]."""
    runs: tuple[AreaRun, ...]
    refused: tuple[str, ...] = ()
    """Which methods had no words for the mission, and why."""

    def as_json(self) -> dict[str, Any]:
        """Everything, ready for `json.dumps`."""
        parts = {key: value for key, value in _shallow(self).items() if key != "runs"}
        parts["machine"] = asdict(self.machine)
        parts["methods"] = [asdict(row) for row in self.rows()]
        parts["runs"] = [
            _shallow(run)
            | {
                "curve": {
                    "begin_s": run.curve.begin_s.tolist(),
                    "end_s": run.curve.end_s.tolist(),
                    "covered": run.curve.share.tolist(),
                }
            }
            for run in self.runs
        ]
        return parts

    def parts(self) -> Iterable[RenderableType]:
        """See `BenchResult`."""
        yield self._about()
        for grid in self.grids():
            yield grid
            yield ""
        yield from self._notes()

    def as_markdown(self) -> str:
        """Everything for a document."""
        about = f"Measured on {self.machine}. {self._about()}"
        tables = (grid.as_markdown() for grid in self.grids())
        return "\n\n".join([about, *tables, *self._notes()]) + "\n"

    def grids(self) -> Iterable[ResultTable]:
        """A table per case."""
        for case, rows in groupby(self.rows(), lambda row: row.case):
            yield table_of(
                rows,
                Column("method", key="method", words=True),
                Column("mean coverage", ".2f", "%", 100.0, "mean_covered"),
                Column("/ best", ".4f", key="mean_ratio"),
                Column(f"{COVERED_FRAC:.1%} after", ".0f", "s", key="covered_s"),
                Column("/ best", ".3f", key="covered_ratio"),
                Column("worst", ".3f", key="worst_covered_ratio"),
                Column("in the end", ".2f", "%", 100.0, "covered"),
                Column("last line", ".0f", "s", key="makespan_s"),
                title=case[0].upper() + case[1:],
            )

    def rows(self) -> Iterable[AreaRow]:
        """A row per case and method."""
        for case in (UNDISTURBED, ONE_LOSS):
            for method in dict.fromkeys(run.method for run in self.runs if run.case == case):
                yield _row(case, method, self.runs)

    def _about(self) -> str:
        seeds = dict.fromkeys(run.seed for run in self.runs if run.seed is not None)
        seeded = f" seeds {', '.join(map(str, seeds))};" if seeds else ""
        return (
            f"{self.mission}: {self.n_line} lines for {self.n_uav} UAVs; guided {self.guided_s:g} "
            f"s, OR-Tools {self.ortools_s:g} s;{seeded} means over seeds, ratios to the best "
            "method of the same seed."
        )

    def _notes(self) -> Iterable[str]:
        methods = dict.fromkeys(run.method for run in self.runs)
        yield "; ".join(f"{name}: {METHODS[name].what}" for name in methods) + "."
        yield _MEASURED
        if any(run.case == ONE_LOSS for run in self.runs):
            yield _LOSSES
        if any(name.startswith("ortools") for name in methods):
            yield ortools_field.LEFT_OUT + _NO_SLOTS
        yield from self.refused


_MEASURED = (
    "Mean coverage is the area under the curve of coverage over time, up to the latest end of any "
    "method; in the end: the least of all seeds."
)
_LOSSES = (
    "One loss: a random UAV at a random moment within 0.2 to 0.6 of the makespan of strips. What "
    "is left of its strips is flown by whoever is first through with the own ones, straight on; "
    "guided is flown by the real agents and their coordinator in virtual time."
)
_NO_SLOTS = " Nor does it know how many UAVs a base serves at a time: they wait when flown."


def measure_areas(
    mission: Mission,
    seeds: Sequence[int],
    methods: Sequence[str],
    times: SearchTimes,
    clock: Clock,
    *,
    tell: Progress = unheard,
) -> AreasBench:
    """Fly the mission by each method, undisturbed and with one UAV lost by each seed.

    Methods without seeds fly it undisturbed once. With a loss guided and the splits are flown.

    Raises:
        InputError: the mission is none to compare by its coverage.
    """
    machine, case = this_machine(), AreaCase(mission, times, clock)
    refusals = {name: METHODS[name].refusal(case) for name in methods}
    able = [name for name in methods if refusals[name] is None]
    flights: list[_MethodFlight] = []
    for name in able:
        if (fly := METHODS[name].fly) is None:
            continue
        for seed in seeds if METHODS[name].seeded else (None,):
            tell(f"{UNDISTURBED}, {name}, seed {seed}")
            flights.append(_MethodFlight(name, seed, fly(case, seed or 0)))
    runs = _runs(case, UNDISTURBED, flights)
    for seed in seeds:
        loss, flights = case.loss(seed), []
        for name in able:
            if (fly_under_loss := METHODS[name].fly_under_loss) is not None:
                tell(f"{ONE_LOSS}, {name}, seed {seed}")
                flights.append(_MethodFlight(name, seed, fly_under_loss(case, seed, loss)))
        runs += _runs(case, ONE_LOSS, flights, loss)
    return AreasBench(
        machine=machine,
        mission=mission.name,
        n_uav=case.problem.n_uav,
        n_line=case.problem.n_task,
        guided_s=times.guided_s,
        ortools_s=times.ortools_s,
        runs=tuple(runs),
        refused=tuple(f"{name}: {why}." for name, why in refusals.items() if why is not None),
    )


class _MethodFlight(NamedTuple):
    method: str
    seed: int | None
    flight: AreaFlight


def _runs(
    case: AreaCase, name: str, flights: Sequence[_MethodFlight], loss: Loss | None = None
) -> list[AreaRun]:
    """What is told of flights that met the same future."""
    curves = [CoverageCurve.of(case.ground, flown.flight.lines) for flown in flights]
    until_s = max((curve.makespan_s for curve in curves), default=0.0)
    return [
        AreaRun(
            case=name,
            method=flown.method,
            seed=flown.seed,
            lost=None if loss is None else loss.uav,
            lost_s=None if loss is None else loss.at_s,
            lines=len(flown.flight.lines),
            broken=flown.flight.broken,
            objective=flown.flight.objective,
            covered=curve.covered,
            covered_s=curve.reached_s(COVERED_FRAC),
            makespan_s=curve.makespan_s,
            mean_covered=curve.mean(until_s),
            curve=curve,
        )
        for flown, curve in zip(flights, curves, strict=True)
    ]


def _row(case: str, method: str, runs: Sequence[AreaRun]) -> AreaRow:
    own = [run for run in runs if (run.case, run.method) == (case, method)]
    mean_ratios = [
        mine.mean_covered / max(run.mean_covered for run in beside)
        for mine, beside in _by_seed(runs, case, method)
    ]
    ratios = covered_ratios(runs, case, method)
    return AreaRow(
        case=case,
        method=method,
        runs=len(own),
        mean_covered=fmean(run.mean_covered for run in own),
        mean_ratio=fmean(mean_ratios),
        least_mean_ratio=min(mean_ratios),
        covered_s=_if_all([run.covered_s for run in own], fmean),
        covered_ratio=_if_all(ratios, fmean),
        worst_covered_ratio=_if_all(ratios, max),
        covered=min(run.covered for run in own),
        makespan_s=fmean(run.makespan_s for run in own),
    )


def covered_ratios(runs: Sequence[AreaRun], case: str, method: str) -> list[float | None]:
    """By seed, the time until all is covered as a ratio to the best method's; None: it never is."""
    return [
        None
        if mine.covered_s is None
        else mine.covered_s / min(run.covered_s for run in beside if run.covered_s is not None)
        for mine, beside in _by_seed(runs, case, method)
    ]


def _by_seed(
    runs: Sequence[AreaRun], case: str, method: str
) -> Iterator[tuple[AreaRun, list[AreaRun]]]:
    """The method's run with each seed, and those of all methods with that seed or without any."""
    found = [run for run in runs if run.case == case]
    for seed in dict.fromkeys(run.seed for run in found if run.seed is not None) or (None,):
        beside = [run for run in found if run.seed in (seed, None)]
        yield next(run for run in beside if run.method == method), beside


def _if_all(values: Sequence[float | None], of: Callable[[Sequence[float]], float]) -> float | None:
    there = [value for value in values if value is not None]
    return of(there) if len(there) == len(values) else None


def _shallow(record: Any) -> dict[str, Any]:
    return {each.name: getattr(record, each.name) for each in fields(record)}
