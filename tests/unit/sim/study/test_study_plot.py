from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from xml.etree import ElementTree as ET

import matplotlib.image
import pytest
from matplotlib.figure import Figure

from sim.study.plots import (
    churn_bars_figure,
    churn_figure,
    comparison_figure,
    draw_study,
    time_figure,
    value_figure,
)
from sim.study.style import style_of
from sim.study.summary import PointSummary, StudyDescription, StudySummary, summarise
from tests.support.study_rows import study_rows

POLICIES = ("central", "greedy", "guided")


@pytest.fixture(scope="module")
def summary() -> StudySummary:
    rows = study_rows(POLICIES, {"loss": (0.0, 0.4)}, trials=3)
    return summarise(
        rows, "central", StudyDescription(ideal=frozenset({"central"}), machine="a machine")
    )


@pytest.fixture(scope="module")
def own(summary: StudySummary) -> PointSummary:
    return summary.settings[0]


def row_names(figure: Figure) -> list[str]:
    return [label.get_text() for label in figure.axes[0].get_yticklabels()]


@pytest.fixture(scope="module")
def drawn(summary: StudySummary, tmp_path_factory: pytest.TempPathFactory) -> list[Path]:
    return draw_study(summary, tmp_path_factory.mktemp("figures"))


def test_every_figure_is_a_valid_png_and_svg(drawn: list[Path]) -> None:
    assert sorted(drawn) == sorted(drawn[0].parent.iterdir())
    assert [path.stem for path in drawn[::2]] == [
        "policies",
        "duplicates-and-churn",
        "decision-times",
        "value-against-loss",
        "duplicates-and-churn-against-loss",
    ]
    for path in drawn:
        if path.suffix == ".svg":
            assert ET.parse(path).getroot().tag.endswith("svg")
        else:
            height, width, _ = matplotlib.image.imread(path).shape
            assert height >= 300
            assert width >= 1000


def test_same_rows_give_the_same_files(
    drawn: list[Path], summary: StudySummary, own: PointSummary, tmp_path: Path
) -> None:
    again = draw_study(replace(summary, settings=(own,)), tmp_path)

    assert len(again) == 6
    for one, other in zip(drawn, again, strict=False):
        assert one.name == other.name
        assert one.read_bytes() == other.read_bytes()


def test_all_policies_are_listed_best_first_with_their_figures(
    summary: StudySummary, own: PointSummary
) -> None:
    figure = comparison_figure(summary, own)

    assert row_names(figure) == ["guided", "central †", "greedy", "clairvoyant (bound)"]
    assert len(figure.axes[0].texts) == 4
    assert "1 (reference)" in [text.get_text() for text in figure.axes[0].texts]
    assert figure.get_supxlabel() == "† modelled with ideal communication only"


def test_value_is_drawn_against_what_is_varied(summary: StudySummary) -> None:
    figure = value_figure(summary, "loss")
    left, right = figure.axes

    assert left.get_xlabel() == right.get_xlabel() == "UAVs lost [%]"
    assert [text.get_text() for text in left.get_xticklabels()] == ["0", "40"]
    lines = {str(line.get_label()): line for line in left.lines}
    assert list(lines) == ["guided", "central", "greedy", "clairvoyant (bound)"]
    assert lines["central"].get_linestyle() == "--"
    assert lines["greedy"].get_linestyle() == "-"
    assert figure.get_supxlabel() == "dashed: modelled with ideal communication only"
    low, high = right.get_ylim()
    assert 0.7 < low < 0.81
    assert 1.09 < high < 1.2


def test_what_lies_far_from_the_reference_is_told_instead_of_drawn() -> None:
    rows = study_rows((*POLICIES, "poor"), {"loss": (0.1,)}, trials=3)
    rows = [replace(row, value=0.2 * row.value) if row.policy == "poor" else row for row in rows]
    figure = value_figure(summarise(rows, "central"), "loss")

    assert figure.axes[1].get_ylim()[0] > 0.7
    assert figure.get_supxlabel() == "below the right panel too: poor"


def test_duplicates_and_churn_are_bars_or_lines(summary: StudySummary, own: PointSummary) -> None:
    bars, lines = churn_bars_figure(summary, own), churn_figure(summary, "loss")

    assert row_names(bars) == ["guided", "central †", "greedy"]
    assert [len(axes.patches) for axes in bars.axes] == [3, 3]
    assert [len(axes.lines) for axes in lines.axes] == [3, 3]
    assert "tasks done twice" in lines.axes[0].get_ylabel()


def test_decision_times_are_sorted_and_say_where_they_were_taken(
    summary: StudySummary, own: PointSummary
) -> None:
    figure = time_figure(summary, own)

    assert figure is not None
    assert sorted(row_names(figure)) == ["central †", "greedy", "guided"]
    assert figure.axes[0].get_xscale() == "log"
    assert figure.axes[0].get_xlabel().endswith("[ms]")
    assert figure.get_supxlabel().endswith("a machine")


def test_bound_alone_is_drawn_without_times_or_counts() -> None:
    summary = summarise(study_rows((), {"loss": (0.1,)}, trials=2), "central")
    own = summary.settings[0]

    assert time_figure(summary, own) is None
    assert row_names(comparison_figure(summary, own)) == ["clairvoyant (bound)"]
    assert row_names(churn_bars_figure(summary, own)) == []
    assert [len(axes.lines) for axes in churn_figure(summary, "loss").axes] == [0, 0]
    assert len(value_figure(summary, "loss").axes[0].lines) == 1


def test_policies_of_ones_own_get_looks_of_their_own() -> None:
    mine = (*"abcd", "interval:30", "interval:60")
    looks = [style_of(name, (*POLICIES, *mine)) for name in (*POLICIES, *mine)]

    assert len(set(looks)) == len(looks)


def test_number_of_a_policy_leaves_its_look() -> None:
    assert style_of("interval:60", ("central", "interval:60")) == style_of(
        "interval", ("interval",)
    )
