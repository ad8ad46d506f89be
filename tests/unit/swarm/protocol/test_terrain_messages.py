"""The ground in a brief: the same for all who hear it, and nothing for who does not know it."""

from __future__ import annotations

import zlib
from dataclasses import replace

import msgpack
import numpy as np
import pytest

from coordinator.core.publication import mission_config_of
from swarm.model import Mission, Task, TaskId, Uav, UavId
from swarm.model.layers import FlightLayers
from swarm.model.terrain import MOST_HEIGHTS, Terrain
from swarm.protocol.board_arrays import mission_with
from swarm.protocol.codec import Codec
from swarm.protocol.encoding import LARGE_LIMIT_BYTES, encode
from swarm.protocol.field_messages import TerrainSpec
from swarm.protocol.messages import TERRAIN_VERSION, Message, Stamp
from tests.support.hills import hills


def mission(terrain: Terrain | None) -> Mission:
    uav = Uav(UavId("u1"), (0.0, 0.0, 5.0), 10.0, acceleration_m_s2=2.0)
    task = Task(TaskId("t1"), (100.0, 0.0, 7.0), 1.0)
    return Mission("hills", 600.0, (uav,), (task,), terrain=terrain)


def test_a_brief_brings_the_very_ground_of_the_mission() -> None:
    brief = mission_config_of(mission(hills(1)), FlightLayers(), 1)
    said = encode(Message("hills", "coordinator", Stamp(1, 1), brief))
    heard = Codec("hills").decode("swarm/hills/brief", said)

    assert msgpack.unpackb(said)[0] == TERRAIN_VERSION
    assert heard is not None
    assert heard.body == brief
    assert mission_with("hills", brief, (), (), ()).terrain == hills(1)
    assert brief.uavs[0].layer_m == 23.0  # clearance and what plans keep beyond


def test_a_brief_brings_the_band_over_the_ground() -> None:
    kept = replace(mission(hills(1)), separation_m=10.0, band_m=(30.0, 60.0))
    brief = mission_config_of(kept, FlightLayers(), 1)
    said = encode(Message("hills", "coordinator", Stamp(1, 1), brief))
    heard = Codec("hills").decode("swarm/hills/brief", said)

    assert heard is not None
    assert heard.body == brief
    assert brief.uavs[0].layer_m == 30.0
    with pytest.raises(ValueError, match="must begin at 23 or higher"):
        replace(brief, band_m=(22.0, 60.0))
    with pytest.raises(ValueError, match="must begin at 23 or higher"):
        replace(kept, band_m=(22.0, 60.0))


def test_layers_of_their_own_lie_in_the_band() -> None:
    fleet = [Uav(UavId(f"u{k}"), (30.0 * k, 0.0, 5.0), 10.0) for k in range(5)]
    kept = replace(mission(hills(1)), uavs=tuple(fleet), band_m=(30.0, 34.0))
    brief = mission_config_of(kept, FlightLayers(), 1)

    assert [uav.layer_m for uav in brief.uavs] == [30.0, 31.0, 32.0, 33.0, 34.0]


def test_the_roughest_ground_there_can_be_has_room_in_a_message() -> None:
    steps = np.random.default_rng(0).integers(0, 2**16, MOST_HEIGHTS).astype("<u2")
    rough = Terrain(20.0, 0.0, 0.0, 1.0, 1.0, 512, 0.0, steps.tobytes())
    brief = mission_config_of(mission(rough), FlightLayers(), 1)
    said = encode(Message("hills", "coordinator", Stamp(1, 1), brief))
    assert len(said) < LARGE_LIMIT_BYTES
    assert brief.terrain is not None
    assert brief.terrain.terrain() == rough


def test_ground_that_is_none_is_refused() -> None:
    spec = TerrainSpec.of(hills(1))
    for packed in (b"no zlib", zlib.compress(b"odd"), zlib.compress(bytes(10**8))):
        with pytest.raises(ValueError, match=r"terrain|heights"):
            replace(spec, packed=packed)
    with pytest.raises(ValueError, match="rows"):
        replace(spec, columns=39)
