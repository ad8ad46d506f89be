"""A mission is flown and written down: what others read in the file, and what we read back."""

from __future__ import annotations

import io
import json
from pathlib import Path
from typing import Any

import jsonschema
import lz4.frame
import pytest
import zstandard
from mcap.data_stream import RecordBuilder
from mcap.reader import make_reader
from mcap.records import Chunk, DataEnd, Footer, Header
from mcap.writer import MCAP0_MAGIC

from coordinator.mission_view.scene import scene_of
from coordinator.recording.playback import Playback
from coordinator.recording.reader import FileRecords, Recording, read_recording
from coordinator.recording.records import RecordingStarted
from coordinator.terminal.status_table import status_as_json
from swarm.model import Plan
from swarm.runtime.errors import InputError
from tests.support.observed_mission import shipped
from tests.support.recordings import Flown, fly_recorded

LOST = "uav3"


@pytest.fixture(scope="module")
def flown() -> Flown:
    """The paper's mission, in which a UAV is lost."""
    mission = shipped("table-1")
    return fly_recorded(mission, lost_at_s={mission.uavs[2].id: 1.0}, method="guided")


@pytest.fixture
def recording(flown: Flown, tmp_path: Path) -> Recording:
    return read_recording(flown.write(tmp_path / "flight.mcap"))


def final(playback: Playback) -> dict[str, Any]:
    return status_as_json(scene_of(playback.mission_state, playback.now_s))


def read_or_refuse(path: Path) -> Recording | str:
    try:
        return read_recording(path)
    except InputError as fault:
        return str(fault)


def test_the_facts_are_those_that_the_core_got_at_the_same_times(
    flown: Flown, recording: Recording
) -> None:
    noted = [
        (now_s, what)
        for now_s, what in flown.steps.noted
        if not isinstance(what, Plan | RecordingStarted)
    ]

    assert [(entry.now_s, entry.fact) for entry in recording.entries] == noted
    assert recording.mission == "table-1"
    assert recording.torn is None
    assert recording.virtual
    assert [entry.plan.objective for entry in recording.plans] == [
        what.objective for _, what in flown.steps.noted if isinstance(what, Plan)
    ]


def test_replay_ends_with_the_very_picture_of_the_flight(
    flown: Flown, recording: Recording
) -> None:
    playback = Playback(recording)

    playback.seek(playback.duration_s)

    live = status_as_json(scene_of(flown.mission_state, playback.now_s))
    assert json.dumps(final(playback)) == json.dumps(live)
    assert [line.text for line in playback.mission_state.story] == [
        line.text for line in flown.mission_state.story
    ]
    assert playback.mission_state.result() == flown.mission_state.result()


def test_the_mcap_library_reads_it_and_every_message_fits_its_schema(flown: Flown) -> None:
    reader = make_reader(io.BytesIO(flown.data), validate_crcs=True)
    checks: dict[int, Any] = {}
    topics: dict[str, str] = {}
    for schema, channel, message in reader.iter_messages():
        assert schema is not None
        if schema.id not in checks:
            shape = json.loads(schema.data)
            jsonschema.Draft202012Validator.check_schema(shape)
            checks[schema.id] = jsonschema.Draft202012Validator(shape)
        checks[schema.id].validate(json.loads(message.data))
        topics[channel.topic] = schema.name

    assert topics["/uav/uav1/fix"] == "foxglove.LocationFix"
    assert topics["/scene/uavs"] == topics["/scene/tasks"] == "foxglove.SceneUpdate"
    assert topics["/log"] == "foxglove.Log"
    assert topics["/progress"] == "peckorder.Progress"
    assert topics["/swarm/table-1/uav/uav1/choice"] == "peckorder.Choice"
    assert topics["/swarm/table-1/recorder/plan"] == "peckorder.Plan"
    assert topics["/swarm/table-1/alive"] == "peckorder.Presence"


def test_scene_and_curves_tell_how_it_ended(flown: Flown) -> None:
    reader = make_reader(io.BytesIO(flown.data))
    last: dict[str, Any] = {}
    logs: list[str] = []
    for _, channel, message in reader.iter_messages():
        told = json.loads(message.data)
        last[channel.topic] = told
        if channel.topic == "/log":
            logs.append(told["message"])

    result = flown.mission_state.result()
    assert last["/progress"]["objective"] == result.executed_objective
    assert last["/progress"]["done"] == len(result.done) == 8
    assert last["/progress"]["lost"] == 1
    entities = {entity["id"]: entity for entity in last["/scene/tasks"]["entities"]}
    assert len(entities["done"]["cubes"]) == 8
    assert entities["open"]["spheres"] == []
    uavs = {entity["id"]: entity for entity in last["/scene/uavs"]["entities"]}
    assert uavs[LOST]["texts"][0]["text"] == f"{LOST} LOST"
    assert any(f"{LOST} lost" in line for line in logs)


