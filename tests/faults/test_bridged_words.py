"""How often UAVs behind real bridges say where they are: as it matters to those near them."""

from __future__ import annotations

from collections import defaultdict
from itertools import pairwise

import pytest

from agent.core.interface import GoTo
from agent.vehicle.config import CommandStyle
from sim.autopilot.firmware import FirmwareModelName
from sim.world.engine import Process
from swarm.protocol.events import LogLine
from swarm.protocol.messages import Message
from swarm.protocol.uav_messages import Nearby
from swarm.separation.tactical import TacticalResolver
from swarm.separation.tactical_advice import Advice, OwnFlight
from swarm.separation.tactical_traffic import SILENT_S, TrafficPicture
from tests.support.bridged_crossings import CrossingFleet, mission_of

KIND = (FirmwareModelName.ARDUPILOT, CommandStyle.REPOSITION)


class Words:
    """What a fleet's UAVs said of where they are; a `WorldListener`."""

    def __init__(self) -> None:
        self.of: dict[str, list[tuple[float, Nearby]]] = defaultdict(list)
        """By UAV, in order, each with when it was said [s]."""
        self.fleet: CrossingFleet | None = None

    def count(self, uav: str, since_s: float, until_s: float) -> int:
        """How many within that time."""
        return sum(since_s <= at_s < until_s for at_s, _ in self.of[uav])

    def said(self, process: Process, message: Message) -> None:
        if isinstance(message.body, Nearby) and self.fleet is not None:
            self.of[process.name].append((self.fleet.world.queue.now_s(), message.body))

    def stepped(self, process: Process) -> None:
        pass

    def raised(self, process: Process, fault: Exception) -> None:
        raise fault

    def refused(self, process: Process, order: GoTo) -> None:
        pass

    def noted(self, process: Process, note: LogLine) -> None:
        pass


def flown(
    monkeypatch: pytest.MonkeyPatch, *ways: tuple[tuple[float, float], tuple[float, float]]
) -> Words:
    words, mission = Words(), mission_of(*ways, band_m=(20.0, 60.0))
    words.fleet = CrossingFleet(monkeypatch, *KIND, mission, planned=True, watch=words)
    words.fleet.fly(300.0)
    words.fleet.assert_all_done()
    return words


def test_who_climbs_beside_others_speaks_once_a_second(monkeypatch: pytest.MonkeyPatch) -> None:
    """Four starts in a row, 14 m apart: nobody can give way, so nobody has to know at once."""
    row = flown(monkeypatch, *(((14.0 * n, 0.0), (14.0 * n, 40.0)) for n in range(4)))

    for uav in ("u0", "u1", "u2", "u3"):
        leaves_s = next(at_s for at_s, word in row.of[uav] if word.position_enu_m[2] > 1.0)
        climbs_s = leaves_s + SILENT_S + 0.5  # until then it may not have been heard
        assert 2 <= row.count(uav, climbs_s, climbs_s + 3.0) <= 4, row.of[uav]


def test_who_comes_near_another_one_speaks_four_times_as_often(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr("agent.core.fleet_air.air_of_brief", lambda _brief: None)
    words = flown(monkeypatch, ((-80.0, 0.0), (80.0, 3.0)), ((80.0, 3.0), (-80.0, 0.0)))

    for uav in ("u0", "u1"):
        busiest = max(words.count(uav, float(at_s), at_s + 4.0) for at_s in range(10, 60))
        assert 14 <= busiest <= 17, words.of[uav]


def test_who_stands_on_the_ground_for_long_says_so_every_ten_seconds(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """As the last of five does that start side by side, one after the other."""
    words = flown(monkeypatch, *(((3.0 * n, 0.0), (-60.0 + 40.0 * n, 60.0)) for n in range(5)))

    def aloft_s(uav: str) -> float:
        return next(at_s for at_s, word in words.of[uav] if word.airborne)

    last = max(words.of, key=aloft_s)
    waited_s = aloft_s(last) - words.of[last][0][0]
    assert waited_s > 25.0
    on_ground = sum(not word.airborne for _, word in words.of[last])
    assert 11 <= on_ground <= 13 + (waited_s - 10.0) / 10.0, words.of[last]


def test_a_turn_is_said_each_tick_until_it_has_surely_been_heard(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """Of one that nobody is near."""
    words = flown(monkeypatch, ((0.0, 0.0), (90.0, 0.0)), ((0.0, 400.0), (90.0, 400.0)))

    told = [(at_s, word.path_enu_m) for at_s, word in words.of["u0"] if word.airborne]
    turns_s = [at_s for (_, before), (at_s, path) in pairwise(told) if path != before]
    assert len(turns_s) >= 2, "to its task, and home"
    for at_s in turns_s[:2]:
        assert words.count("u0", at_s, at_s + SILENT_S) >= 11, words.of["u0"]
        assert words.count("u0", at_s + SILENT_S + 0.5, at_s + SILENT_S + 4.5) <= 5


def test_who_has_to_decide_and_to_speak_does_both_at_once(monkeypatch: pytest.MonkeyPatch) -> None:
    """Each step of its own costs as much again, and there are four of either in a second."""
    decided_s: dict[str, list[float]] = defaultdict(list)
    decide = TacticalResolver.decide

    def noted(
        self: TacticalResolver, own: OwnFlight, picture: TrafficPicture, now_s: float
    ) -> Advice:
        decided_s[self._uav].append(now_s)
        return decide(self, own, picture, now_s)

    monkeypatch.setattr(TacticalResolver, "decide", noted)
    monkeypatch.setattr("agent.core.fleet_air.air_of_brief", lambda _brief: None)
    words = flown(monkeypatch, ((-80.0, 0.0), (80.0, 3.0)), ((80.0, 3.0), (-80.0, 0.0)))

    for uav in ("u0", "u1"):
        said_s = [
            at_s for at_s, word in words.of[uav] if word.airborne and at_s >= decided_s[uav][0]
        ]
        apart = {round(at_s, 3) for at_s in (*decided_s[uav], *said_s)}
        assert len(apart) <= 1.05 * max(len(decided_s[uav]), len(said_s))
