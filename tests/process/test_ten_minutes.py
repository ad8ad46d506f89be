"""A newcomer's ten minutes: every command of the page says what the page shows."""

from __future__ import annotations

import os
import re
import shlex
import subprocess
import sys
from dataclasses import dataclass
from pathlib import Path

import pytest

pytestmark = [pytest.mark.process]

ROOT = Path(__file__).parents[2]
PAGE = ROOT / "deploy" / "TEN-MINUTES.md"
SET_UP = ("git", "cd", "source")
"""What has happened already where a test runs."""
PATIENCE_S = 300.0


@dataclass(frozen=True, slots=True)
class Command:
    """A command of the page, and what it prints there; ``…`` stands for anything."""

    words: tuple[str, ...]
    shown: tuple[str, ...]


def commands() -> list[Command]:
    """Those of the page's consoles, in order."""
    found = []
    for console in re.findall(
        r"^```console\n(.*?)^```", PAGE.read_text(), re.MULTILINE | re.DOTALL
    ):
        for said in re.split(r"^\$ ", console, flags=re.MULTILINE)[1:]:
            first, *shown = said.rstrip().splitlines()
            found.append(Command(tuple(shlex.split(first, comments=True)), tuple(shown)))
    return found


def recipe(target: str) -> list[str]:
    """What make runs for it once everything is installed."""
    rule = re.search(rf"^{target}: .*\n\t(.*)$", (ROOT / "Makefile").read_text(), re.MULTILINE)
    assert rule is not None
    return shlex.split(rule[1].replace("$(BIN)/", ""))


def pattern(shown: tuple[str, ...]) -> re.Pattern[str]:
    """Matches what is shown: a line of ``…`` alone any lines, within a line any characters."""
    lines = []
    for line in shown:
        if line.strip() == "…":
            lines.append(r"(?:.*\n)*")
        else:
            lines.append(r".*".join(map(re.escape, line.rstrip().split("…"))) + r"\n")
    return re.compile("".join(lines))


def test_the_page_begins_where_nothing_is_installed_and_ends_with_an_own_mission() -> None:
    programs = [command.words[0] for command in commands()]

    assert programs[:4] == ["git", "cd", "make", "source"]
    assert programs.count("swarm") >= 6
    assert {"new", "plan", "simulate", "explain"} <= {command.words[1] for command in commands()}


def test_every_command_prints_what_the_page_shows(tmp_path: Path) -> None:
    env = {**os.environ, "NO_COLOR": "1", "COLUMNS": "100"}
    env["PATH"] = f"{Path(sys.executable).parent}{os.pathsep}{env['PATH']}"
    for command in commands():
        program, *rest = command.words
        if program in SET_UP:
            assert command.shown == ()
            continue
        words = recipe(*rest) if program == "make" else [program, *rest]
        done = subprocess.run(
            words,
            cwd=tmp_path,
            env=env,
            stdin=subprocess.DEVNULL,
            stdout=subprocess.PIPE,
            stderr=subprocess.STDOUT,
            text=True,
            timeout=PATIENCE_S,
            check=False,
        )
        told = "".join(f"{line.rstrip()}\n" for line in done.stdout.splitlines())
        assert done.returncode == 0, (words, told)
        assert pattern(command.shown).fullmatch(told), (words, told)