@pytest.mark.parametrize("every", [1, 7])
def test_a_file_torn_anywhere_gives_all_that_was_written_before(every: int, tmp_path: Path) -> None:
    """Each write may stop at any byte: what the write before had left is never lost."""
    steps = fly_recorded(shipped("table-1"), every=every * 40).steps
    path = tmp_path / "torn.mcap"
    states, patches = steps.disk.states, steps.disk.patches
    for number in range(2, len(states), 3):
        before, patch = states[number - 1], patches[number]
        facts = [
            (now_s, what)
            for now_s, what in steps.noted[: steps.written[number - 1]]
            if not isinstance(what, Plan | RecordingStarted)
        ]
        for cut in {0, 1, 9, 60, 4096, len(patch.data) // 2, len(patch.data) - 1}:
            if cut >= len(patch.data):
                continue
            # The disk has some of the new bytes; behind them is what was there before.
            torn = bytearray(before)
            torn[patch.offset : patch.offset + cut] = patch.data[:cut]
            path.write_bytes(torn)

            found = read_recording(path)

            entries = [(entry.now_s, entry.fact) for entry in found.entries]
            assert entries[: len(facts)] == facts
            assert found.torn is None or "\n" not in found.torn
            if cut > 9 and bytes(torn) != before:
                assert found.torn is not None


def test_a_file_cut_off_anywhere_is_read_up_to_there_or_refused_in_one_line(
    flown: Flown, tmp_path: Path
) -> None:
    path, count, read = tmp_path / "cut.mcap", 0, 0
    for size in [*range(0, 3000, 131), *range(3000, len(flown.data), len(flown.data) // 40)]:
        path.write_bytes(flown.data[:size])
        found = read_or_refuse(path)
        if isinstance(found, str):
            assert "\n" not in found
            assert count == 0  # once there is something to read, longer files have more
        else:
            assert found.torn is not None
            assert len(found.entries) >= count
            count, read = len(found.entries), read + 1
    assert read > 20


def test_flipped_bytes_are_never_taken_for_facts(flown: Flown, tmp_path: Path) -> None:
    path = tmp_path / "flipped.mcap"
    whole = [(e.now_s, e.fact) for e in read_recording(flown.write(path)).entries]
    for place in range(200, len(flown.data), len(flown.data) // 60):
        flipped = bytearray(flown.data)
        flipped[place] ^= 0x55
        path.write_bytes(flipped)
        found = read_or_refuse(path)
        if isinstance(found, str):
            assert "\n" not in found
            continue
        entries = [(entry.now_s, entry.fact) for entry in found.entries]
        assert entries == whole[: len(entries)]
        assert found.torn is not None or entries == whole


def metadata(flown: Flown, old: bytes, new: bytes) -> bytes:
    """The recording with other metadata of the same length."""
    assert old in flown.data
    return flown.data.replace(old, new)


@pytest.mark.parametrize(
    ("data", "words"),
    [
        (b"", "is empty"),
        (b"hello", "is no MCAP file"),
        (b"\x89MCAP0\r\n", "no recording of a mission"),
    ],
)
def test_other_files_are_refused_in_one_line(data: bytes, words: str, tmp_path: Path) -> None:
    path = tmp_path / "other.mcap"
    path.write_bytes(data)

    with pytest.raises(InputError, match=words) as refused:
        read_recording(path)

    assert str(path) in str(refused.value)
    assert "\n" not in str(refused.value)


def packed(data: bytes, says: int, compression: str) -> bytes:
    """A file with one chunk that says it holds so many bytes."""
    out = RecordBuilder()
    out.write(MCAP0_MAGIC)
    Header("", "").write(out)
    Chunk(
        compression=compression,
        data=data,
        message_start_time=0,
        message_end_time=0,
        uncompressed_crc=0,
        uncompressed_size=says,
    ).write(out)
    DataEnd(0).write(out)
    Footer(0, 0, 0).write(out)
    out.write(MCAP0_MAGIC)
    return bytes(out.end())


@pytest.mark.parametrize("compression", ["zstd", "lz4"])
@pytest.mark.parametrize(("says", "whole"), [(90, False), (9000, True), (2**40, False)])
def test_a_chunk_is_unpacked_no_further_than_it_says_and_never_without_end(
    compression: str, says: int, whole: bool
) -> None:
    pack = {"zstd": zstandard.compress, "lz4": lz4.frame.compress}[compression]
    nothing = 1000 * (b"\xff" + bytes(8))  # records that readers pass over
    records = FileRecords(packed(pack(nothing), says, compression))

    assert list(records.messages()) == []
    assert (records.torn_at is None) is whole


def test_a_recording_of_another_version_is_refused(flown: Flown, tmp_path: Path) -> None:
    path = tmp_path / "newer.mcap"
    path.write_bytes(metadata(flown, b"format\x01\x00\x00\x001", b"format\x01\x00\x00\x009"))

    with pytest.raises(InputError, match="is of format version 9, not 1"):
        read_recording(path)


def test_a_file_that_is_not_there_is_refused(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="cannot be read: No such file"):
        read_recording(tmp_path / "none.mcap")
