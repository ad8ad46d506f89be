"""Joins a bridge and a fake vehicle in virtual time, over a link that tests may spoil."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from agent.core.interface import (
    Caution,
    GoTo,
    Held,
    MotorsRun,
    NotReady,
    Prepare,
    ReturnBegun,
    Telemetry,
    VehicleOrder,
    VehicleReady,
    VehicleReport,
)
from agent.vehicle.bridge import Bridge
from agent.vehicle.config import BridgeConfig
from agent.vehicle.conversation import SendBytes
from agent.vehicle.session import BridgeEvent, BytesReceived, LinkOpened, TimePassed
from agent.vehicle.signing import Signing, SigningKey
from swarm.model import Zone, ZoneId
from swarm.model.frames import Origin
from tests.support.fake_copter import FakeCopter

ORIGIN = Origin(47.397742, 8.545594, 488.0)
START = Prepare((5.0, 0.0, 10.0), 4.0)
WALL = Zone(ZoneId("wall"), ((20.0, -40.0), (30.0, -40.0), (30.0, 30.0), (20.0, 30.0)))
BEHIND = (50.0, 0.0, 10.0)
"""As seen from there, beyond the wall."""
ROUND = ((17.0, 35.0, 10.0), (33.0, 35.0, 10.0))
"""Corners of the way there."""
STEP_S = 0.05
"""Of virtual time; twice for every position that the vehicle reports."""
RATE_HZ = 10.0
"""At which it does, as in flights."""
UNIX_S = 1_420_170_400.0
"""Wall time at the beginning, a day into 2015: signatures count from there."""

Spoil = Callable[[bytes], list[bytes]]


def untouched(data: bytes) -> list[bytes]:
    return [data]


def rough_link(seed: int) -> Spoil:
    """Loses a fifth of all messages and doubles a tenth."""
    chance = np.random.default_rng(seed)

    def spoil(data: bytes) -> list[bytes]:
        return [data] * int(chance.choice([0, 1, 2], p=[0.2, 0.7, 0.1]))

    return spoil


class BridgeFlight:
    """A bridge, its vehicle and the time between them."""

    def __init__(
        self,
        copter: FakeCopter | None = None,
        config: BridgeConfig | None = None,
        *,
        key: SigningKey | None = None,
        to_vehicle: Spoil = untouched,
        to_bridge: Spoil = untouched,
    ) -> None:
        self.copter = copter or FakeCopter(ORIGIN)
        signing = None if key is None else Signing(key, lambda: UNIX_S + self.now_s)
        self.bridge = Bridge(config or BridgeConfig(1, ORIGIN, position_rate_hz=RATE_HZ), signing)
        self.to_vehicle = to_vehicle
        self.to_bridge = to_bridge
        if self.copter.now_s == 0.0:
            self.copter.now_s = 100.0  # the bridge's clock has another zero than the vehicle's
            self.copter.power_on(100.0)
        self.now_s = self.copter.now_s
        self.reports: list[VehicleReport] = []
        """All but telemetry, cautions, motors and what was seen, in order."""
        self.seen: list[VehicleReport] = []
        """What was seen of the effect of orders, in order."""
        self.motors: list[bool] = []
        """Whether its motors were said to run on our order, in order."""
        self.cautions: list[str] = []
        """What people are told of the vehicle, in order."""
        self._read = 0
        self.telemetry: list[Telemetry] = []
        self.happen(LinkOpened())

    def happen(self, event: BridgeEvent) -> list[VehicleReport]:
        """Step the bridge and carry what it says; gives the reports of this very step."""
        reports: list[VehicleReport] = []
        answers: list[bytes] = []
        for action in self.bridge.step(event, self.now_s):
            if isinstance(action, SendBytes):
                for data in self.to_vehicle(action.data):
                    answers += self.copter.receive(data, self.now_s)
            else:
                reports.append(action)
        self.telemetry += [r for r in reports if isinstance(r, Telemetry)]
        self.cautions += [r.reason for r in reports if isinstance(r, Caution)]
        self.seen += [r for r in reports if isinstance(r, Held | ReturnBegun)]
        self.motors += [r.ours for r in reports if isinstance(r, MotorsRun)]
        aside = Telemetry | Caution | Held | ReturnBegun | MotorsRun
        self.reports += [r for r in reports if not isinstance(r, aside)]
        self._carry(answers)
        return reports

    def order(self, order: VehicleOrder) -> list[VehicleReport]:
        return self.happen(order)

    def spoken(self, data: bytes) -> None:
        """Something else on the link says that to the bridge."""
        self.happen(BytesReceived(data))

    def _carry(self, answers: list[bytes]) -> None:
        for answer in answers:
            for data in self.to_bridge(answer):
                self.happen(BytesReceived(data))

    def step(self) -> None:
        """One small step of time."""
        self.now_s += STEP_S
        self._carry(self.copter.advance(self.now_s))
        if self.now_s >= self.bridge.next_deadline_s():
            self.happen(TimePassed())

    def run(self, duration_s: float) -> None:
        for _ in range(round(duration_s / STEP_S)):
            self.step()

    def run_until(self, *wanted: VehicleReport | type, limit_s: float = 60.0) -> VehicleReport:
        """Fly until an unread report of that value or type comes; gives it."""
        for _ in range(round(limit_s / STEP_S)):
            while self._read < len(self.reports):
                report = self.reports[self._read]
                self._read += 1
                for w in wanted:
                    if report == w or (isinstance(w, type) and isinstance(report, w)):
                        return report
            self.step()
        raise AssertionError(f"no {wanted} within {limit_s} s, only {self.reports}")

    def prepared(self) -> BridgeFlight:
        """The same, hovering at its start."""
        self.order(START)
        self.run_until(VehicleReady())
        self.reports.clear()
        self._read = 0
        return self

    def flying(self, leg: int = 1, east_m: float = 100.0) -> BridgeFlight:
        """The same, a second on its way to a far place."""
        self.prepared()
        self.order(GoTo(leg, (east_m, 0.0, 10.0)))
        self.run(1.0)
        return self

    def restart(self, down_s: float = 2.0) -> BridgeFlight:
        """The same with a new bridge; the old one died earlier, and the vehicle flew on."""
        end_s = self.now_s + down_s
        while self.now_s < end_s:
            self.now_s += STEP_S
            self.copter.advance(self.now_s)
        self.bridge = Bridge(self.bridge.config)
        self.reports.clear()
        self._read = 0
        self.happen(LinkOpened())
        return self

    def reasons(self) -> list[str]:
        """What the vehicle was waited for."""
        return [r.reason for r in self.reports if isinstance(r, NotReady)]
