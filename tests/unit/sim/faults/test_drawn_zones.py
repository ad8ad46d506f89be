"""Until when a UAV may be in a zone that has been drawn over it."""

from __future__ import annotations

import pytest

from sim.faults.drawn_zones import ordered_anew_s


@pytest.mark.parametrize(
    ("refused_s", "since_s"),
    [
        ([], 10.0),
        ([9.0], 10.0),  # before it knew
        ([13.0], 13.0),
        ([13.0, 17.0], 17.0),
        ([16.0], 10.0),  # had it ordered in time, it would have been refused in time
        ([13.0, 19.0], 13.0),
    ],
)
def test_a_way_out_that_a_vehicle_refuses_is_followed_by_another(
    refused_s: list[float], since_s: float
) -> None:
    assert ordered_anew_s(10.0, refused_s, 5.0) == since_s
