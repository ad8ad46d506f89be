"""Who found no way while somebody was missing is excused, until it had the time to look again."""

from __future__ import annotations

from types import SimpleNamespace
from typing import cast

import pytest

from sim.faults.injector import FaultInjector
from sim.faults.shut_air import ShutAir
from sim.world.engine import EventQueue, Process
from sim.world.rough_network import RoughNetwork
from sim.world.virtual_world import World
from swarm.protocol.events import LogLine
from swarm.protocol.timing import Timing

U0, U1 = (cast("Process", SimpleNamespace(name=name)) for name in ("u0", "u1"))
NO_WAY, LANDS = LogLine("no way", {"task": "t0"}), LogLine("lands where it is", {"task": "t0"})
RECONSIDER_S = 30.0


class Sky:
    """One `ShutAir` in which somebody is missing, or not."""

    def __init__(self, monkeypatch: pytest.MonkeyPatch) -> None:
        self.queue = EventQueue()
        self.is_missing = True
        world = SimpleNamespace(queue=self.queue, timing=Timing(reconsider_s=RECONSIDER_S))
        unused = object()
        self.air = ShutAir(
            cast("World", world), cast("RoughNetwork", unused), cast("FaultInjector", unused)
        )
        monkeypatch.setattr(self.air, "lacks_somebody", lambda _process: self.is_missing)

    def wait(self, seconds: float) -> None:
        self.queue.after(seconds, lambda: None)
        self.queue.run(self.queue.now_s() + seconds)


@pytest.fixture
def sky(monkeypatch: pytest.MonkeyPatch) -> Sky:
    return Sky(monkeypatch)


def test_who_finds_no_way_while_somebody_is_missing_is_kept_from_that_task(sky: Sky) -> None:
    sky.air.noted(U0, NO_WAY)

    assert sky.air.keeps_from("u0", "t0")
    assert not sky.air.keeps_from("u0", "t1")
    assert not sky.air.keeps_from("u1", "t0")
    sky.wait(5.0)
    sky.air.left(U0)
    assert sky.air.keeps_from("u0", "t0")


def test_nobody_is_excused_while_all_are_heard(sky: Sky) -> None:
    sky.is_missing = False
    sky.air.noted(U0, NO_WAY)
    sky.air.noted(U1, LANDS)

    assert not sky.air.keeps_from("u0", "t0")
    assert sky.air.landed == set()


def test_who_had_the_time_to_look_again_is_excused_no_more(sky: Sky) -> None:
    sky.air.noted(U0, NO_WAY)
    sky.air.noted(U1, NO_WAY)
    sky.wait(100.0)
    sky.air.look(U0)
    sky.is_missing = False
    sky.wait(RECONSIDER_S)
    sky.air.left(U0)
    sky.air.left(U1)

    assert sky.air.keeps_from("u0", "t0")
    assert not sky.air.keeps_from("u1", "t0")
    sky.wait(10.0)
    sky.air.left(U0)
    assert not sky.air.keeps_from("u0", "t0")


def test_who_lands_for_want_of_a_way_while_somebody_is_missing_is_told(sky: Sky) -> None:
    sky.air.noted(U0, LANDS)

    assert sky.air.landed == {"u0"}
    assert not sky.air.keeps_from("u0", "t0")
