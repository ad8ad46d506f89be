"""Somebody lies about where it is, with keys or without: others give way, meet nobody, and go on.

Real bridges and simulated autopilots behind seals, with nothing planned beforehand. The liar is a
UAV of the fleet whose own vehicle flies far away. It knows where all others are at any moment.
"""

from __future__ import annotations

import functools
import math
from collections.abc import Callable, Iterator
from itertools import count

import pytest

from agent.vehicle.config import CommandStyle
from sim.autopilot.firmware import FirmwareModelName
from sim.world.engine import EventQueue
from sim.world.network import NetworkConditions
from swarm.protocol.encoding import encode
from swarm.protocol.fields import Point
from swarm.protocol.messages import Message, Stamp
from swarm.protocol.uav_messages import Nearby
from tests.faults.sealed_network import SealedNetwork
from tests.support.bridged_crossings import SEPARATION_M, CrossingFleet, mission_of
from tests.support.bridged_fleet import KINDS
from tests.support.keyring import Keyring

LIAR = "u2"
FIRST_S, EVERY_S = 0.137, 0.25
"""Between two instants at which vehicles say something, which looking at them would take away."""
UP_M = 20.0
STILL = (0.0, 0.0, 0.0)
FAST, FAR = 1e6, 1e8
"""As much as can be said at all."""
MISSION = mission_of(
    ((-80.0, 0.0), (80.0, 0.0)), ((0.0, -80.0), (0.0, 80.0)), ((600.0, 600.0), (640.0, 600.0))
)
HONEST = ("u0", "u1")


class LiedTo:
    """Two that cross each other's way, and one that lies to them."""

    def __init__(
        self,
        monkeypatch: pytest.MonkeyPatch,
        kind: tuple[FirmwareModelName, CommandStyle],
        lies: Callable[[LiedTo], Iterator[tuple[str, bytes]]],
    ) -> None:
        self.keys = Keyring(*(uav.id for uav in MISSION.uavs), mission=MISSION.name)
        self.heard: list[tuple[str, bytes]] = []
        """All words of where somebody is, as the bus carries them."""
        self.networks: list[SealedNetwork] = []
        self._lies, self._number = lies, count(1)
        self._places: dict[str, Point] = {}
        self.fleet = CrossingFleet(monkeypatch, *kind, MISSION, network=self._join)
        self.fleet.at(FIRST_S, self._lie)

    def _join(self, queue: EventQueue) -> SealedNetwork:
        seal_of, ear = functools.cache(self.keys.seal), self.keys.seal("dashboard")
        network = SealedNetwork(queue, NetworkConditions(), 0, MISSION.name, seal_of, ear)
        network.overheard = self._overhear
        self.networks.append(network)
        return network

    def _overhear(self, key: str, data: bytes) -> None:
        if "/near/" in key and f"/{LIAR}/" not in key:
            self.heard.append((key, data))

    def _lie(self) -> None:
        for key, data in self._lies(self):
            self.networks[0].lie(key, data)
        if self.fleet.world.alive:
            self.fleet.at(self.now_s + EVERY_S, self._lie)

    @property
    def now_s(self) -> float:
        return self.fleet.world.queue.now_s()

    def motion(self, uav: str) -> tuple[Point, Point]:
        """Where that UAV truly is, and by how much it has moved since the last lie."""
        east, north, up = self.fleet.vehicles[uav].pilot().position_enu_m(self.now_s)
        before = self._places.get(uav, (east, north, up))
        self._places[uav] = east, north, up
        return (east, north, up), (east - before[0], north - before[1], up - before[2])

    def word(
        self,
        place: Point,
        velocity: Point = STILL,
        way: tuple[Point, ...] = (),
        speed_m_s: float = 8.0,
        *,
        airborne: bool = True,
        of: str = LIAR,
    ) -> Message:
        """One of the liar's, newer than all that its own agent says."""
        zero_s = self.fleet.world.zero_s
        said_s = None if zero_s is None else self.now_s - zero_s
        body = Nearby((0, 0), airborne, place, velocity, way, speed_m_s, 0, 0, 0, said_s)
        return Message(MISSION.name, of, Stamp(1_000_000, 10**6 + next(self._number)), body)

    def signed(self, said: Message) -> tuple[str, bytes]:
        """With the liar's own keys."""
        return said.key, self.keys.seal(LIAR).wrap(encode(said))

    def fly(self) -> None:
        """The two honest ones come through, and never near each other."""
        self.fleet.world.run(900.0)
        told = "\n".join(self.fleet.told())
        done = self.fleet.world.mission_state.result().done
        assert {"t0", "t1"} <= set(done), told
        assert not set(HONEST) & set(self.fleet.world.alive), told
        # These vehicles turn and stop in no time, more suddenly than is counted on.
        assert self.fleet.nearest_m >= SEPARATION_M - 1.0, self.fleet.nearest


