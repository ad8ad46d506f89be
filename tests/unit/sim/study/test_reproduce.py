from __future__ import annotations

import json
from dataclasses import replace
from io import StringIO

import pytest
from rich.console import Console

from sim.study.paper.random_problems import STUDIED
from sim.study.paper.report import reproduction_text
from sim.study.paper.reproduction import Reproduction, reproduce_paper
from sim.study.paper.tables import Expectations, PaperFigures, Printed
from swarm.runtime.clock import SystemClock

PROBLEMS = 6


@pytest.fixture(scope="module")
def found() -> Reproduction:
    return reproduce_paper(PROBLEMS, 0, clock=SystemClock(), threads=2, theorem_cases=30)


def shown(found: Reproduction) -> str:
    text = StringIO()
    Console(width=80, file=text).print(reproduction_text(found))
    return text.getvalue()


def failed(found: Reproduction, expected: Expectations) -> list[str]:
    judged = replace(found, expected=expected)
    assert judged.ok == (not [check for check in judged.checks if not check.ok])
    return [check.name for check in judged.checks if not check.ok]


def test_all_checked_figures_come_out(found: Reproduction) -> None:
    assert found.ok
    assert failed(found, Expectations()) == []
    assert len(found.checks) == 24


@pytest.mark.parametrize(
    ("wrong", "name"),
    [
        (Expectations(optimum=Printed(120.3336, 4)), "Table II optimum"),
        (Expectations(worst=Printed(-141.8788, 4)), "Table II worst plan"),
        (Expectations(guided=Printed(120.3334, 4)), "guided"),
        (Expectations(optimal_lists=((2, 3), (6, 8, 7), (4, 5, 1))), "Table II optimal lists"),
        (Expectations(optimum_at_horizon={6.0: Printed(155.54, 2)}), "optimum at D = 6 s"),
        (Expectations(normalised_at_least={"guided": 1.1}), "random problems, guided"),
        (
            Expectations(paper=PaperFigures(optimum=Printed(120.4, 1))),
            "Table II optimum (paper)",
        ),
    ],
)
def test_a_wrong_expectation_fails_its_check_alone(
    found: Reproduction, wrong: Expectations, name: str
) -> None:
    assert failed(found, wrong) == [name]


def test_a_failed_check_is_told(found: Reproduction) -> None:
    text = shown(replace(found, expected=Expectations(optimum=Printed(121.0, 1))))

    assert "1 of 24 checks failed" in text
    line = next(line for line in text.splitlines() if line.startswith("Table II optimum "))
    assert line.split()[-2:] == ["120.3", "121.0"]


def test_figures_are_held_to_their_printed_digits() -> None:
    assert Printed(120.3, 1).agrees(120.3335)
    assert not Printed(120.3, 1).agrees(120.36)
    assert not Printed(120.3335, 4).agrees(120.3336)
    assert str(Printed(0.88, 2)) == "0.88"


def test_text_shows_ours_beside_the_papers(found: Reproduction) -> None:
    text = shown(found)

    assert max(len(line.rstrip()) for line in text.splitlines()) <= 80
    for line in (
        ["optimum,", "proven", "120.3335", "120.3", "(2", "3", "1)(6", "8", "7)(4", "5)"],
        ["(1,", "3,", "2)", "118.4939"],
        ["the", "paper", "reports", "0.88", "0.85"],
        ["Theorem", "5", "0", "30"],
    ):
        assert any(shown_line.split()[: len(line)] == line for shown_line in text.splitlines())
    words = " ".join(text.split())
    assert "J [value·s]" in words
    assert "110.7 for its hierarchical plan comes from neither rule as written" in words
    assert "nearest is lookahead in (2, 1, 3) with 111.8" in words
    assert f"{PROBLEMS} random problems, seed 0" in words
    assert "All 24 checks hold" in words


def test_a_hierarchical_figure_that_a_sequence_gives_is_explained_by_it(
    found: Reproduction,
) -> None:
    paper = PaperFigures(hierarchical=Printed(118.5, 1))
    words = " ".join(shown(replace(found, expected=Expectations(paper=paper))).split())

    assert "comes from greedy in sequence (1, 3, 2); greedy in sequence (3, 1, 2)." in words


def test_json_is_finite_and_has_every_part(found: Reproduction) -> None:
    said = json.loads(json.dumps(found.as_json(), allow_nan=False))

    assert list(said) == [
        "ok",
        "checks",
        "paper",
        "table",
        "random",
        "times",
        "theorems",
        "machine",
        "elapsed_s",
    ]
    assert said["ok"] is True
    assert said["paper"]["normalised"] == {"greedy": 0.88, "lookahead": 0.85}
    assert {tuple(check) for check in said["checks"]} == {("name", "ours", "expected", "ok")}
    assert round(said["table"]["plans"]["guided"]["objective"], 4) == 120.3335
    assert said["table"]["plans"]["greedy"]["sequence"] == ["uav1", "uav3", "uav2"]
    assert said["table"]["plans"]["exact"]["sequence"] is None
    assert len(said["table"]["sequences"]) == 12
    assert said["random"]["problems"] == PROBLEMS
    assert {len(values) for values in said["random"]["values"].values()} == {PROBLEMS}
    assert list(said["random"]["normalised"]) == list(STUDIED)
    assert list(said["random"]["normalised"]["greedy"]) == ["mean", "low_95", "high_95"]
    assert len(said["random"]["readings"]) == 6
    assert said["times"]["of_greedy"]["greedy"] == 1.0
    assert all(seconds > 0.0 for seconds in said["times"]["median_s"].values())
    assert [theorem["violations"] for theorem in said["theorems"]] == [0, 0, 0]
    assert said["machine"]["processors"] >= 1
