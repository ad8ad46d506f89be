from __future__ import annotations

import json
from importlib.metadata import EntryPoint
from pathlib import Path

import pytest

from sim.study.baselines import ortools_routing
from swarm.cli import main

COMMANDS = {"bench": EntryPoint("bench", "sim.bench.cli:bench", "peckorder.commands")}


def swarm(*arguments: str) -> int:
    return main(["bench", *arguments], commands=COMMANDS)


def test_plan_compares_and_writes(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    plot, out = tmp_path / "value.png", tmp_path / "table.md"
    status = swarm(
        "plan", "--sizes", "2x5,2×6", "--time-limit-s", "0.05", "--seeds", "3",
        "--methods", "guided,nearest", "--plot", str(plot), "--out", str(out),
    )  # fmt: skip
    assert status == 0
    said = capsys.readouterr()
    assert "2×5, 0.05 s" in said.out
    assert "2×6, 0.05 s" in said.out
    assert said.err == ""
    assert plot.stat().st_size > 1000
    assert "**2×6, 0.05 s**" in out.read_text(encoding="utf-8")


def test_plan_takes_a_scenario_and_speaks_json(capsys: pytest.CaptureFixture[str]) -> None:
    arguments = ("--methods", "exact,greedy", "--time-limit-s", "60", "--seeds", "0", "--json")
    assert swarm("plan", "table-1", *arguments) == 0
    said = json.loads(capsys.readouterr().out)
    worths = {row["method"]: row["objective"] for row in said["measured"]}
    assert worths["exact"] == pytest.approx(120.3335, abs=1e-4)
    assert worths["greedy"] == pytest.approx(118.4939, abs=1e-4)
    assert {row["case"] for row in said["measured"]} == {"table-1"}


def test_scaling_has_its_own_table_and_plot(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    plot = tmp_path / "scaling.svg"
    assert swarm(
        "plan", "--scaling", "--sizes", "2x5", "--time-limit-s", "0.05", "--plot", str(plot)
    ) == 0  # fmt: skip
    text = capsys.readouterr().out
    assert "Time and memory by size" in text
    assert "Seeds 0;" in text
    assert plot.stat().st_size > 1000


def test_decide_times_decisions(capsys: pytest.CaptureFixture[str]) -> None:
    assert swarm("decide", "--size", "3x9", "--json") == 0
    assert json.loads(capsys.readouterr().out)["n_uav"] == 3
    assert swarm("decide", "--size", "3x9") == 0
    assert "One online decision at 3 × 9" in capsys.readouterr().out


def test_replan_tells_programs_people_and_a_file(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    out = tmp_path / "replans.txt"
    arguments = ("replan", "--sizes", "3x8", "--seeds", "1", "--long-run-s", "0.1")

    assert swarm(*arguments, "--json") == 0
    told = json.loads(capsys.readouterr().out)
    assert [(row["moment"], row["seed"]) for row in told["times"]] == [("start", 1), ("midway", 1)]
    assert swarm(*arguments, "--out", str(out)) == 0
    assert "midway" in capsys.readouterr().out
    assert "3×8" in out.read_text(encoding="utf-8")


def test_missions_flies_them_in_one_process_or_several_alike(
    capsys: pytest.CaptureFixture[str],
) -> None:
    said = []
    for jobs in ("1", "2"):
        arguments = ("--missions", "11", "--size", "2x4", "--loss", "0.5", "--jobs", jobs)
        assert swarm("missions", *arguments, "--json") == 0
        said.append(json.loads(capsys.readouterr().out))
    counts = [(told["missions"], told["done"], told["lost"], told["popup"]) for told in said]
    assert counts[0] == counts[1]
    assert counts[0][1] > 0
    assert counts[0][2] > 0
    assert min(told[name] for told in said for name in ("plan_cpu_s", "fly_cpu_s", "wall_s")) > 0.0


def test_missions_tells_people_what_was_flown(capsys: pytest.CaptureFixture[str]) -> None:
    assert swarm("missions", "--missions", "2", "--size", "2x3", "--seed", "5", "--jobs", "1") == 0
    said = capsys.readouterr()
    assert "2 random missions of 2 × 3, seeds 5..6, by the greedy rule, 1 process:" in said.out
    assert "CPU per mission" in said.out
    assert said.err == ""


def test_one_flight_is_told_in_words(capsys: pytest.CaptureFixture[str]) -> None:
    asked = ("flight", "--size", "3x12", "--seed", "4", "--loss", "0", "--no-coordinator")

    assert swarm(*asked) == 0

    told = " ".join(capsys.readouterr().out.split())
    assert "3 UAVs × 12 tasks, seed 4, loss 0, pop-ups 0.3; its coordinator is dead." in told
    assert "12 done, 0 missed" in told
    assert "an agent decides" in told


@pytest.mark.parametrize(
    ("arguments", "line"),
    [
        (("plan", "--sizes", "10"), "--sizes: 10: no size; write UAVs x tasks, such as 50x500"),
        (("plan", "--sizes", "0x5"), "--sizes: 0x5: no size"),
        (("plan", "--seeds", "one"), "--seeds: one: no seed"),
        (("plan", "--seeds", "-1"), "--seeds: -1: no seed"),
        (("plan", "--time-limit-s", "soon"), "--time-limit-s: soon: no time limit"),
        (("plan", "--time-limit-s", "nan"), "--time-limit-s: nan: no time limit"),
        (("plan", "--methods", "magic"), "--methods: magic: no such method; choose among guided"),
        (("plan", "--field", "--methods", "exact"), "--methods: exact: no such method; choose"),
        (("plan", "--field", "--scaling"), "--field: it draws random missions, and compares"),
        (("plan", "--field", "table-1"), "--field: it draws random missions, and compares"),
        (("plan", "--plot", "value.txt"), "--plot: value.txt: no picture has this suffix"),
        (("plan", "--out", "/no/such/x.md"), "--out: /no/such/x.md: its folder is not there"),
        (("plan", "no-such-scenario"), "no-such-scenario"),
        (("decide", "--size", "ten"), "--size: ten: no size"),
        (("missions", "--size", "ten"), "--size: ten: no size"),
        (("flight", "--size", "ten"), "--size: ten: no size"),
        ((), "swarm bench: missing command"),
    ],
)
def test_wrong_usage_is_one_line_before_anything_runs(
    arguments: tuple[str, ...], line: str, capsys: pytest.CaptureFixture[str]
) -> None:
    assert swarm(*arguments) == 2
    said = capsys.readouterr()
    assert line in said.err
    assert said.err.count("\n") == 1


def test_missing_ortools_is_told_when_it_was_asked_for(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(ortools_routing, "is_installed", lambda: False)
    assert swarm("plan", "--methods", "ortools", "--sizes", "2x5") == 2
    assert "--methods ortools needs the extra bench: pip install" in capsys.readouterr().err


def test_files_that_cannot_be_written_are_told(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    folder = tmp_path / "taken.md"
    folder.mkdir()
    arguments = ("--sizes", "2x5", "--methods", "nearest", "--seeds", "0")
    assert swarm("plan", *arguments, "--out", str(folder)) == 2
    assert f"--out: cannot write {folder}" in capsys.readouterr().err


def test_help_shows_examples_line_by_line(capsys: pytest.CaptureFixture[str]) -> None:
    assert swarm("plan", "--help") == 0
    text = capsys.readouterr().out
    assert "\n      swarm bench plan --scaling --out scaling.md\n" in text
    assert "_PLAN_HELP" not in text
