"""What is told of a study while it is flown."""

from __future__ import annotations

import io
from dataclasses import dataclass

import pytest
from rich.console import Console

from sim.study.progress import StudyProgress, duration_text


@dataclass
class HandClock:
    at_s: float = 100.0

    def now_s(self) -> float:
        return self.at_s

    def wall_delay_s(self, delay_s: float) -> float:
        return delay_s


def play(steps: list[tuple[float, int]], *, terminal: bool) -> str:
    """What is written when so many of 10 trials are done at these times."""
    clock, text = HandClock(), io.StringIO()
    console = Console(file=text, force_terminal=terminal, width=80)
    with StudyProgress(console, "mine", clock) as progress:
        for at_s, done in steps:
            clock.at_s = 100.0 + at_s
            progress(done, 10)
    return text.getvalue()


def test_file_gets_a_line_now_and_then_and_one_at_the_end() -> None:
    steps = [(0.0, 0), (10.0, 1), (40.0, 2), (50.0, 3), (90.0, 9), (95.0, 10)]

    assert play(steps, terminal=False).splitlines() == [
        "mine: 2 of 10 trials done, 3 min left",
        "mine: 9 of 10 trials done, 10 s left",
        "mine: 10 of 10 trials done",
    ]


def test_terminal_gets_a_bar_with_the_time_left() -> None:
    shown = play([(0.0, 0), (40.0, 2)], terminal=True)

    assert "2/10" in shown
    assert "3 min left" in shown


def test_nothing_is_told_where_nothing_is_to_be_flown() -> None:
    clock, text = HandClock(), io.StringIO()
    with StudyProgress(Console(file=text), "mine", clock) as progress:
        progress(0, 0)

    assert text.getvalue() == ""


@pytest.mark.parametrize(
    ("duration_s", "expected"),
    [(0.4, "0 s"), (89.0, "89 s"), (120.0, "2 min"), (3600.0, "1 h 0 min"), (9000.0, "2 h 30 min")],
)
def test_durations_are_told_roughly(duration_s: float, expected: str) -> None:
    assert duration_text(duration_s) == expected
