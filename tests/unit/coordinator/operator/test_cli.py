"""The operator's commands, as far as they come without a bus."""

from __future__ import annotations

import io

import pytest

from swarm.cli import main


@pytest.mark.parametrize("command", ["hold", "resume", "return"])
def test_a_uav_must_be_named(command: str, capsys: pytest.CaptureFixture[str]) -> None:
    assert main([command]) == 2
    assert "'UAV'" in capsys.readouterr().err


def test_what_is_no_id_is_refused_in_one_line_each(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["hold", "a b", "--mission", "c/d"]) == 2

    lines = capsys.readouterr().err.splitlines()
    assert [line.split(":")[0] for line in lines] == ["--mission", "UAV"]


def test_a_reason_has_to_fit_into_a_status(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["abort", "--yes", "--reason", "x" * 151]) == 2
    assert capsys.readouterr().err == "--reason: it has 151 characters; give at most 150\n"


class Terminal(io.StringIO):
    """A standard input at which somebody sits."""

    def isatty(self) -> bool:
        return True


def test_an_abort_asks_on_a_terminal(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr("sys.stdin", Terminal("n\n"))

    assert main(["abort"]) == 1
    told = capsys.readouterr()
    assert "Bring every UAV home and end the mission?" in told.out + told.err
    assert told.err.endswith("swarm: nothing was aborted\n")
