"""What a check has found: fine, doubtful or broken, and what to do about it."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import asdict, dataclass
from enum import StrEnum
from typing import Any

from rich.console import Console
from rich.text import Text

from coordinator.mission_view.presentation import BAD
from coordinator.mission_view.wording import clean


class CheckState(StrEnum):
    """How it stands."""

    OK = "ok"
    WARNING = "warning"
    FAILS = "fails"


_STYLES = {CheckState.OK: "green", CheckState.WARNING: "yellow", CheckState.FAILS: BAD}
_STATE_CELLS = len(CheckState.WARNING)


@dataclass(frozen=True, slots=True)
class CheckFinding:
    """What one check has found.

    Raises:
        ValueError: something is wrong, and nothing is said that would mend it.
    """

    check: str
    """What was looked at, in a word or two."""
    state: CheckState
    text: str
    """What was found."""
    remedy: str = ""
    """What to do; empty where nothing need be done."""

    def __post_init__(self) -> None:
        if (self.state is CheckState.OK) != (not self.remedy):
            raise ValueError(f"{self.check}: {self.state}, and what to do is {self.remedy!r}")

    def __str__(self) -> str:
        what_to_do = f"; {self.remedy}" if self.remedy else ""
        return f"{self.state:<{_STATE_CELLS}} " + clean(f"{self.check}: {self.text}{what_to_do}")


def fine(check: str, text: str) -> CheckFinding:
    """Nothing need be done."""
    return CheckFinding(check, CheckState.OK, text)


def warns(check: str, text: str, remedy: str) -> CheckFinding:
    """It may do, or not be meant so."""
    return CheckFinding(check, CheckState.WARNING, text, remedy)


def fails(check: str, text: str, remedy: str) -> CheckFinding:
    """It will not do."""
    return CheckFinding(check, CheckState.FAILS, text, remedy)


def as_json(findings: Sequence[CheckFinding]) -> dict[str, Any]:
    """The findings as `swarm doctor --json` prints them."""
    return {
        "ok": all(finding.state is not CheckState.FAILS for finding in findings),
        "counts": {state: sum(each.state is state for each in findings) for state in CheckState},
        "checks": [asdict(finding) for finding in findings],
    }


def print_findings(findings: Iterable[CheckFinding], console: Console) -> None:
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
