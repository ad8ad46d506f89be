"""Texts in pieces."""

from __future__ import annotations

from hypothesis import given
from hypothesis import strategies as st
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from agent.vehicle.codec import MavlinkCodec
from agent.vehicle.framing import TextJoiner
from agent.vehicle.messages import StatusText
from tests.support.mavlink_frames import frame

LONG = "x" * 50


def test_a_short_text_is_whole_at_once() -> None:
    assert TextJoiner().add(4, "Failsafe\t", 3, 0) == [StatusText(4, "Failsafe")]
    assert TextJoiner().add(4, LONG, 0, 0) == [StatusText(4, LONG)]


def test_chunks_become_one_text() -> None:
    joiner = TextJoiner()
    assert joiner.add(2, LONG, 7, 0) == []
    assert joiner.add(2, LONG, 7, 1) == []
    assert joiner.add(2, "end\t", 7, 2) == [StatusText(2, LONG + LONG + "end")]
    assert joiner.add(6, "next", 8, 0) == [StatusText(6, "next")]


def test_a_text_that_fills_its_chunks_ends_with_an_empty_one() -> None:
    joiner = TextJoiner()
    joiner.add(2, LONG, 7, 0)
    assert joiner.add(2, "", 7, 1) == [StatusText(2, LONG)]


def test_a_lost_end_shows_when_the_next_text_comes() -> None:
    joiner = TextJoiner()
    joiner.add(2, LONG, 7, 0)
    assert joiner.add(6, "other", 8, 0) == [StatusText(2, LONG + "..."), StatusText(6, "other")]


def test_a_lost_beginning_or_middle_shows() -> None:
    joiner = TextJoiner()
    assert joiner.add(2, "end", 7, 1) == [StatusText(2, "...end")]
    joiner.add(2, LONG, 8, 0)
    assert joiner.add(2, "end", 8, 2) == [StatusText(2, LONG + "...end")]


def test_a_text_without_end_is_cut_off() -> None:
    joiner = TextJoiner()
    said = [text for seq in range(8) for text in joiner.add(2, LONG, 7, seq)]
    assert said == [StatusText(2, 8 * LONG + "...")]


def test_what_cannot_be_printed_is_marked() -> None:
    assert TextJoiner().add(2, "Arm:\x07 no", 0, 0) == [StatusText(2, "Arm:? no")]


@given(
    st.lists(st.tuples(st.text(max_size=50), st.integers(0, 3), st.integers(0, 255)), max_size=60)
)
def test_whatever_comes_texts_stay_short_and_printable(chunks: list[tuple[str, int, int]]) -> None:
    joiner = TextJoiner()
    for text, text_id, seq in chunks:
        for said in joiner.add(4, text, text_id, seq):
            assert len(said.text) <= 8 * 53 + 3
            assert said.text.isprintable()


def test_texts_of_two_speakers_are_not_mixed_up() -> None:
    def said(system: int, text: str, seq: int) -> bytes:
        return frame(mavlink.MAVLink_statustext_message(2, text.encode(), 7, seq), system)

    codec = MavlinkCodec(1)
    stream = said(1, LONG, 0) + said(2, "from another", 0) + said(1, "end", 1)
    heard = [(one.system_id, one.message) for one in codec.decode(stream)]
    assert heard == [(2, StatusText(2, "from another")), (1, StatusText(2, LONG + "end"))]


def test_a_new_link_does_not_end_a_text_of_the_old_one() -> None:
    codec = MavlinkCodec(1)
    codec.decode(frame(mavlink.MAVLink_statustext_message(2, LONG.encode(), 7, 0)))
    codec.reset_link()
    [heard] = codec.decode(frame(mavlink.MAVLink_statustext_message(2, b"new", 8, 0)))
    assert heard.message == StatusText(2, "new")
