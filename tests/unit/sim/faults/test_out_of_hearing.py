"""Since when two UAVs could not hear each other, and until when."""

from __future__ import annotations

from types import SimpleNamespace
from typing import cast

import pytest

from sim.faults.out_of_hearing import LOOK_EVERY_S, OutOfHearing
from sim.world.engine import EventQueue
from sim.world.rough_network import RoughNetwork
from sim.world.virtual_world import World

SETTLES_S = 5.0


def cut_between(*spans_s: tuple[float, float]) -> OutOfHearing:
    """``u0`` has been cut off from the others at these times of 60 s."""
    queue, uavs = EventQueue(), ("u0", "u1", "u2")

    def joined(one: str, other: str) -> bool:
        cut = any(begin_s <= queue.now_s() < end_s for begin_s, end_s in spans_s)
        return not (cut and "u0" in (one, other))

    world = SimpleNamespace(queue=queue, agents=uavs, processes={uav: uav for uav in uavs})
    network = SimpleNamespace(joined=joined)
    hearing = OutOfHearing(cast("World", world), cast("RoughNetwork", network), SETTLES_S)

    def look() -> None:
        hearing.look()
        queue.after(LOOK_EVERY_S, look)

    queue.after(LOOK_EVERY_S, look)
    queue.run(60.0)
    return hearing


@pytest.mark.parametrize(
    ("since_s", "until_s", "is_unheard"),
    [
        pytest.param(20.0, 30.0, True, id="all along"),
        pytest.param(20.0, 40.0 + SETTLES_S - 1.0, True, id="just now"),
        pytest.param(20.0, 40.0 + SETTLES_S + 1.0, False, id="later"),
        pytest.param(8.0, 30.0, False, id="said before"),
    ],
)
def test_what_was_said_to_nobody_is_unknown_until_all_are_heard_again(
    since_s: float, until_s: float, is_unheard: bool
) -> None:
    hearing = cut_between((10.0, 40.0))

    assert hearing.all_along("u0", "u1", since_s, until_s) is is_unheard
    assert hearing.all_along("u2", "u0", since_s, until_s) is is_unheard
    assert not hearing.all_along("u1", "u2", since_s, until_s)


def test_who_was_heard_in_between_is_known() -> None:
    hearing = cut_between((10.0, 20.0), (30.0, 40.0))

    assert not hearing.all_along("u0", "u1", 15.0, 35.0)
    assert hearing.all_along("u0", "u1", 32.0, 35.0)
