"""A reproduction for people: tables of 80 columns, ours beside the paper's, and why they differ."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from rich.console import Group, RenderableType
from rich.text import Text

from sim.study.paper.random_problems import READINGS, STUDIED, Average, Reading
from sim.study.paper.reproduction import MethodTimes, Reproduction
from sim.study.paper.tables import RULES, SequenceValue, lists_text
from swarm.runtime.table import Column, ResultTable

_SCALES = {"worst": "worst plan 0, optimum 1", "ratio": "J / optimum"}
_SEQUENCES = {
    "best": "best of the sequences",
    "mean": "mean of the sequences",
    "worst": "worst of the sequences",
}


def reproduction_text(found: Reproduction, drawn: Sequence[Path] = ()) -> RenderableType:
    """Everything, with the verdict last."""
    parts: list[RenderableType] = [
        *_table_part(found),
        *_random_part(found),
        *_times_part(found.times, str(found.machine)),
        *_theorems_part(found),
    ]
    if drawn:
        parts += [_head("Figures"), *(Text(line) for line in _drawn_lines(found, drawn)), ""]
    return Group(*parts, *_verdict_part(found))


def _table_part(found: Reproduction) -> list[RenderableType]:
    table, paper = found.table, found.expected.paper
    papers: list[tuple[str, str | None, object]] = [
        ("optimum, proven", "exact", paper.optimum),
        ("hierarchical plan", None, paper.hierarchical),
        *((f"  {rule}, best sequence", rule, None) for rule in RULES),
        ("guided", "guided", None),
    ]
    rows = [
        (name, None, figure, "ours, by rule:")
        if method is None
        else (name, table.plans[method].objective, figure, lists_text(table.lists(method)))
        for name, method, figure in papers
    ]
    plans = ResultTable(
        (
            Column("J [value·s]", words=True),
            Column("ours", ".4f"),
            Column("paper", str),
            Column("lists (UAV 1)(UAV 2)(UAV 3)", words=True),
        ),
        [*rows, ("worst plan", table.worst, None, "")],
    )
    sequences = ResultTable(
        (
            Column("sequence", words=True),
            *(
                column
                for rule in RULES
                for column in (Column(rule, ".4f"), Column("lists", lists_text, words=True))
            ),
        ),
        [
            (_sequence(pair[0]), *(cell for each in pair for cell in (each.objective, each.lists)))
            for pair in zip(*(table.of_rule(rule) for rule in RULES), strict=True)
        ],
    )
    optima = table.optimum_at_horizon.items()
    horizons = ", ".join(f"{horizon_s:g}: {value:.2f}" for horizon_s, value in optima)
    n_uav, n_task = len(table.mission.uavs), len(table.mission.tasks)
    return [
        _head(f"Tables I and II: {n_uav} UAVs, {n_task} targets, D = {table.mission.horizon_s:g}"),
        plans,
        "",
        sequences,
        "",
        Text(_why_not_hierarchical(found)),
        Text(f"Optimum at D = {horizons}."),
        "",
    ]


def _why_not_hierarchical(found: Reproduction) -> str:
    table, figure = found.table, found.expected.paper.hierarchical
    hits = [each for each in table.sequences if figure.agrees(each.objective)]
    if hits:
        ways = "; ".join(f"{each.rule} in sequence {_sequence(each)}" for each in hits)
        return f"The paper's {figure} for its hierarchical plan comes from {ways}."
    near = table.nearest(figure)
    beaten = [rule for rule in RULES if table.best(rule).objective > figure.value]
    best = " and ".join(f"{rule} {table.best(rule).objective:.1f}" for rule in beaten)
    text = (
        f"The paper's {figure} for its hierarchical plan comes from neither rule as written, in "
        f"none of the {len(table.of_rule(RULES[0]))} sequences; nearest is {near.rule} in "
        f"{_sequence(near)} with {near.objective:.1f}. So it is shown and not imitated."
    )
    return f"{text} With the sequence searched the rules are worth more: {best}." if best else text


def _random_part(found: Reproduction) -> list[RenderableType]:
    random, paper = found.random, found.expected.paper
    averages = []
    for method in STUDIED:
        average, figure = random.average(method), paper.normalised.get(method)
        over = None if figure is None else average.mean - figure.value
        lowest = random.normalised(method).min()
        averages.append((method, _average(average), float(lowest), figure, over))
    readings: list[tuple[object, ...]] = [
        (
            _SCALES[reading.scale],
            _SEQUENCES[reading.sequence],
            *(float(random.read(rule, reading).mean()) for rule in RULES),
        )
        for reading in READINGS
    ]
    readings.append(("the paper reports", "", *(str(paper.normalised[rule]) for rule in RULES)))
    noun = "problem" if len(random.problems) == 1 else "problems"
    return [
        _head(f"{len(random.problems)} random {noun}, seed {random.seed}"),
        Text(
            "Targets uniform in 10 × 10, all UAVs at (x, 0) with x uniform in 0..10, the rest as "
            "in Table I. J is 0 for the worst plan and 1 for the optimum; greedy and lookahead "
            "by their best sequence, guided by its planned lists."
        ),
        "",
        ResultTable(
            (
                Column("method", words=True),
                Column("ours, 95 % interval"),
                Column("lowest", ".3f"),
                Column("paper", str),
                Column("ours − paper", "+.3f"),
            ),
            averages,
        ),
        "",
        ResultTable(
            (
                Column("what may be averaged", words=True),
                Column("", words=True),
                *(Column(rule, ".3f") for rule in RULES),
            ),
            readings,
        ),
        "",
        Text(_why_not_average(found)),
        "",
    ]


def _why_not_average(found: Reproduction) -> str:
    random, paper = found.random, found.expected.paper

    def means(reading: Reading) -> dict[str, float]:
        return {rule: float(random.read(rule, reading).mean()) for rule in RULES}

    lowest = means(Reading("worst", "worst"))
    above = all(lowest[rule] > figure.value for rule, figure in paper.normalised.items())
    close = random.closest_reading(paper)
    told = " and ".join(f"{value:.2f}" for value in means(close).values())
    start = (
        "Averaging over the sequences instead of searching them does not explain the paper's "
        "figures: on its scale even the worst sequence of each problem is above them."
        if above
        else "On the paper's scale the worst sequence of each problem comes down to its figures."
    )
    return (
        f"{start} Of these readings {_SCALES[close.scale]} with the {_SEQUENCES[close.sequence]} "
        f"comes closest ({told}); what the paper averaged cannot be told from its figures."
    )


def _times_part(times: MethodTimes, machine: str) -> list[RenderableType]:
    names = {
        "optimum": "optimum, dynamic programming",
        "lookahead": "lookahead, all sequences",
        "greedy": "greedy, all sequences",
    }
    rows = ResultTable(
        (
            Column("time for one problem", words=True),
            Column("median", ".1f", "µs", 1e6),
            Column("of greedy's", "{:.2f} ×".format),
        ),
        [(name, times.median_s[method], times.ratio(method)) for method, name in names.items()],
    )
    return [
        _head("Times relative to each other"),
        rows,
        "",
        Text(
            f"One thread, {times.problems} of the random problems, {times.repeats} rounds taking "
            f"turns; {machine}. The paper's own ratios are not at hand. Compiled dynamic "
            "programming makes the optimum cheap at this size, but it grows as 3^M, lookahead as "
            "2^M and greedy as M²."
        ),
        "",
    ]


def _theorems_part(found: Reproduction) -> list[RenderableType]:
    rows = ResultTable(
        (Column("against brute force", words=True), Column("violations"), Column("cases")),
        [(theorem.name, theorem.violations, theorem.cases) for theorem in found.theorems],
    )
    said = [Text(f"{each.name}: {each.claim} ({each.remark}).") for each in found.theorems]
    return [_head("Theorems"), rows, "", *said, ""]


def _drawn_lines(found: Reproduction, drawn: Sequence[Path]) -> list[str]:
    rule = max(RULES, key=lambda each: found.table.plans[each].objective)
    random = (
        "Fig. 4: every random problem's J between worst plan and optimum, and the averages beside "
        "the paper's; our reading of what the paper draws."
    )
    return [
        f"Fig. 2: Table I's lists by the hierarchy, {rule} in its best sequence.",
        "Fig. 3: Table I's optimal lists.",
        random,
        f"In {drawn[0].parent}: {', '.join(path.name for path in drawn)}",
    ]


def _verdict_part(found: Reproduction) -> list[RenderableType]:
    checks = found.checks
    failed = [check for check in checks if not check.ok]
    spent = f"{found.elapsed_s:.1f} s"
    if not failed:
        return [Text(f"All {len(checks)} checks hold; {spent}.", style="bold green")]
    rows = ResultTable(
        (Column("failed check", words=True), Column("ours"), Column("expected")),
        [(check.name, check.ours, check.expected) for check in failed],
    )
    return [
        rows,
        "",
        Text(f"{len(failed)} of {len(checks)} checks failed; {spent}.", style="bold red"),
    ]


def _head(text: str) -> Text:
    return Text(text, style="bold underline")


def _sequence(each: SequenceValue) -> str:
    return f"({', '.join(str(uav) for uav in each.sequence)})"


def _average(average: Average) -> str:
    if average.half_width is None:
        return f"{average.mean:.4f}"
    return f"{average.mean:.4f} ± {average.half_width:.4f}"
