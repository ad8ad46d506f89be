"""A way that is wished, and the one that is flown."""

from __future__ import annotations

import pytest

from swarm.protocol.fields import Point
from swarm.protocol.uav_messages import ClaimedWay
from swarm.separation.shifted import continued

FLOWN = ClaimedWay(
    1, ((0.0, 0.0, 30.0), (0.0, 0.0, 40.0), (50.0, 0.0, 40.0)), shift_m=10.0, flies=True
)
HERE = (20.0, 0.0, 40.0)
"""On it, in a layer 10 m higher than the own one."""
BEGINS, ENDS, ON = (20.0, 0.0, 30.0), (50.0, 0.0, 30.0), (50.0, 60.0, 30.0)


def test_what_goes_on_where_a_way_ends_begins_there() -> None:
    assert continued(FLOWN, HERE, (BEGINS, ENDS, ON, BEGINS)) == (ENDS, ON, BEGINS)
    assert continued(FLOWN, HERE, (BEGINS, ENDS)) == (ENDS,)
    assert continued(FLOWN, HERE, (BEGINS, (60.0, 0.0, 30.0), ON)) == (ENDS, (60.0, 0.0, 30.0), ON)


@pytest.mark.parametrize(
    "wished",
    [
        pytest.param((BEGINS, ON), id="past its end"),
        pytest.param((BEGINS, (40.0, 0.0, 30.0), ON), id="from before its end"),
        pytest.param((BEGINS, (60.0, 1.0, 30.0), ON), id="beside its end"),
        pytest.param((BEGINS, (50.0, 0.0, 32.0), ON), id="in another layer"),
        pytest.param((BEGINS,), id="from here"),
    ],
)
def test_any_other_way_does_not_go_on_with_it(wished: tuple[Point, ...]) -> None:
    assert continued(FLOWN, HERE, wished) is None


def test_who_is_beside_its_way_is_not_on_it() -> None:
    beside = (20.0, 6.0, 40.0)
    assert continued(FLOWN, beside, ((20.0, 6.0, 30.0), ENDS, ON)) is None
