"""Completion: the shell is offered commands, options and values, whatever is there."""

from __future__ import annotations

import sys

import pytest

from swarm import cli
from swarm.runtime.errors import remedy_for_name


def offered(
    line: str, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> list[str]:
    words = line.split(" ")
    monkeypatch.setenv("_SWARM_COMPLETE", "complete_bash")
    monkeypatch.setenv("COMP_WORDS", line)
    monkeypatch.setenv("COMP_CWORD", str(len(words) - 1))
    assert cli.main([]) == 0
    return capsys.readouterr().out.split()


ONLINE = {"greedy", "lookahead", "nearest", "value-per-time", "guided"}


@pytest.mark.parametrize(
    ("line", "words"),
    [
        ("swarm re", {"reproduce", "resume", "return"}),
        ("swarm plan v", {"valley-popups", "valley-survey", "vineyard"}),
        ("swarm plan --meth", {"--method"}),
        ("swarm plan table-1 --method ", {*ONLINE, "exact"}),
        ("swarm simulate table-1 --method g", {"greedy", "guided"}),
        ("swarm coordinator table-1 --method ", ONLINE),
        ("swarm status --bus ", {"mesh", "router"}),
        ("swarm status --link ", {"clean", "normal", "bad"}),
        ("swarm run table-1 --bus ", {"auto", "mesh", "router"}),
        ("swarm run table-1 --autopilot sim", {"sim", "sim-px4"}),
        ("swarm task ", {"add", "withdraw"}),
        # Nobody listens there, and nobody is waited for.
        ("swarm hold --connect tcp/127.0.0.1:9 u", set()),
    ],
)
def test_what_can_follow_is_offered(
    line: str,
    words: set[str],
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    assert words <= (found := set(offered(line, monkeypatch, capsys)))
    assert words == found or line == "swarm re"


def test_only_the_command_that_is_typed_is_loaded(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.delitem(sys.modules, "sim.bench.cli", raising=False)

    offered("swarm plan --", monkeypatch, capsys)

    assert "sim.bench.cli" not in sys.modules


def test_the_script_of_any_shell_is_shown(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setenv("_SWARM_COMPLETE", "")
    for shell, line in (("bash", "complete -o default"), ("zsh", "#compdef swarm")):
        assert cli.main(["--show-completion", shell]) == 0
        assert line in capsys.readouterr().out


def test_the_nearest_name_is_meant_and_all_are_told() -> None:
    assert remedy_for_name("gready", ["greedy", "guided"]) == (
        "did you mean 'greedy'? Choose one of greedy, guided"
    )
    assert remedy_for_name("x", ["greedy", "guided"]) == "choose one of greedy, guided"


@pytest.mark.parametrize(
    ("arguments", "meant"),
    [
        ("plan table-1 --method gready", "did you mean 'greedy'?"),
        ("run table-1 --bus mseh", "did you mean 'mesh'?"),
        ("status --bus ruter", "did you mean 'router'?"),
        ("status --link nrmal", "did you mean 'normal'?"),
        ("autopilot table-1 --uav uvv1", "did you mean 'uav1'?"),
        ("simulate table-1 --faults cuts", "did you mean 'cut'?"),
        ("plan table-1 --methd greedy", "did you mean --method"),
        ("bench pln", "did you mean 'plan', 'replan'?"),
    ],
)
def test_a_mistyped_name_is_guessed(
    arguments: str, meant: str, capsys: pytest.CaptureFixture[str]
) -> None:
    assert cli.main(arguments.split()) == 2
    assert meant in capsys.readouterr().err
