"""A file that grows: whole after every step, for the mcap library's own readers."""

from __future__ import annotations

import io
import json

from hypothesis import given
from hypothesis import strategies as st
from mcap.reader import NonSeekingReader, make_reader

from coordinator.recording.growing_mcap import GrowingMcap
from coordinator.recording.reader import FileRecords
from tests.support.recordings import Disk

SCHEMA = b'{"type":"object"}'


def growing(max_summary_bytes: int = 1 << 20) -> GrowingMcap:
    mcap = GrowingMcap("test", {"mission": "m"}, "about", max_summary_bytes)
    mcap.define("thing", SCHEMA)
    return mcap


def seen(data: bytes) -> list[tuple[str, int, object]]:
    reader = make_reader(io.BytesIO(data), validate_crcs=True)
    return [
        (channel.topic, message.log_time, json.loads(message.data))
        for _, channel, message in reader.iter_messages()
    ]


def streamed(data: bytes) -> list[tuple[str, int, object]]:
    reader = NonSeekingReader(io.BytesIO(data), validate_crcs=True)
    return [
        (channel.topic, message.log_time, json.loads(message.data))
        for _, channel, message in reader.iter_messages(log_time_order=False)
    ]


def grow(mcap: GrowingMcap, disk: Disk, *, last: bool = False) -> None:
    patch = mcap.grow(last=last)
    if patch is not None:
        disk.apply(patch)


def test_a_file_without_messages_is_whole() -> None:
    mcap, disk = growing(), Disk()

    grow(mcap, disk)

    reader = make_reader(io.BytesIO(disk.data))
    summary = reader.get_summary()
    assert summary is not None
    assert summary.statistics is not None
    assert summary.statistics.message_count == 0
    assert [m.metadata for m in reader.iter_metadata()] == [{"mission": "m"}]
    assert mcap.grow() is None


@given(st.lists(st.lists(st.tuples(st.sampled_from("abc"), st.integers(0, 99)), max_size=5)))
def test_after_every_step_both_readers_see_all_that_was_added(
    steps: list[list[tuple[str, int]]],
) -> None:
    mcap, disk = growing(), Disk()
    added: list[tuple[str, int, object]] = []
    grow(mcap, disk)
    for number, step in enumerate(steps):
        for topic, value in step:
            log_ns = 1000 * number
            mcap.add(topic, "thing", json.dumps({"value": value}).encode(), log_ns)
            added.append((topic, log_ns, {"value": value}))
        grow(mcap, disk, last=number == len(steps) - 1)

        assert seen(bytes(disk.data)) == streamed(bytes(disk.data)) == added
        assert disk.data == disk.data[: mcap.size_bytes]
        summary = make_reader(io.BytesIO(disk.data)).get_summary()
        assert summary is not None
        assert summary.statistics is not None
        assert summary.statistics.message_count == mcap.messages == len(added)


def test_a_step_writes_only_what_is_new_and_the_tail() -> None:
    mcap, disk = growing(), Disk()
    for number in range(200):
        mcap.add("a", "thing", json.dumps({"value": number}).encode(), number)
        grow(mcap, disk)

    whole = mcap.size_bytes
    assert sum(len(patch.data) for patch in disk.patches[-2:]) < whole
    assert all(
        later.offset > earlier.offset
        for earlier, later in zip(disk.patches[1:], disk.patches[2:], strict=False)
    )


def test_a_summary_that_grows_too_long_is_left_to_the_end() -> None:
    mcap, disk = growing(max_summary_bytes=2000), Disk()
    sizes = []
    for number in range(60):
        mcap.add("a", "thing", json.dumps({"value": number}).encode(), number)
        grow(mcap, disk)
        sizes.append(len(disk.data))
        assert len(seen(bytes(disk.data))) == number + 1
    assert make_reader(io.BytesIO(disk.data)).get_summary() is None
    assert sizes == sorted(sizes)  # a file that shrinks has a moment without an end

    grow(mcap, disk, last=True)

    summary = make_reader(io.BytesIO(disk.data)).get_summary()
    assert summary is not None
    assert len(summary.chunk_indexes) == 60
    assert len(seen(bytes(disk.data))) == 60
    records = FileRecords(bytes(disk.data))
    assert len(list(records.messages())) == 60
    assert records.torn_at is None
