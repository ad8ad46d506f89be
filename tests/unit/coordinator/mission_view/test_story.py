"""Lines of a story: what is trouble, and how one becomes a sentence."""

from __future__ import annotations

import pytest

from coordinator.mission_view.story import EventKind, MissionEvent, Story


@pytest.mark.parametrize(
    ("text", "detail", "sentence"),
    [
        ("u0 ended t0: done", " at 5.00 s", "u0 ended t0: done at 5.00 s."),
        ("task t0 appeared", ": value 1", "Task t0 appeared: value 1."),
        ("operator holds u0", "", "Operator holds u0."),
    ],
)
def test_a_sentence_has_the_detail_and_leaves_ids_as_they_are(
    text: str, detail: str, sentence: str
) -> None:
    assert MissionEvent(1.0, text, detail=detail).sentence == sentence


def test_what_is_trouble_is_told_by_its_kind_and_not_by_its_words() -> None:
    silent = MissionEvent(1.0, "u0 lost, silent though its link is up", EventKind.LOST)
    remark = MissionEvent(1.0, "u0: its GPS is lost", EventKind.REMARK)

    assert silent.is_trouble
    assert not remark.is_trouble


def test_a_line_that_was_wrong_is_taken_back_and_its_equals_stay() -> None:
    story = Story()
    first, second = MissionEvent(1.0, "u0 gave t0 up"), MissionEvent(1.0, "u0 gave t0 up")
    story.add(first)
    story.add(second)
    story.take_back(second)

    assert story.lines == [first]
    assert story.lines[0] is first
