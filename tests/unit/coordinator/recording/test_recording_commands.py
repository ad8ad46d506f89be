"""`swarm simulate --record`, `swarm replay --final` and `swarm explain`, as a user types them."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from swarm.cli import main


@pytest.fixture(scope="module")
def file(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("flight") / "flight.mcap"
    assert main(["simulate", "table-1", "--loss", "0.3", "--seed", "3", "--record", str(path)]) == 0
    return path


def test_recording_changes_nothing_that_is_flown(
    file: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    words = ["simulate", "valley-popups", "--loss", "0.3", "--method", "guided", "--json"]
    told = []
    for more in ([], ["--record", str(tmp_path / "again.mcap")]):
        assert main([*words, *more]) == 0
        found = json.loads(capsys.readouterr().out)
        told.append({key: found[key] for key in found if key != "elapsed_s"})

    assert told[0] == told[1]


def test_the_final_picture_is_told_to_programs_and_people(
    file: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["replay", str(file), "--final", "--json"]) == 0
    found = json.loads(capsys.readouterr().out)
    assert main(["replay", str(file), "--final"]) == 0
    table = capsys.readouterr().out

    assert (found["mission"], found["phase"], found["tasks"]["done"]) == ("table-1", "ended", 8)
    assert table.startswith("table-1 · ENDED")


def test_stories_are_told_to_programs_and_people(
    file: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["explain", str(file), "--task", "t1", "--json"]) == 0
    found = json.loads(capsys.readouterr().out)
    assert main(["explain", str(file), "--uav", "uav1"]) == 0
    story = capsys.readouterr().out

    assert (found["task"], found["state"]) == ("t1", "done")
    assert found["events"][0]["kind"] == "posted"
    assert story.startswith("UAV uav1 of mission table-1")
    assert max(map(len, story.splitlines())) <= 80


@pytest.mark.parametrize(
    ("words", "problem"),
    [
        (["simulate", "table-1", "--record", "{file}"], "exists already"),
        (["simulate", "table-1", "--record", "flight.txt"], "end the name in .mcap"),
        (["simulate", "table-1", "--record", "none/flight.mcap"], "there is no folder none"),
        (["simulate", "table-1", "--faults", "all", "--record", "f.mcap"], "does not go with"),
        (["record", "{file}"], "exists already"),
        (["record", "new.mcap", "--mission", "a/b"], "is no id"),
        (["replay", "none.mcap", "--final"], "cannot be read"),
        (["explain", "{file}"], "neither is given"),
        (["explain", "{file}", "--task", "t1", "--uav", "uav1"], "both are given"),
        (["explain", "{file}", "--uav", "uav11"], "did you mean uav1"),
    ],
)
def test_what_cannot_be_done_is_told_in_one_line(
    words: list[str],
    problem: str,
    file: Path,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    monkeypatch.chdir(tmp_path)

    assert main([word.format(file=file) for word in words]) == 2

    told = capsys.readouterr().err
    assert problem in told
    assert len(told.splitlines()) == 1
    assert list(tmp_path.iterdir()) == []


def test_a_torn_recording_is_told_of_and_read_up_to_there(
    file: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    torn = tmp_path / "torn.mcap"
    torn.write_bytes(file.read_bytes()[:-3000])

    assert main(["replay", str(torn), "--final", "--json"]) == 0

    told = capsys.readouterr()
    assert json.loads(told.out)["mission"] == "table-1"
    assert told.err.startswith(f"swarm: {torn}: torn after ")
    assert len(told.err.splitlines()) == 1
