from __future__ import annotations

import json
from dataclasses import replace
from importlib.metadata import EntryPoint
from pathlib import Path

import pytest

from sim.study.paper.cli import _tell
from sim.study.paper.reproduction import reproduce_paper
from sim.study.paper.tables import Expectations, Printed
from swarm.cli import main
from swarm.runtime.clock import SystemClock

COMMANDS = {
    "reproduce": EntryPoint("reproduce", "sim.study.paper.cli:reproduce", "peckorder.commands")
}


def reproduce(*arguments: str) -> int:
    return main(["reproduce", *arguments], COMMANDS)


def test_json_is_one_object_and_names_the_figures(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    folder = tmp_path / "new" / "figures"

    assert reproduce("--problems", "2", "--seed", "3", "--plots", str(folder), "--json") == 0

    out, err = capsys.readouterr()
    said = json.loads(out)
    assert out.count("\n") == 1
    assert err == ""
    assert said["ok"] is True
    assert (said["random"]["problems"], said["random"]["seed"]) == (2, 3)
    assert len(said["figures"]) == 6
    assert all(Path(path).is_file() for path in said["figures"])


def test_one_problem_is_enough(capsys: pytest.CaptureFixture[str]) -> None:
    assert reproduce("--problems", "1") == 0

    out = capsys.readouterr().out
    assert "1 random problem, seed 0" in out
    assert "checks hold" in out


def test_status_is_1_where_a_figure_deviates(capsys: pytest.CaptureFixture[str]) -> None:
    found = reproduce_paper(2, 0, clock=SystemClock(), theorem_cases=1)
    wrong = replace(found, expected=Expectations(optimum=Printed(120.4, 1)))

    assert _tell(found, [], json=True) == 0
    assert _tell(wrong, [], json=True) == 1
    assert _tell(wrong, [], json=False) == 1
    assert "1 of 24 checks failed" in capsys.readouterr().out


def test_a_folder_that_cannot_be_is_refused_before_any_work(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    file = tmp_path / "file"
    file.write_text("")

    assert reproduce("--plots", str(file)) == 2

    out, err = capsys.readouterr()
    assert out == ""
    assert err.count("\n") == 1
    assert "--plots" in err


def test_no_problems_are_refused(capsys: pytest.CaptureFixture[str]) -> None:
    assert reproduce("--problems", "0") == 2
    assert "--problems" in capsys.readouterr().err
