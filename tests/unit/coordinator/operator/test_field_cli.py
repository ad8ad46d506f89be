"""What the commands for zones, lines and readiness make of a command line, without a bus."""

from __future__ import annotations

from pathlib import Path

import pytest

from coordinator.operator.points import gathered, points_of
from swarm.cli import main
from swarm.runtime.errors import InputError

TRIANGLE = ["--polygon", "0,0", "-10,0", "10,-10"]


@pytest.mark.parametrize(
    ("given", "read"),
    [
        (["--path", "0,0", "-5,1", "2,3,4", "op"], ["--path=0,0 -5,1 2,3,4", "op"]),
        (["op", "--path=0,0", "1,1", "--value", "3"], ["op", "--path=0,0 1,1", "--value", "3"]),
        (["--polygon", "0,0 1,1", "2,0"], ["--polygon", "0,0 1,1", "2,0"]),
        (["--polygon", "0,0", "--polygon", "1,1"], ["--polygon=0,0", "--polygon=1,1"]),
        (["--path", "--due-s", "3"], ["--path", "--due-s", "3"]),
        (["--position", "1,2", "3,4"], ["--position", "1,2", "3,4"]),
    ],
)
def test_points_after_an_option_are_its_own(given: list[str], read: list[str]) -> None:
    assert list(gathered(given)) == read


def test_points_are_two_numbers_and_in_metres_maybe_three() -> None:
    assert points_of("--path", "0,0 -5,1.5,2", in_degrees=False) == ((0.0, 0.0), (-5.0, 1.5, 2.0))
    for wrong in ("0,0 1", "0,0 1,x", "1,2 nan,0", "1,2,3,4"):
        with pytest.raises(InputError, match=r"--path: point [12]: '.*' is no place; give metres"):
            points_of("--path", wrong, in_degrees=False)
    with pytest.raises(InputError, match="give latitude and longitude"):
        points_of("--path-deg", "47,8,3", in_degrees=True)


@pytest.mark.parametrize(
    ("words", "complaint"),
    [
        (["z"], "swarm zone add: no corners were given; give either --polygon, --polygon-deg"),
        (["z", *TRIANGLE, "--file", "x.toml"], "swarm zone add: a zone was given more than once"),
        (["z", "--polygon", "0,0", "1,1"], "--polygon: polygon of zone z must have at least three"),
        (["z", "--polygon", "0,0,5", "1,1", "2,0"], "--polygon: point 1: has a height"),
        (["z", *TRIANGLE, "--floor-m", "9", "--ceiling-m", "3"], "--polygon: ceiling_m of zone z"),
        (["z", "--polygon-deg", "91,0", "1,1", "2,0"], "--polygon-deg: 91,0 is no latitude"),
        (["a b", *TRIANGLE], "ID: 'a b' is no id; give 1 to 64 letters"),
        (["z", "--file", "no-such.toml"], "no-such.toml: cannot be read"),
        (["z", *TRIANGLE, "--reason", "x" * 151], "--reason: it has 151 characters"),
    ],
)
def test_a_zone_that_cannot_be_is_refused_in_one_line(
    words: list[str], complaint: str, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["zone", "add", *words]) == 2
    (line,) = capsys.readouterr().err.splitlines()
    assert line.startswith(complaint)


@pytest.mark.parametrize(
    ("words", "complaint"),
    [
        (["--path", "0,0"], "--path: 1 point is no line; give two points or more"),
        (["--path", "0,0", "1,x"], "--path: point 2: '1,x' is no place"),
        (["--path", "0,0", "1,1", "--position", "2,2"], "swarm task add: a place was given beside"),
        (["--path", "0,0", "1,1", "--path-deg", "1,1"], "swarm task add: two lines were given"),
        (["--path-deg", "95,0", "1,1"], "--path-deg: latitude must be within -90..90, not 95"),
        (
            ["--position", "1,2", "--opens-s", "60", "--due-s", "60"],
            "swarm task add: it is due by 60 s, before it opens",
        ),
        (
            ["--position", "1,2", "--opens-s", "60", "--closes-s", "30"],
            "swarm task add: it closes at 30 s, before it opens",
        ),
        (["--position", "1,2", "--due-s", "-3"], "swarm task add: invalid value for '--due-s'"),
        (
            ["--path", *(f"{n},0" for n in range(200))],
            "swarm task add: its line has 200 points, and a message has room for 120",
        ),
    ],
)
def test_a_line_or_limits_that_cannot_be_are_refused_in_one_line(
    words: list[str], complaint: str, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["task", "add", *words]) == 2
    (line,) = capsys.readouterr().err.splitlines()
    assert line.startswith(complaint)


def test_a_file_that_holds_the_zone_twice_wrong_names_both(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    file = tmp_path / "zones.toml"
    file.write_text(
        '[[zone]]\nid = "z"\npolygon_m = [[0, 0], [1, 1]]\n'
        '[[zone]]\nid = "y"\npolygon_m = [[0, 0], [9, 0], [9, 9]]\nflor_m = 3\n'
    )
    assert main(["zone", "add", "z", "--file", str(file)]) == 2
    complaints = capsys.readouterr().err.splitlines()
    assert [line.removeprefix(f"{file}: ").partition(":")[0] for line in complaints] == [
        'zone[0] "z".polygon_m',
        'zone[1] "y".flor_m',
    ]


@pytest.mark.parametrize("command", [["zone", "remove"], ["ready"]])
def test_what_it_is_about_must_be_named(
    command: list[str], capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(command) == 2
    assert command[0] in capsys.readouterr().err


def test_each_command_shows_examples(capsys: pytest.CaptureFixture[str]) -> None:
    for words in (["zone", "add"], ["zone", "remove"], ["ready"]):
        assert main([*words, "--help"]) == 0
        assert f"\n      swarm {' '.join(words)} " in capsys.readouterr().out
