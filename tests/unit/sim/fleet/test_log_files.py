"""Logs of a run: a file for each process, every line of it a JSON object."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from sim.fleet.shown_run import LogFiles
from swarm.runtime.errors import InputError


def test_every_process_has_its_file_and_every_line_is_an_object(tmp_path: Path) -> None:
    folder = tmp_path / "deep" / "logs"
    line = json.dumps({"event": "decided", "mission": "m"})
    for _ in range(2):
        with LogFiles(folder, print) as kept:
            kept.write("uav1", line)
            kept.write("autopilot of uav1, uav2", "Traceback (most recent call last):")

    assert {path.name for path in folder.iterdir()} == {
        "uav1.jsonl",
        "autopilot-of-uav1-uav2.jsonl",
    }
    assert (folder / "uav1.jsonl").read_text() == f"{line}\n{line}\n"
    foreign = (folder / "autopilot-of-uav1-uav2.jsonl").read_text().splitlines()
    assert json.loads(foreign[0])["event"] == "Traceback (most recent call last):"


def test_a_folder_that_cannot_be_is_refused_before_anything_starts(tmp_path: Path) -> None:
    (tmp_path / "logs").write_text("a file")

    with pytest.raises(InputError, match=r"--logs: .*nothing can be written there"):
        LogFiles(tmp_path / "logs", print)


def test_a_disk_that_fails_is_told_once_and_ends_nothing(tmp_path: Path) -> None:
    told = list[str]()
    with LogFiles(tmp_path / "logs", told.append) as kept:
        (tmp_path / "logs").rmdir()
        kept.write("uav1", "{}")
        kept.write("uav1", "{}")

    assert told == ["logs are kept no longer: No such file or directory"]
