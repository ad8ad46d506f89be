"""Where an agent says that its UAV is: at the instant at which it says so, at its true height."""

from __future__ import annotations

import pytest

from agent.core.interface import Telemetry
from agent.core.mission_view import CARRIED_S, MissionView
from swarm.model.ids import COORDINATOR
from swarm.protocol.registers import Replica
from swarm.protocol.uav_messages import Status, StatusPhase
from tests.support.builders import MISSION, brief, message, uav

LAYER_M = 10.0


def view() -> MissionView:
    replica = Replica()
    seen = MissionView(MISSION, "u0", replica)
    seen.take_in(message(COORDINATOR, brief(uav("u0"))))
    return seen


def flown_m(seen: MissionView) -> tuple[float, float, float] | None:
    """Where an observer takes it to be."""
    said = Status(
        StatusPhase.FLYING, None, seen.carried_enu_m, None, None, 1.0, {}, "", seen.told_layer_m
    )
    return said.flown_enu_m(LAYER_M)


def test_a_place_is_carried_on_to_the_instant_at_which_it_is_told() -> None:
    seen = view()
    assert seen.carried_enu_m is None
    seen.now_s = 10.0
    seen.move(Telemetry((1.0, 2.0, 20.0), (8.0, 0.0, -1.0), None))
    assert flown_m(seen) == (1.0, 2.0, 20.0)
    seen.now_s = 10.25
    assert flown_m(seen) == pytest.approx((3.0, 2.0, 19.75))
    assert seen.place_enu_m == (1.0, 2.0, 20.0 - LAYER_M)  # by which it decides
    seen.now_s = 10.0 + 5.0 * CARRIED_S  # nothing has been heard of it
    assert flown_m(seen) == pytest.approx((9.0, 2.0, 19.0))


def test_the_height_is_true_in_the_layer_out_of_it_and_on_the_ground() -> None:
    seen = view()
    seen.move(Telemetry((0.0, 0.0, 20.0), (0.0, 0.0, 0.0), None))
    assert (flown_m(seen), seen.told_layer_m) == ((0.0, 0.0, 20.0), None)
    seen.arrive((0.0, 0.0, 60.0), own_height=True)
    assert (flown_m(seen), seen.told_layer_m) == ((0.0, 0.0, 60.0), 0.0)
    assert (seen.place_enu_m, seen.flown_m) == ((0.0, 0.0, 60.0), 60.0)
    seen.set_off()
    assert flown_m(seen) == (0.0, 0.0, 60.0)
    # What is reckoned from there before the next word of the vehicle has its height right.
    assert (seen.place_enu_m, seen.flown_m) == ((0.0, 0.0, 60.0 - LAYER_M), None)
    seen.move(Telemetry((5.0, 0.0, 58.0), (0.0, 0.0, 0.0), None))
    assert (flown_m(seen), seen.told_layer_m) == ((5.0, 0.0, 58.0), None)
    seen.stand((9.0, 0.0, 0.0))
    assert flown_m(seen) == (9.0, 0.0, 0.0)
    seen.leave_ground()
    assert flown_m(seen) == (9.0, 0.0, 0.0)


def test_before_the_layer_is_known_no_place_is_told() -> None:
    seen = MissionView(MISSION, "u0", Replica())
    seen.move(Telemetry((1.0, 2.0, 0.0), (0.0, 0.0, 0.0), None))
    assert flown_m(seen) is None