def standing(fleet: LiedTo) -> Iterator[tuple[str, bytes]]:
    """In the middle of both ways."""
    yield fleet.signed(fleet.word((0.0, 0.0, UP_M)))


def jumping(fleet: LiedTo) -> Iterator[tuple[str, bytes]]:
    """Right before either of the two in turn."""
    (east, north, up), _ = fleet.motion(HONEST[int(fleet.now_s * 4.0) % 2])
    yield fleet.signed(fleet.word((east + 4.0, north + 4.0, up)))


def staying_before(fleet: LiedTo) -> Iterator[tuple[str, bytes]]:
    """Before one of them wherever that turns to; it says in between that it has landed."""
    (east, north, up), moved_m = fleet.motion("u0")
    far_m = math.hypot(*moved_m)
    ahead = tuple(each / far_m for each in moved_m) if far_m > 0.1 else (1.0, 0.0, 0.0)
    place = (east + 11.0 * ahead[0], north + 11.0 * ahead[1], up + 11.0 * ahead[2])
    yield fleet.signed(fleet.word(place, airborne=int(fleet.now_s) % 20 != 0))


def boundless(fleet: LiedTo) -> Iterator[tuple[str, bytes]]:
    """At a million metres a second, up and down as far as can be said, at a place below ground."""
    (east, north, up), _ = fleet.motion("u0")
    sign = 1.0 if int(fleet.now_s) % 2 else -1.0
    way = ((east + 12.0, north, sign * FAR),)
    yield fleet.signed(fleet.word((east + 12.0, north, up), (0.0, 0.0, sign * FAR), way, FAST))
    yield fleet.signed(fleet.word((east, north, -FAR), (-FAR, FAR, FAR), (way[0],) * 4, FAST))


def of_others(fleet: LiedTo) -> Iterator[tuple[str, bytes]]:
    """About the other two, signed by itself, not at all, or as they said it long ago."""
    for uav in HONEST:
        said = fleet.word((0.0, 0.0, UP_M), of=uav)
        yield fleet.signed(said)
        yield said.key, encode(said)
    for key, data in fleet.heard[:6]:
        yield key, data
        yield f"{key.rpartition('/')[0]}/7", data


@pytest.mark.parametrize(
    ("kind", "lies"),
    [
        pytest.param(KINDS[0], standing, id="standing", marks=pytest.mark.slow),
        pytest.param(KINDS[1], jumping, id="jumping"),
        pytest.param(KINDS[2], staying_before, id="staying before", marks=pytest.mark.slow),
        pytest.param(KINDS[3], boundless, id="boundless"),
    ],
)
def test_who_is_lied_to_by_one_with_keys_meets_nobody_and_goes_on(
    kind: tuple[FirmwareModelName, CommandStyle],
    lies: Callable[[LiedTo], Iterator[tuple[str, bytes]]],
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    lied_to = LiedTo(monkeypatch, kind, lies)

    lied_to.fly()

    assert lied_to.networks[0].ear.dropped == {}, "it says what it may say"
    assert any(lied_to.fleet.made_room(uav) for uav in HONEST)


def test_nobody_is_told_anything_about_another(monkeypatch: pytest.MonkeyPatch) -> None:
    lied_to = LiedTo(monkeypatch, KINDS[0], of_others)

    lied_to.fly()

    dropped = lied_to.networks[0].ear.dropped
    assert dropped.keys() == {"not the signer's to say", "not signed", "said on another's key"}
    assert lied_to.fleet.world.mission_state.result().lost_uavs == ()
