"""What a check has found: fine, doubtful or broken, and what to do about it.

Leaves out: the checks.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import asdict, dataclass
from enum import StrEnum
from typing import Any

from rich.console import Console
from rich.text import Text

from coordinator.view.signs import BAD
from coordinator.view.story import clean

__all__ = ["Finding", "State", "as_json", "fails", "fine", "print_findings", "warns"]


class State(StrEnum):
    """How it stands."""

    OK = "ok"
    WARNING = "warning"
    FAILS = "fails"


_STYLES = {State.OK: "green", State.WARNING: "yellow", State.FAILS: BAD}
_STATE_CELLS = len(State.WARNING)


@dataclass(frozen=True, slots=True)
class Finding:
    """What one check has found.

    Raises:
        ValueError: something is wrong, and nothing is said that would mend it.
    """

    check: str
    """What was looked at, in a word or two."""
    state: State
    text: str
    """What was found."""
    remedy: str = ""
    """What to do; empty where nothing need be done."""

    def __post_init__(self) -> None:
        if (self.state is State.OK) != (not self.remedy):
            raise ValueError(f"{self.check}: {self.state}, and what to do is {self.remedy!r}")

    def __str__(self) -> str:
        what_to_do = f"; {self.remedy}" if self.remedy else ""
        return f"{self.state:<{_STATE_CELLS}} " + clean(f"{self.check}: {self.text}{what_to_do}")


def fine(check: str, text: str) -> Finding:
    """Nothing need be done."""
    return Finding(check, State.OK, text)


def warns(check: str, text: str, remedy: str) -> Finding:
    """It may do, or not be meant so."""
    return Finding(check, State.WARNING, text, remedy)


def fails(check: str, text: str, remedy: str) -> Finding:
    """It will not do."""
    return Finding(check, State.FAILS, text, remedy)


def as_json(findings: Sequence[Finding]) -> dict[str, Any]:
    """The findings as `swarm doctor --json` prints them."""
    return {
        "ok": all(finding.state is not State.FAILS for finding in findings),
        "counts": {state: sum(each.state is state for each in findings) for state in State},
        "checks": [asdict(finding) for finding in findings],
    }


def print_findings(findings: Iterable[Finding], console: Console) -> None:
    """One line each as they come; on a terminal what to do stands below."""
    for finding in findings:
        if not console.is_terminal:
            console.print(Text(str(finding)), soft_wrap=True)
            continue
        line = Text(f"{finding.state:<{_STATE_CELLS}} ", _STYLES[finding.state])
        line.append(f"{finding.check}: ", "bold").append(clean(finding.text), "")
        console.print(line, soft_wrap=True)
        if finding.remedy:
            console.print(Text(f"{'':{_STATE_CELLS}} {clean(finding.remedy)}"), soft_wrap=True)
