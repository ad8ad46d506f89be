from __future__ import annotations

from pathlib import Path
from xml.etree import ElementTree as ET

import matplotlib.image
import numpy as np
import pytest
from matplotlib.figure import Figure

from sim.study.paper.figures import draw_figures, hierarchical_figure, optimal_figure, random_figure
from sim.study.paper.reproduction import Reproduction, reproduce_paper
from swarm.runtime.clock import SystemClock


@pytest.fixture(scope="module")
def found() -> Reproduction:
    return reproduce_paper(3, 0, clock=SystemClock(), theorem_cases=1)


def legend(figure: Figure) -> str:
    return "\n".join(text.get_text() for text in figure.legends[0].get_texts())


@pytest.fixture(scope="module")
def drawn(found: Reproduction, tmp_path_factory: pytest.TempPathFactory) -> list[Path]:
    return draw_figures(found, tmp_path_factory.mktemp("figures"))


def test_each_figure_is_a_valid_png_and_svg(drawn: list[Path]) -> None:
    assert sorted(drawn) == sorted(drawn[0].parent.iterdir())
    assert [path.suffix for path in drawn] == [".png", ".svg"] * 3
    for path in drawn:
        if path.suffix == ".svg":
            assert ET.parse(path).getroot().tag.endswith("svg")
        else:
            height, width, _ = matplotlib.image.imread(path).shape
            assert min(height, width) >= 600


def test_same_results_give_the_same_files(
    found: Reproduction, drawn: list[Path], tmp_path: Path
) -> None:
    again = draw_figures(found, tmp_path)

    assert [path.name for path in again] == [path.name for path in drawn]
    assert [path.read_bytes() for path in again] == [path.read_bytes() for path in drawn]


def test_maps_show_the_lists_of_the_hierarchy_and_the_optimal_ones(found: Reproduction) -> None:
    hierarchical, optimal = hierarchical_figure(found.table), optimal_figure(found.table)

    assert "uav1: t2 t3\nuav2: t8 t7 t1\nuav3: t4 t6 t5" in legend(hierarchical)
    assert "uav1: t2 t3 t1\nuav2: t6 t8 t7\nuav3: t4 t5" in legend(optimal)
    assert hierarchical.axes[0].get_title("left") == "Fig. 2: hierarchical plan, greedy"
    assert optimal.axes[0].get_title("left") == "Fig. 3: optimal plan"
    assert optimal.axes[0].get_xlabel() == "east [m]"


def test_random_figure_has_every_problem_and_the_papers_averages(found: Reproduction) -> None:
    figure = random_figure(found.random, found.expected.paper)
    left, right = figure.axes

    assert [np.size(line.get_xdata()) for line in left.lines[:3]] == [3, 3, 3]
    assert "optimum = 1" in left.get_ylabel()
    assert left.get_xlabel()
    texts = [text.get_text() for text in right.texts]
    assert "0.88" in texts
    assert "0.85" in texts
    assert f"{found.random.average('greedy').mean:.3f}" in texts
    low, high = left.get_ylim()
    assert low < 0.85 < 1.0 < high
