"""Some of the episodes of `make fuzz`, and that they would notice something."""

from __future__ import annotations

import math
from dataclasses import replace

import pytest
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from agent.core.interface import Arrived, HandedOver, Hold, Refused, VehicleReady
from agent.vehicle.activity import FlightPhase
from agent.vehicle.bridge import Bridge
from agent.vehicle.config import BridgeConfig
from agent.vehicle.conversation import BridgeAction, SendBytes
from agent.vehicle.messages import (
    AltitudeFrame,
    CommandInt,
    CommandLong,
    GroundHeartbeat,
    MissionCount,
    Outbound,
    ParameterSet,
)
from agent.vehicle.session import BridgeEvent, LinkOpened, TimePassed
from tests.support.bridge_flight import ORIGIN, START, BridgeFlight
from tests.support.bridge_fuzz import Episode, Setting, setting_of, settings
from tests.support.bridge_watch import BridgeWatch
from tests.support.broken_rule import BrokenError
from tests.support.fake_copter import ARM, REPOSITION, FakeCopter
from tests.support.hostile_input import FLAVOURS
from tests.support.mavlink_frames import frame

EVERY_SETTING = [setting for flavour in FLAVOURS for setting in settings(flavour)]


@pytest.mark.parametrize("setting", EVERY_SETTING, ids=str)
@pytest.mark.parametrize("number", range(2))
def test_everything_holds_whatever_is_heard(setting: Setting, number: int) -> None:
    assert Episode(setting, 0, number).play() > 400


def test_an_episode_is_the_same_every_time() -> None:
    stories = []
    for _ in range(2):
        episode = Episode(EVERY_SETTING[0], 0, 3)
        episode.play(100)
        stories.append((episode.watch.steps, episode.now_s, episode.story))
    assert stories[0] == stories[1]


def test_a_home_that_cannot_be_ends_the_preparation_before_the_motors_start() -> None:
    flight = BridgeFlight()
    flight.copter.home_m = (0.0, 0.0, -5000.0)
    flight.order(START)
    flight.run_until(Refused(START, "the start lies 5010 m above the vehicle's home"))
    assert not flight.copter.commands(ARM)


def test_a_heartbeat_of_another_kind_of_vehicle_does_not_make_a_flying_one_deaf() -> None:
    flight = BridgeFlight().flying()
    flight.spoken(frame(mavlink.MAVLink_heartbeat_message(1, 12, 209, 4, 4, 3)))
    flight.copter.heard.clear()
    flight.order(Hold("wait"))
    assert len(flight.copter.commands(REPOSITION)) == 1
    assert flight.bridge.strange_heartbeats == 1


def test_settings_are_found_by_their_names() -> None:
    assert [setting_of(str(setting)) for setting in EVERY_SETTING] == EVERY_SETTING


CONFIG = BridgeConfig(1, ORIGIN)
ZEROS = (0.0, 0.0, 0.0, 0.0, 0.0)
LAND = CommandLong(21, (0.0, 0.0, *ZEROS))
FORCED = CommandLong(400, (1.0, 21196.0, *ZEROS))
ENDLESS_CLIMB = CommandLong(22, (0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1e6))
NO_HEIGHT = CommandLong(22, (0.0, 0.0, 0.0, 0.0, 0.0, 0.0, math.nan))
ARMING = CommandLong(400, (1.0, 0.0, *ZEROS))
ELSEWHERE = CommandInt(192, AltitudeFrame.MEAN_SEA_LEVEL, (-1.0, 0.0, 0.0, 0.0), 47.4, 8.5, 500.0)


def encoded(message: Outbound, config: BridgeConfig = CONFIG) -> bytes:
    return Bridge(config).codec.encode(message)


