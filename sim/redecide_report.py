"""What came of deciding again, for people and for programs.

Leaves out: deciding again (sim.redecide).
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

from sim.redecide import Difference, Redecided

__all__ = ["redecided_as_json", "redecided_lines"]


def redecided_as_json(mission: str, found: Redecided) -> dict[str, Any]:
    """Everything, ready for `json.dumps`."""
    return {
        "mission": mission,
        "choices": found.choices,
        "agreeing": found.agreeing,
        "differing": [
            {
                "decision": each.decision,
                "uav": each.uav,
                "mission_s": each.choice.chosen_s,
                "left": each.choice.left,
                "rule": each.choice.rule,
                "recorded": {
                    "task": each.choice.task,
                    "completion_s": each.choice.completion_s,
                    "score": each.choice.score,
                },
                "again": {
                    "task": each.task,
                    "completion_s": each.completion_s,
                    "score": each.score,
                },
            }
            for each in found.differing
        ],
        "without_inputs": found.without_inputs,
    }


def redecided_lines(mission: str, found: Redecided) -> Iterator[str]:
    """One line for each difference, and what that makes in all."""
    for each in found.differing:
        yield _told(each)
    yield (
        f"{mission}: of {found.choices} choices {found.agreeing} come out the same, to the last "
        f"bit, and {len(found.differing)} otherwise"
    )
    if found.without_inputs:
        yield (
            f"not decided again: {found.without_inputs}, whose inputs are not in the recording "
            "(messages were lost, or said before it began)"
        )
    if not found.choices:
        yield "no choice is in the recording; agents say them once they take tasks"


def _told(each: Difference) -> str:
    choice = each.choice
    took = f"turned from {choice.left} to" if choice.left is not None else "took"
    was = _value(choice.task, choice.score, choice.completion_s)
    now = "nothing"
    if each.task is not None and each.score is not None and each.completion_s is not None:
        now = _value(each.task, each.score, each.completion_s)
    return f"{each.decision} at {choice.chosen_s:.1f} s {took} {was}; decided again: {now}"


def _value(task: str, score: float, completion_s: float) -> str:
    return f"{task} (score {score!r}, done at {completion_s!r} s)"
