"""What a command shows a person beside its result: its help, and lines on standard error.

A docstring becomes help: summary and description as they are, an ``Examples:`` section line by
line, every other section (``Args:``, ``Raises:`` …) left to readers of code.
"""

from __future__ import annotations

import inspect
import re
import sys
from collections.abc import Mapping
from typing import Any

import typer
from typer.core import TyperGroup


def say(text: str) -> None:
    """One line on standard error."""
    print(f"swarm: {text}", file=sys.stderr, flush=True)


PANELS: Mapping[str, tuple[str, ...]] = {
    "Plan": ("new", "import", "plan"),
    "Fly": ("run", "simulate", "coordinator", "agent", "autopilot", "router"),
    "Watch and command": (
        "status",
        "dashboard",
        "foxglove",
        "ros2",
        "start",
        "task",
        "zone",
        "ready",
        "hold",
        "resume",
        "return",
        "abort",
    ),
    "Record and replay": ("record", "replay", "explain"),
    "Study and test": ("reproduce", "study", "bench", "soak"),
    "Fit for the field": ("keys", "install"),
    "Helpers": ("doctor",),
}
"""Commands by what one wants to do; those of no panel come with the last one."""

_LAST = "Helpers"
_SECTION = re.compile(r"(Args|Arguments|Examples?|Notes?|Raises|Returns|Yields):")


def help_text(docstring: str) -> str:
    """Help of a command from its docstring; ``\\b`` keeps the lines of examples apart."""
    described: list[str] = []
    examples: list[str] = []
    section = ""
    for line in inspect.cleandoc(docstring).splitlines():
        if _SECTION.fullmatch(line):
            section = line.rstrip(":")
        elif not section:
            described.append(line)
        elif section.startswith("Example") and line.strip():
            examples.append(line)
    text = "\n".join(described).strip()
    return f"{text}\n\n\b\nExamples:\n" + "\n".join(examples) if examples else text


def explain_family(family: typer.Typer) -> None:
    """Make help of the docstrings of a family's members that have none of their own."""
    for member in family.registered_commands:
        if member.help is None and member.callback is not None:
            text = help_text(inspect.getdoc(member.callback) or "")
            member.help = text
            member.short_help = member.short_help or text.partition("\n")[0]
    for inner in family.registered_groups:
        if inner.typer_instance is not None:
            explain_family(inner.typer_instance)


class Panels(TyperGroup):
    """A group whose help lists its commands by panel."""

    def format_commands(self, ctx: Any, formatter: Any) -> None:
        """Write every panel that has commands."""
        commands = {name: self.get_command(ctx, name) for name in self.list_commands(ctx)}
        shown = {name: each for name, each in commands.items() if each and not each.hidden}
        in_panels = {name for names in PANELS.values() for name in names}
        rest = tuple(name for name in shown if name not in in_panels)
        width = max(map(len, shown), default=0)
        # Behind the names and two spaces on each side of them.
        limit = formatter.width - width - 4
        for panel, names in PANELS.items():
            rows = [
                (f"{name:<{width}}", shown[name].get_short_help_str(limit))
                for name in (*names, *(rest if panel == _LAST else ()))
                if name in shown
            ]
            if rows:
                with formatter.section(panel):
                    formatter.write_dl(rows)
