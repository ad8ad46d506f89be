"""`swarm soak` and `swarm simulate --faults`: what they print, write and play again."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from swarm.cli import main
from swarm.runtime.clock import SystemClock

CUT = "1 cut uav1 for 0.5\n0.5 weather by 0.2 for 1  # rain\n"


def test_a_soak_without_a_breach_says_so(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["soak", "--seeds", "3", "--jobs", "1"]) == 0

    assert capsys.readouterr().out.startswith("3 cases, no invariant broken")


def test_two_workers_play_as_many_as_one(capsys: pytest.CaptureFixture[str]) -> None:
    clock = SystemClock()
    began_s = clock.now_s()
    assert main(["soak", "--seeds", "22", "--jobs", "2", "--faults", "blink", "--json"]) == 0

    told = json.loads(capsys.readouterr().out)
    assert 0.0 < told["elapsed_s"] <= clock.now_s() - began_s
    assert (told["seeds"], told["broken"]) == (22, None)


def test_a_breach_is_shrunk_printed_written_and_played_again(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    out = tmp_path / "found.case"
    told = ["--seeds", "20", "--jobs", "1", "--bug", "proposed-beats-held", "--out", str(out)]

    assert main(["soak", *told]) == 1
    printed = capsys.readouterr().out
    assert printed.startswith("fleet seed=")
    assert "bug=proposed-beats-held" in printed
    assert f"swarm soak --replay {out}" in printed

    assert main(["soak", "--replay", str(out)]) == 1
    assert "left its task" in capsys.readouterr().out
    healthy = out.read_text().replace(" bug=proposed-beats-held", "")
    out.write_text(healthy)
    assert main(["soak", "--replay", str(out), "--json"]) == 0
    assert json.loads(capsys.readouterr().out)["broken"] is None


@pytest.mark.parametrize(
    ("arguments", "complaint"),
    [
        (["--faults", "quake"], "no kind of fault"),
        (["--replay", "nowhere.case"], "nowhere.case: cannot be read"),
        (["--bug", "none"], "is none of"),
    ],
)
def test_wrong_usage_is_one_line(
    arguments: list[str], complaint: str, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["soak", "--jobs", "1", *arguments]) == 2

    told = capsys.readouterr().err
    assert complaint in told
    assert len(told.splitlines()) == 1


def test_a_scenario_is_flown_with_the_faults_of_a_file(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    faults = tmp_path / "faults.txt"
    faults.write_text(CUT)

    assert main(["simulate", "table-1", "--faults", str(faults), "--json"]) == 0
    told = capsys.readouterr()
    assert told.err == "0.5 weather by 0.2 for 1\n1 cut uav1 for 0.5\n"
    assert json.loads(told.out)["open"] == []


def test_the_same_seed_plays_the_same_faults(capsys: pytest.CaptureFixture[str]) -> None:
    def told(seed: str) -> tuple[str, str]:
        main(["simulate", "table-1", "--faults", "all", "--seed", seed, "--loss", "0.5", "--json"])
        printed = capsys.readouterr()
        report = json.loads(printed.out)
        return printed.err, json.dumps({k: v for k, v in report.items() if k != "elapsed_s"})

    assert told("4") == told("4")
    assert told("4") != told("5")


def test_a_delay_does_not_go_with_faults(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["simulate", "table-1", "--faults", "cut", "--latency-s", "0.1"]) == 2
    assert "goes with --loss, --popup and --popup-rate only" in capsys.readouterr().err
