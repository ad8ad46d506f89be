"""The root of the command line: finding commands, exit statuses, one line per mistake."""

from __future__ import annotations

import os
import subprocess
import sys
from collections.abc import Mapping
from importlib.metadata import EntryPoint
from pathlib import Path
from typing import IO, Annotated

import pytest
import typer

import swarm
from swarm.cli import COMMAND_GROUP, main
from swarm.runtime.errors import BusError, Fault, InputError
from swarm.runtime.options import (
    JsonOption,
    LifelineOption,
    ScenarioArgument,
    SeedOption,
    TimeLimitOption,
)

SCENARIO = str(Path(__file__).parents[2] / "data" / "scenarios" / "small.toml")


def plan(
    scenario: ScenarioArgument,
    seed: SeedOption = 0,
    as_json: JsonOption = False,
    time_limit_s: TimeLimitOption = None,
    lifeline: LifelineOption = False,
) -> int | None:
    """Plan a mission [eq. 1] and print it.

    More about it.

    Returns:
        Nothing that the reader of help need know.

    Examples:
        swarm plan table-1
        swarm plan table-1 --json   # one object
    """
    print(scenario.name, seed, as_json, time_limit_s, lifeline)
    return None


def end(how: Annotated[str, typer.Option("--how", help="In what way.")] = "done") -> int | None:
    """End in some way."""
    match how:
        case "one":
            return 1
        case "exit":
            raise typer.Exit(1)
        case "input":
            raise InputError(
                Fault("s.toml", "uav[0]", "is bad", "be good"), Fault("s.toml", "", "a", "b")
            )
        case "bus":
            raise BusError("no router at tcp/127.0.0.1:7447")
        case "interrupt":
            raise KeyboardInterrupt
        case "bug":
            raise ZeroDivisionError("a bug")
        case "pipe":
            raise BrokenPipeError
        case "text":
            return "done"  # type: ignore[return-value]  # what a careless command may do
    return 0


family = typer.Typer(help="Talk about tasks.", no_args_is_help=True)


@family.command()
def add(name: str) -> int:
    """Add a task."""
    print(f"added {name}")
    return 0


@family.command()
def withdraw(name: str) -> int:
    """Withdraw a task."""
    print(f"withdrawn {name}")
    return 1


nothing = 5


def command(name: str, place: str) -> EntryPoint:
    return EntryPoint(name, f"{__name__}:{place}", COMMAND_GROUP)


COMMANDS: Mapping[str, EntryPoint] = {
    "end": command("end", "end"),
    "gone": EntryPoint("gone", "swarm.no_such_module:gone", COMMAND_GROUP),
    "plan": command("plan", "plan"),
    "task": command("task", "family"),
}


def test_result_of_a_command_is_its_exit_status(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["plan", SCENARIO, "--seed", "7", "--json"], COMMANDS) == 0
    assert capsys.readouterr() == ("small.toml 7 True None False\n", "")


@pytest.mark.parametrize(
    ("how", "status", "complaint"),
    [
        ("done", 0, ""),
        ("one", 1, ""),
        ("exit", 1, ""),
        ("input", 2, "s.toml: uav[0]: is bad; be good\ns.toml: a; b\n"),
        ("bus", 1, "swarm: no router at tcp/127.0.0.1:7447\n"),
        ("interrupt", 130, ""),
        ("pipe", 1, ""),
    ],
)
def test_every_way_to_end_has_its_status_and_line(
    how: str, status: int, complaint: str, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["end", "--how", how], COMMANDS) == status
    assert capsys.readouterr() == ("", complaint)


def test_unexpected_exception_is_left_to_the_interpreter() -> None:
    with pytest.raises(ZeroDivisionError, match="a bug"):
        main(["end", "--how", "bug"], COMMANDS)


def test_command_that_returns_no_status_is_a_bug() -> None:
    with pytest.raises(TypeError, match="command end must return an exit status or None"):
        main(["end", "--how", "text"], COMMANDS)


