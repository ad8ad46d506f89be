from __future__ import annotations

import json
from importlib.metadata import EntryPoint
from pathlib import Path

import pytest

from swarm.cli import main

COMMANDS = {"plan": EntryPoint("plan", "coordinator.cli:plan", "peckorder.commands")}

LATE = """
schema = 1
name = "late"
[mission]
horizon_s = 5.0
[[uav]]
id = "u"
position_m = [0.0, 0.0]
speed_m_s = 1.0
[[task]]
id = "near"
position_m = [1.0, 0.0]
value = 1.0
[[task]]
id = "far"
position_m = [50.0, 0.0]
value = 1.0
"""


def plan(*arguments: str) -> int:
    return main(["plan", *arguments], COMMANDS)


def test_json_is_one_object_with_the_fixed_keys(capsys: pytest.CaptureFixture[str]) -> None:
    assert plan("table-1", "--json", "--seed", "5") == 0

    out = capsys.readouterr().out
    found = json.loads(out)
    assert out.count("\n") == 1
    assert list(found) == [
        "scenario",
        "method",
        "objective",
        "sequence",
        "routes",
        "completion_s",
        "optimum",
        "gap",
        "evaluations",
        "elapsed_s",
        "seed",
        "bound",
        "basis",
    ]
    assert found["basis"] == "gap to the proven optimum"
    assert found["bound"] is None
    assert found["scenario"] == "table-1"
    assert found["method"] == "greedy"
    assert found["sequence"] == ["uav1", "uav3", "uav2"]
    assert found["routes"]["uav1"] == ["t2", "t3"]
    assert round(found["objective"], 4) == 118.4939
    assert round(found["completion_s"]["t2"], 4) == 0.9014
    assert round(found["optimum"], 4) == 120.3335
    assert round(found["gap"], 4) == 0.0153
    assert found["seed"] == 5


def test_exact_has_no_sequence_in_json(capsys: pytest.CaptureFixture[str]) -> None:
    assert plan("table-1", "--method", "exact", "--json") == 0

    found = json.loads(capsys.readouterr().out)
    assert found["sequence"] is None
    assert found["gap"] == 0.0
    assert found["routes"]["uav1"] == ["t2", "t3", "t1"]


def test_table_shows_lists_worth_and_quality(capsys: pytest.CaptureFixture[str]) -> None:
    assert plan("table-1", "--method", "lookahead") == 0

    out = capsys.readouterr().out
    assert "115.4152 value·s" in out
    assert "120.3335 value·s, proven, gap 4.09 %" in out
    assert "uav3, uav1, uav2" in out
    assert max(len(line) for line in out.splitlines()) <= 80


def test_late_tasks_are_flagged(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path = tmp_path / "late.toml"
    path.write_text(LATE)

    assert plan(str(path)) == 0

    out = capsys.readouterr().out
    assert "far@50.00!" in out
    assert "near@1.00 " in out
    assert "1 after D" in out


@pytest.mark.parametrize(
    ("arguments", "parts"),
    [
        (["--method", "best"], ["--method", "best", "no such method", "exact"]),
        (["--plot", "map.bmp"], ["--plot", "map.bmp", ".svg"]),
        (["--plot", "map"], ["--plot", "map", ".png"]),
        (["--seed", "-1"], ["--seed"]),
        (["--time-limit-s", "-1"], ["--time-limit-s"]),
        (["--time-limit-s", "nan"], ["--time-limit-s"]),
    ],
)
def test_wrong_option_is_one_line_and_status_2(
    arguments: list[str], parts: list[str], capsys: pytest.CaptureFixture[str]
) -> None:
    assert plan("table-1", *arguments) == 2

    captured = capsys.readouterr()
    assert captured.out == ""
    assert captured.err.count("\n") == 1
    for part in parts:
        assert part in captured.err


def test_mission_too_large_for_a_proof_is_one_line_and_status_2(
    capsys: pytest.CaptureFixture[str],
) -> None:
    assert plan("valley-survey", "--method", "exact") == 2

    captured = capsys.readouterr()
    assert captured.out == ""
    assert captured.err.count("\n") == 1
    assert "10 UAVs × 60 tasks" in captured.err
    assert "--method guided, greedy or lookahead" in captured.err


def test_time_limit_ends_the_search_of_a_large_fleet(capsys: pytest.CaptureFixture[str]) -> None:
    assert plan("valley-survey", "--time-limit-s", "0", "--json") == 0

    found = json.loads(capsys.readouterr().out)
    assert found["evaluations"] == 1
    assert found["optimum"] is found["gap"] is None
    assert len(found["completion_s"]) == 60


@pytest.mark.parametrize("suffix", [".png", ".svg", ".pdf"])
def test_plot_is_written_beside_the_json(
    suffix: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    path = tmp_path / f"lists{suffix}"

    assert plan("table-1", "--json", "--plot", str(path)) == 0

    captured = capsys.readouterr()
    assert json.loads(captured.out)["scenario"] == "table-1"
    assert str(path) in captured.err
    begin = {".png": b"\x89PNG", ".svg": b"<?xml", ".pdf": b"%PDF"}[suffix]
    assert path.read_bytes().startswith(begin)


def test_plot_that_cannot_be_written_is_one_line_and_status_2(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert plan("table-1", "--plot", str(tmp_path / "nowhere" / "lists.png")) == 2

    captured = capsys.readouterr()
    assert captured.out == ""
    assert captured.err.count("\n") == 1
    assert "nowhere" in captured.err


def test_large_mission_is_bounded_unless_told_otherwise(
    capsys: pytest.CaptureFixture[str],
) -> None:
    assert plan("valley-survey", "--method", "guided", "--json") == 0
    bounded = json.loads(capsys.readouterr().out)
    assert plan("valley-survey", "--no-bound", "--bound-s", "5") == 2
    (line,) = capsys.readouterr().err.splitlines()
    assert "--bound-s: 5: there is no bound with --no-bound; give one of the two" in line
    assert plan("valley-survey", "--method", "guided", "--no-bound", "--json") == 0
    unbounded = json.loads(capsys.readouterr().out)

    assert bounded["basis"] == "gap to an upper bound"
    assert bounded["objective"] < bounded["bound"] < 1.1 * bounded["objective"]
    assert unbounded["basis"] == "best known"
    assert unbounded["bound"] is None


def test_guided_finds_the_optimum_of_table_1(capsys: pytest.CaptureFixture[str]) -> None:
    assert plan("table-1", "--method", "guided", "--json") == 0
    found = json.loads(capsys.readouterr().out)

    assert found["objective"] == pytest.approx(120.3335, abs=5e-5)
    assert found["basis"] == "proven optimal"
