"""Help: every command says what it does and shows how, and what it shows is right."""

from __future__ import annotations

import re
import shlex
from collections.abc import Iterator
from typing import Any

import pytest
import typer.main

from swarm import cli
from swarm.runtime.console import PANELS
from swarm.runtime.errors import InputError

SUMMARY_CELLS = 63
"""Room beside the names, in 80 columns."""


def application() -> Any:
    app = cli._application()
    for name, entry in cli._installed_commands().items():
        cli._register(app, name, entry.load())
    return typer.main.get_command(app)


ROOT = application()


def leaves(command: Any, path: tuple[str, ...] = ()) -> Iterator[tuple[tuple[str, ...], Any]]:
    for name, each in command.commands.items():
        if hasattr(each, "commands"):
            yield from leaves(each, (*path, name))
        else:
            yield (*path, name), each


COMMANDS = dict(leaves(ROOT))
NAMES = pytest.mark.parametrize("path", COMMANDS, ids=" ".join)


def examples_of(help_text: str) -> list[str]:
    """Command lines; one that is continued is indented no more than the first, behind no prompt."""
    block = help_text.partition("Examples:\n")[2].strip("\n")
    lines: list[str] = []
    for line in block.splitlines():
        if re.match(r"(\w+=\S+ )*swarm ", line.strip()):
            lines.append(line.strip())
        elif line.strip():
            lines[-1] += " " + line.strip()
    return lines


def swarm_calls(line: str) -> Iterator[list[str]]:
    """Arguments of every `swarm` in a shell's line."""
    for part in re.split(r"&&|\||>", line):
        words = shlex.split(part)
        while words and "=" in words[0]:
            del words[0]
        if words and words[0] == "swarm":
            yield words[1:]


@NAMES
def test_every_command_has_a_summary_an_explanation_and_examples(path: tuple[str, ...]) -> None:
    text = COMMANDS[path].help
    explanation, marked, _ = text.partition("\n")[2].partition("\b\nExamples:\n")
    summary = COMMANDS[path].get_short_help_str(1000)

    assert summary.endswith(".")
    assert len(summary) <= SUMMARY_CELLS
    assert explanation.strip(), "nothing is explained"
    assert marked, "there are no examples"
    assert examples_of(text)


@NAMES
def test_every_example_is_a_command_line_that_is_understood(path: tuple[str, ...]) -> None:
    names = set()
    for line in examples_of(COMMANDS[path].help):
        for words in swarm_calls(line):
            names.add(" ".join(path) if words[: len(path)] == list(path) else words[0])
            understand(ROOT, words)
    assert " ".join(path) in names, "no example of the command itself"


def understand(command: Any, words: list[str]) -> None:
    """Let the real parser read ``words``; only files need not be there."""
    name, *rest = words
    command = command.commands[name]
    if hasattr(command, "commands"):
        understand(command, rest)
        return
    missing = None
    try:
        command.make_context(name, rest)
    except InputError as error:
        missing = str(error)
    assert missing is None or re.match(r"[\w/.-]+\.toml: no such scenario", missing), missing


def test_the_overview_has_a_panel_and_a_line_for_every_command(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setenv("COLUMNS", "80")
    monkeypatch.delenv("_SWARM_COMPLETE", raising=False)

    assert cli.main(["--help"]) == 0

    text = capsys.readouterr().out
    assert max(map(len, text.splitlines())) <= 80
    in_panels = [name for names in PANELS.values() for name in names]
    assert len(in_panels) == len(set(in_panels))
    for name in ROOT.commands:
        assert name in in_panels
        (line,) = re.findall(rf"^  {name} +(\S.*)$", text, re.MULTILINE)
        assert line.endswith(".")
    headings = [text.index(f"\n{panel}:\n") for panel in PANELS if f"\n{panel}:\n" in text]
    assert headings == sorted(headings)