@pytest.mark.parametrize(
    ("argv", "line"),
    [
        (["plam"], "swarm: no such command 'plam'; did you mean 'plan'?"),
        (["zzz"], "swarm: no such command 'zzz'; the commands are end, gone, plan, task"),
        (["--vers"], "swarm: no such option: --vers; did you mean --version? SEE"),
        (["--verbose", "plan"], "swarm: no such option: --verbose; did you mean --version? SEE"),
        (["plan"], "swarm plan: missing argument 'SCENARIO'; SEE"),
        (["plan", SCENARIO, "--sed", "1"], ("swarm plan: no such option: --sed; did you mean "
         "--seed? SEE")),
        (["plan", SCENARIO, "--seed"], "swarm plan: option '--seed' requires an argument; SEE"),
        (["plan", SCENARIO, "more"], "swarm plan: got unexpected extra argument(s) (more); SEE"),
        (["plan", SCENARIO, "--seed", "x"], ("swarm plan: invalid value for '--seed': Input should "
         "be a valid integer, unable to parse string as an integer; SEE")),
        (["plan", SCENARIO, "--seed", "-1"], ("swarm plan: invalid value for '--seed': Input "
         "should be greater than or equal to 0; SEE")),
        (["plan", SCENARIO, "--time-limit-s", "nan"], ("swarm plan: invalid value for "
         "'--time-limit-s': Input should be greater than or equal to 0; SEE")),
        (["plan", "no/such.toml"], ("no/such.toml: no such scenario file; give a file or a "
         "shipped scenario: airstrip, hayfield, meadow, orchard, reservoir-inspection, ridge, "
         "roundup, table-1, valley-popups, valley-survey, vineyard")),
        (["plan", "table1"], ("table1: no such scenario file; did you mean 'table-1'? Shipped "
         "scenarios: airstrip, hayfield, meadow, orchard, reservoir-inspection, ridge, roundup, "
         "table-1, valley-popups, valley-survey, vineyard")),
        (["task"], "swarm task: missing command; SEE"),
        (["task", "ad"], "swarm task: no such command 'ad'; did you mean 'add'? SEE"),
        (["task", "add"], "swarm task add: missing argument 'name'; SEE"),
    ],
)  # fmt: skip
def test_wrong_usage_takes_one_line_and_status_2(
    argv: list[str], line: str, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(argv, COMMANDS) == 2
    path = line.partition(":")[0]
    assert capsys.readouterr() == (
        "",
        line.replace("? SEE", f"? See '{path} --help'").replace("SEE", f"see '{path} --help'")
        + "\n",
    )


def test_members_of_a_family_are_commands(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["task", "add", "t9"], COMMANDS) == 0
    assert main(["task", "withdraw", "t9"], COMMANDS) == 1
    assert capsys.readouterr().out == "added t9\nwithdrawn t9\n"


def test_shipped_name_becomes_its_file(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["plan", "table-1"], COMMANDS) == 0
    assert capsys.readouterr().out == "table-1.toml 0 False None False\n"


def test_version(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["--version"], COMMANDS) == 0
    assert capsys.readouterr() == (f"swarm {swarm.__version__}\n", "")


@pytest.mark.parametrize("option", ["--help", "-h"])
def test_help_lists_every_command_even_one_that_cannot_be_loaded(
    option: str, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main([option], COMMANDS) == 0
    lines = [line.strip() for line in capsys.readouterr().out.splitlines()]
    assert "end   End in some way." in lines
    assert "gone  Cannot be loaded: No module named 'swarm.no_such_module'." in lines
    assert "plan  Plan a mission [eq. 1] and print it." in lines
    assert "task  Talk about tasks." in lines


def test_no_command_shows_the_help_and_is_wrong_usage(capsys: pytest.CaptureFixture[str]) -> None:
    assert main([], COMMANDS) == 2
    captured = capsys.readouterr()
    assert captured.out.startswith("Usage: swarm [OPTIONS] COMMAND [ARGS]...")
    assert captured.err == "swarm: no command given; choose one of the above\n"


def test_help_of_a_command_shows_its_examples_line_by_line(
    capsys: pytest.CaptureFixture[str],
) -> None:
    assert main(["plan", "--help"], COMMANDS) == 0
    shown = capsys.readouterr().out
    assert "  Plan a mission [eq. 1] and print it.\n\n  More about it.\n" in shown
    assert (
        "  Examples:\n      swarm plan table-1\n      swarm plan table-1 --json   # one object\n"
    ) in shown
    assert "that the reader of help need know" not in shown
    assert "--lifeline" not in shown


def test_only_the_command_asked_for_is_imported(capsys: pytest.CaptureFixture[str]) -> None:
    # Loading "gone" would fail.
    assert main(["end"], COMMANDS) == 0
    with pytest.raises(ModuleNotFoundError):
        main(["gone"], COMMANDS)


def test_scenario_completes_to_shipped_names_and_files(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    (tmp_path / "table-of-mine.toml").touch()
    (tmp_path / "table.txt").touch()
    (tmp_path / "tables").mkdir()
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("_SWARM_COMPLETE", "complete_bash")
    monkeypatch.setenv("COMP_WORDS", "swarm plan tab")
    monkeypatch.setenv("COMP_CWORD", "2")

    assert main([], {"plan": COMMANDS["plan"]}) == 0
    assert capsys.readouterr().out.split() == ["table-1", "table-of-mine.toml", "tables/"]


def swarm_process(*argv: str, stdout: IO[str] | int = subprocess.PIPE) -> subprocess.Popen[str]:
    start = "import sys; from swarm.cli import console_main; sys.exit(console_main())"
    return subprocess.Popen(
        [sys.executable, "-c", start, *argv], stdout=stdout, stderr=subprocess.PIPE, text=True
    )


@pytest.mark.process
def test_installed_command_starts_and_answers() -> None:
    process = swarm_process("--version")

    assert process.communicate(timeout=30) == (f"swarm {swarm.__version__}\n", "")
    assert process.returncode == 0


@pytest.mark.process
def test_reader_that_leaves_early_is_no_traceback() -> None:
    process = swarm_process("--help")
    assert process.stdout is not None
    assert process.stderr is not None
    process.stdout.close()

    assert process.stderr.read() == ""
    process.stderr.close()
    assert process.wait(timeout=30) == 1


@pytest.mark.process
def test_full_disk_takes_one_line() -> None:
    with Path("/dev/full").open("w") as full:
        process = swarm_process("--version", stdout=full)

    assert process.communicate(timeout=30)[1] == (
        "swarm: output cannot be written: No space left on device\n"
    )
    assert process.returncode == 1


@pytest.mark.process
def test_starting_a_command_loads_nothing_heavy() -> None:
    code = (
        "import sys; from swarm.cli import main; main(['--version']);"
        "print(*sorted({m.partition('.')[0] for m in sys.modules} & set(sys.argv[1:])))"
    )
    heavy = ["matplotlib", "numpy", "pydantic", "rich", "scipy", "structlog", "zenoh"]
    done = subprocess.run(
        [sys.executable, "-c", code, *heavy],
        capture_output=True, text=True, timeout=30, check=True,
        env={**os.environ, "PYTHONPATH": str(Path(swarm.__file__).parents[1])},
    )  # fmt: skip

    assert done.stdout.splitlines()[-1] in ("", "pydantic")