class Misled(Bridge):
    """A bridge that does one thing, whatever happens to it."""

    def __init__(self, phase: FlightPhase, action: BridgeAction) -> None:
        super().__init__(CONFIG)
        self._phase = self.next_phase = phase
        self._action = action

    @property
    def phase(self) -> FlightPhase:
        return self._phase

    def step(self, event: BridgeEvent, now_s: float) -> list[BridgeAction]:
        super().step(event, now_s)
        self._phase = self.next_phase
        return [self._action]


@pytest.mark.parametrize(
    ("phase", "action", "complaint"),
    [
        (FlightPhase.PREPARING, SendBytes(encoded(LAND)), "commands 21 while"),
        (FlightPhase.PREPARING, SendBytes(encoded(FORCED)), "motors by force"),
        (FlightPhase.PREPARING, SendBytes(encoded(ENDLESS_CLIMB)), "takeoff by 1000000.0 m"),
        (FlightPhase.PREPARING, SendBytes(encoded(NO_HEIGHT)), "takeoff by nan m"),
        (FlightPhase.HOVERING, SendBytes(encoded(ARMING)), "commands 400 while"),
        (FlightPhase.IDLE, SendBytes(encoded(ARMING)), "motors started while"),
        (FlightPhase.HANDED_OVER, SendBytes(encoded(ELSEWHERE)), "commands 192 while"),
        (FlightPhase.FLYING, SendBytes(encoded(ELSEWHERE)), "sent to .*, not to"),
        (FlightPhase.FLYING, SendBytes(encoded(ParameterSet("WP_SPD", 4.0))), "PARAM_SET while"),
        (FlightPhase.FLYING, SendBytes(encoded(MissionCount(3))), "MISSION_COUNT, though"),
        (
            FlightPhase.FLYING,
            SendBytes(encoded(ELSEWHERE, replace(CONFIG, system_id=2))),
            r"to \(2, 1\)",
        ),
        (FlightPhase.FLYING, SendBytes(encoded(ELSEWHERE)[:-5]), "sent 0 messages as one"),
        (FlightPhase.FLYING, SendBytes(2 * encoded(GroundHeartbeat())), "sent 2 messages as one"),
        (FlightPhase.FLYING, Arrived(7), "arrived on leg 7, under way is None"),
        (FlightPhase.IDLE, VehicleReady(), "ready, though nobody asked"),
    ],
)
def test_what_must_not_be_is_noticed(
    phase: FlightPhase, action: BridgeAction, complaint: str
) -> None:
    with pytest.raises(BrokenError, match=complaint):
        BridgeWatch(Misled(phase, action), FakeCopter).step(LinkOpened(), 0.0)


def test_an_activity_that_must_not_follow_is_noticed() -> None:
    bridge = Misled(FlightPhase.HANDED_OVER, SendBytes(encoded(GroundHeartbeat())))
    watch = BridgeWatch(bridge, FakeCopter)
    watch.step(LinkOpened(), 0.0)
    bridge.next_phase = FlightPhase.FLYING
    with pytest.raises(BrokenError, match="flying follows handed over"):
        watch.step(TimePassed(), 0.1)


def test_a_word_after_a_hand_over_is_noticed() -> None:
    bridge = Misled(FlightPhase.FLYING, HandedOver("a pilot"))
    watch = BridgeWatch(bridge, FakeCopter)
    watch.step(LinkOpened(), 0.0)
    with pytest.raises(BrokenError, match="handed over twice"):
        watch.step(TimePassed(), 0.1)
    bridge._action = SendBytes(encoded(ELSEWHERE))
    with pytest.raises(BrokenError, match="COMMAND_INT after a hand-over"):
        watch.step(TimePassed(), 0.2)


class Restless(Bridge):
    """A bridge that never has enough."""

    def next_deadline_s(self) -> float:
        return 0.0


def test_a_deadline_that_never_passes_is_noticed() -> None:
    with pytest.raises(BrokenError, match="for ever"):
        BridgeWatch(Restless(CONFIG), FakeCopter).step(LinkOpened(), 10.0)
