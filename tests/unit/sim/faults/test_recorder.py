"""What the recorder keeps of what its seats hear, and where they are."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from sim.fleet.faults.recorder import RECORDER, BusRecorder, recorder_seats
from sim.fleet.layout import BusKind, LaunchOptions, Layout
from swarm.bus.config import ClientTopology, MeshTopology
from swarm.bus.port import LinkUp, Sample
from swarm.protocol.encoding import encode
from swarm.protocol.messages import Message, Stamp
from swarm.protocol.uav_messages import AttemptResult, Outcome
from tests.support.builders import mission, task, uav

SAID = Message("m", "u1", Stamp(1, 2), Outcome("t1", AttemptResult.DONE, 1, 3.0))


class Hands:
    """A clock that stands until it is moved."""

    def __init__(self) -> None:
        self.at_s = 0.0

    def now_s(self) -> float:
        return self.at_s

    def wall_delay_s(self, delay_s: float) -> float:
        return delay_s


def layout(kind: BusKind, routers: int = 1) -> Layout:
    options = LaunchOptions(
        scenario=Path("here.toml"),
        method="greedy",
        seed=0,
        speedup=1.0,
        bus=kind,
        position_rate_hz=10.0,
        acceptance_radius_m=1.0,
        start_timeout_s=10.0,
        routers=routers,
    )
    fleet = mission([uav("u1"), uav("u2")], [task("t0", 1.0)])
    return Layout(options, fleet, np.random.default_rng(0), observers=(RECORDER,))


def test_messages_are_kept_with_seat_size_and_time() -> None:
    clock, key, payload = Hands(), SAID.key, encode(SAID)
    recorder = BusRecorder("m", (), clock)
    clock.at_s = 1.5
    recorder.take(0, Sample(key, payload))
    recorder.take(0, LinkUp())

    kept = [(entry.at_s, entry.seat, entry.what, entry.size_bytes) for entry in recorder.entries]
    assert kept == [(1.5, 0, SAID, len(payload))]
    assert recorder.messages(0) == [SAID]
    assert recorder.messages(1) == []


def test_what_nobody_can_read_is_not_kept() -> None:
    recorder = BusRecorder("m", (), Hands())
    recorder.take(0, Sample(SAID.key, b"garbage"))

    assert recorder.entries == []


def test_with_routers_there_is_a_seat_at_each() -> None:
    made = layout(BusKind.ROUTER, routers=2)

    assert [seat.topology for seat in recorder_seats(made)] == [
        ClientTopology((made.endpoint("router 1"),)),
        ClientTopology((made.endpoint("router 2"),)),
    ]


def test_in_a_mesh_one_seat_is_linked_to_every_peer() -> None:
    (seat,) = recorder_seats(layout(BusKind.MESH))

    assert isinstance(seat.topology, MeshTopology)
    assert len(seat.topology.dial) == 4  # coordinator, two agents and the launcher's observer
