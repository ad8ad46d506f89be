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


@pytest.mark.parametrize(
    ("words", "complaint"),
    [
        ([], "swarm task add: no place was given; give either --position, or --lat-deg and"),
        (["--position", "1"], "--position: '1' is no place; give metres east, north and maybe up"),
        (["--position", "-1,x"], "--position: '-1,x' is no place"),
        (["--position", "1e9,0"], "--position: '1e9,0' is too far away; give metres within"),
        (["--lat-deg", "47"], "swarm task add: no place was given"),
        (["--position", "1,2", "--alt-m", "5"], "swarm task add: two places were given"),
        (["a b", "--position", "1,2"], "ID: 'a b' is no id; give 1 to 64 letters"),
        (["--position", "1,2", "--kind", "a b"], "--kind: 'a b' is no id"),
        (["--position", "1,2", "--value", "nan"], "swarm task add: invalid value for '--value'"),
        (["--position", "1,2", "--value", "-1"], "swarm task add: invalid value for '--value'"),
    ],
)
def test_a_task_that_cannot_be_is_refused_in_one_line(
    words: list[str], complaint: str, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["task", "add", *words]) == 2
    (line,) = capsys.readouterr().err.splitlines()
    assert line.startswith(complaint)


def test_what_is_withdrawn_must_be_named(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["task", "withdraw"]) == 2
    assert "'ID'" in capsys.readouterr().err


def test_each_command_about_tasks_shows_examples(capsys: pytest.CaptureFixture[str]) -> None:
    for name in ("add", "withdraw"):
        assert main(["task", name, "--help"]) == 0
        assert f"\n      swarm task {name} " in capsys.readouterr().out
