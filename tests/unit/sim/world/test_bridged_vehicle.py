"""The real bridge and a simulated autopilot on one link, in a queue's time."""

from __future__ import annotations

import pytest

from agent.core.interface import (
    Arrived,
    GoTo,
    HandedOver,
    Home,
    Prepare,
    Return,
    Telemetry,
    VehicleReady,
    VehicleReport,
)
from agent.vehicle.bridge import Bridge
from agent.vehicle.config import BridgeConfig
from agent.vehicle.conversation import BridgeAction, SendBytes
from agent.vehicle.session import BridgeEvent
from sim.autopilot.config import VehicleConfig
from sim.world.bridged_vehicle import BridgedVehicle, Equipment, LinkQuality
from sim.world.engine import EventQueue
from swarm.model.frames import DEFAULT_ORIGIN

PREPARE = Prepare((0.0, 0.0, 10.0), 10.0)


class Flight:
    """A vehicle and what its agent would hear of it."""

    def __init__(self, link: LinkQuality | None = None, seed: int = 0) -> None:
        self.queue = EventQueue()
        self.heard: list[tuple[float, VehicleReport]] = []
        self.sent: list[bytes] = []
        self.bridges = 0
        self.vehicle = BridgedVehicle(
            self.queue,
            "u0",
            lambda report: self.heard.append((self.queue.now_s(), report)),
            Equipment(
                VehicleConfig(1), BridgeConfig(1, DEFAULT_ORIGIN), link=link or LinkQuality()
            ),
            seed,
            self._bridge,
        )

    def _bridge(self, config: BridgeConfig) -> Bridge:
        self.bridges += 1
        sent = self.sent

        class Recorded(Bridge):
            def step(self, event: BridgeEvent, now_s: float) -> list[BridgeAction]:
                actions = super().step(event, now_s)
                sent.extend(action.data for action in actions if isinstance(action, SendBytes))
                return actions

        return Recorded(config)

    def kinds(self) -> set[type]:
        return {type(report) for _, report in self.heard}

    def prepared(self, by_s: float = 20.0) -> Flight:
        self.vehicle.order(PREPARE, VehicleReady())
        self.queue.run(by_s)
        assert VehicleReady in self.kinds()
        return self


def test_boot_preparation_and_takeoff_take_their_time() -> None:
    flight = Flight().prepared()
    ready_s = next(at_s for at_s, report in flight.heard if report == VehicleReady())

    assert 3.0 + 10.0 / 2.5 < ready_s < 12.0
    assert flight.vehicle.pilot().armed


def test_without_a_bridge_there_is_nothing_to_bring_home() -> None:
    flight = Flight()
    flight.vehicle.order(Return("over"), VehicleReady())

    assert flight.queue.run(10.0), "nothing goes on by itself"
    assert flight.heard == [(0.0, Home())]
    assert (flight.bridges, flight.sent) == (0, [])


def test_it_flies_on_without_its_agent_and_the_next_one_makes_another_bridge() -> None:
    flight = Flight().prepared()
    flight.vehicle.order(GoTo(1, (100.0, 0.0, 10.0)), VehicleReady())
    flight.queue.run(22.0)
    flight.vehicle.leave()
    flight.heard.clear()
    flight.sent.clear()

    assert flight.queue.run(40.0), "what was under way has come to its end"
    assert (flight.heard, flight.sent) == ([], [])
    assert flight.vehicle.pilot(10.0).position_enu_m(50.0)[0] == pytest.approx(100.0, abs=0.1)

    flight.queue.at(50.0, lambda: flight.vehicle.order(PREPARE, VehicleReady()))
    flight.queue.run(80.0)
    assert flight.bridges == 2
    assert VehicleReady in flight.kinds()


@pytest.mark.parametrize(("silent_s", "lost"), [(3.0, False), (8.0, True)])
def test_a_cut_link_lets_nothing_through_until_it_is_over(silent_s: float, *, lost: bool) -> None:
    flight = Flight().prepared()
    flight.vehicle.order(GoTo(1, (100.0, 0.0, 10.0)), VehicleReady())
    flight.queue.run(20.01)  # nothing is under way
    flight.vehicle.cut(silent_s)
    flight.heard.clear()
    flight.queue.run(20.0 + silent_s - 0.1)
    assert Telemetry not in flight.kinds()
    assert (HandedOver in flight.kinds()) is lost

    flight.queue.run(45.0)
    assert (Arrived in flight.kinds()) is not lost


def test_what_is_lost_follows_from_the_seed() -> None:
    poor = LinkQuality(0.05, 0.3)
    one, same, other = (Flight(poor, seed).prepared(by_s=30.0) for seed in (1, 1, 2))

    assert (one.sent, one.heard) == (same.sent, same.heard)
    assert one.heard != other.heard


@pytest.mark.parametrize("wrong", [{"latency_s": -1.0}, {"loss_frac": 1.5}])
def test_links_out_of_range_are_refused(wrong: dict[str, float]) -> None:
    with pytest.raises(ValueError, match="must be"):
        LinkQuality(**wrong)
