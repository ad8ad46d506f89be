"""A link to which anybody can send belongs to the vehicle, whoever else sends."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import pytest
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from agent.vehicle.bridge import Bridge
from agent.vehicle.codec import MavlinkCodec
from agent.vehicle.config import BridgeConfig
from agent.vehicle.messages import DecodedMessage, Heartbeat
from agent.vehicle.session import BytesReceived, LinkOpened, TimePassed
from agent.vehicle.signing import Signing, SigningKey
from tests.support.bridge_flight import ORIGIN, UNIX_S

KEY = SigningKey(bytes(range(32)))
HERE, ELSEWHERE, STRANGER = ("10.0.0.1", 14550), ("10.0.0.1", 30001), ("6.6.6.6", 6666)
HEARTBEAT = mavlink.MAVLink_heartbeat_message(2, 3, 81, 0, 3, 3)
RADIO_STATUS = mavlink.MAVLink_radio_status_message(200, 200, 90, 50, 50, 0, 0)


class Speaker:
    """Frames of one component, signed if it has a key."""

    def __init__(self, system_id: int = 1, component_id: int = 1, key: bytes | None = None) -> None:
        self._mav = mavlink.MAVLink(None, srcSystem=system_id, srcComponent=component_id)
        if key is not None:
            self._mav.signing.secret_key = key
            self._mav.signing.sign_outgoing = True
            self._mav.signing.timestamp = round((UNIX_S - 1_420_070_400.0) * 1e5)

    def say(self, message: Any = HEARTBEAT) -> bytes:
        frame = bytes(message.pack(self._mav))
        self._mav.seq = (self._mav.seq + 1) % 256
        return frame


class Ear:
    """A codec of a listening link, and the time."""

    def __init__(self, *, signed: bool = False) -> None:
        signing = Signing(KEY, lambda: UNIX_S) if signed else None
        self.codec = MavlinkCodec(1, signing=signing)
        self.now_s = 1000.0

    def hear(self, data: bytes, source: tuple[str, int]) -> list[DecodedMessage]:
        return self.codec.decode(data, source, self.now_s)


def vehicle(*, signed: bool) -> Speaker:
    return Speaker(key=KEY.secret if signed else None)


def hears_vehicle(heard: list[DecodedMessage]) -> bool:
    return any(each.system_id == 1 and isinstance(each.message, Heartbeat) for each in heard)


@pytest.fixture(params=[False, True], ids=["unsigned", "signed"])
def signed(request: pytest.FixtureRequest) -> bool:
    """Whether the link has a key."""
    return bool(request.param)


def junk() -> bytes:
    return b"\xfd"


def other_vehicle() -> bytes:
    return Speaker(system_id=7).say()


def other_component() -> bytes:
    return Speaker(component_id=100).say()


def half_a_frame() -> bytes:
    return Speaker().say()[:-3]


NO_PROOF = [junk, other_vehicle, other_component, half_a_frame]


@pytest.mark.parametrize("noise", NO_PROOF)
def test_nobody_takes_the_link_without_a_frame_of_the_vehicle(
    noise: Callable[[], bytes], *, signed: bool
) -> None:
    ear, uav = Ear(signed=signed), vehicle(signed=signed)
    for _ in range(10):
        ear.hear(noise(), STRANGER)
        ear.now_s += 0.5

    assert ear.codec.peer is None
    assert hears_vehicle(ear.hear(uav.say(), HERE))
    assert ear.codec.peer == HERE


@pytest.mark.parametrize("noise", NO_PROOF)
def test_a_stranger_disturbs_nobody_and_is_counted(
    noise: Callable[[], bytes], *, signed: bool
) -> None:
    ear, uav = Ear(signed=signed), vehicle(signed=signed)
    for _ in range(100):
        assert hears_vehicle(ear.hear(uav.say(), HERE))
        assert ear.hear(noise(), STRANGER) == []
        ear.now_s += 0.5

    assert ear.codec.peer == HERE
    assert ear.codec.strangers == 100


def test_junk_from_the_peer_keeps_the_link_for_nobody(*, signed: bool) -> None:
    ear, uav = Ear(signed=signed), vehicle(signed=signed)
    ear.hear(uav.say(), STRANGER)  # as by a radio that has another address now
    for _ in range(7):
        ear.now_s += 0.5
        ear.hear(junk(), STRANGER)

    assert hears_vehicle(ear.hear(uav.say(), HERE))
    assert ear.codec.peer == HERE


@pytest.mark.parametrize("gap_s", [0.1, 2.9])
def test_forged_frames_do_not_take_the_link_of_a_vehicle_that_speaks(gap_s: float) -> None:
    ear = Ear()
    ear.hear(Speaker().say(), HERE)
    ear.now_s += gap_s

    assert ear.hear(Speaker().say(), STRANGER) == []
    assert ear.codec.peer == HERE
    assert ear.codec.strangers == 1


def test_a_vehicle_that_signs_may_move_at_once() -> None:
    ear, uav = Ear(signed=True), vehicle(signed=True)
    assert hears_vehicle(ear.hear(uav.say(), HERE))
    assert hears_vehicle(ear.hear(uav.say(), ELSEWHERE))
    assert ear.codec.peer == ELSEWHERE
    assert hears_vehicle(ear.hear(uav.say(), HERE))
    assert ear.codec.peer == HERE
    assert ear.codec.strangers == 0


def test_a_vehicle_without_a_key_may_move_when_it_has_been_silent() -> None:
    ear, uav = Ear(), vehicle(signed=False)
    ear.hear(uav.say(), HERE)
    ear.now_s += 3.1

    assert hears_vehicle(ear.hear(uav.say(), ELSEWHERE))
    assert ear.codec.peer == ELSEWHERE
    assert ear.hear(uav.say(), HERE) == []


def replayed(uav: Speaker, ear: Ear) -> bytes:
    frame = uav.say()
    ear.hear(frame, HERE)
    return frame


@pytest.mark.parametrize(
    "forged",
    [
        lambda *_: Speaker().say(),
        lambda *_: Speaker(key=bytes(31) + b"\x01").say(),
        lambda *_: Speaker().say(RADIO_STATUS),
        replayed,
    ],
    ids=["unsigned", "wrongly signed", "radio status", "replayed"],
)
def test_no_forgery_takes_a_signed_link_however_long_the_vehicle_is_silent(
    forged: Callable[[Speaker, Ear], bytes],
) -> None:
    ear, uav = Ear(signed=True), vehicle(signed=True)
    ear.hear(uav.say(), HERE)
    frame = forged(uav, ear)
    for _ in range(120):
        ear.now_s += 0.5
        assert not hears_vehicle(ear.hear(frame, STRANGER))

    assert ear.codec.peer == HERE
    assert hears_vehicle(ear.hear(uav.say(), ELSEWHERE))


def test_frames_that_come_in_pieces_are_put_together_for_each_sender(*, signed: bool) -> None:
    ear, uav = Ear(signed=signed), vehicle(signed=signed)
    heard = False
    for _ in range(3):
        frame = uav.say()
        ear.hear(frame[:11], HERE)
        ear.hear(half_a_frame(), STRANGER)
        heard |= hears_vehicle(ear.hear(frame[11:], HERE))

    assert heard
    assert ear.codec.peer == HERE


def test_many_strangers_take_no_room_and_cost_the_vehicle_no_frame(*, signed: bool) -> None:
    ear, uav = Ear(signed=signed), vehicle(signed=signed)
    ear.hear(uav.say(), HERE)
    frame = uav.say()
    ear.hear(frame[:11], HERE)
    for number in range(5000):
        ear.hear(half_a_frame(), ("6.6.6.6", number))

    assert hears_vehicle(ear.hear(frame[11:], HERE))
    assert ear.codec.bad_bytes >= (5000 - 16) * len(half_a_frame())  # forgotten


def test_what_strangers_say_is_shown_to_no_ground_station() -> None:
    ear = Ear()
    ear.codec.keep_frames = True
    genuine = Speaker().say()
    ear.hear(genuine, HERE)
    ear.hear(Speaker().say(), STRANGER)

    assert ear.codec.take_frames() == [genuine]


def test_another_link_is_nobodys_yet(*, signed: bool) -> None:
    ear, uav = Ear(signed=signed), vehicle(signed=signed)
    ear.hear(uav.say(), HERE)
    ear.codec.reset_link()

    assert ear.codec.peer is None
    assert hears_vehicle(ear.hear(uav.say(), ELSEWHERE))


def bridge(**config: Any) -> Bridge:
    one = Bridge(replace(BridgeConfig(1, ORIGIN), **config))
    one.step(LinkOpened(), 0.0)
    return one


def test_the_bridge_says_which_other_vehicle_it_hears() -> None:
    one = bridge()
    one.step(BytesReceived(other_vehicle(), STRANGER), 1.0)

    assert one.contact.foreign == {7: 1}
    assert one.codec.peer is None


def test_a_pause_of_this_process_is_no_silence_of_the_vehicle() -> None:
    one = bridge()
    one.step(BytesReceived(Speaker().say(), HERE), 1.0)
    one.step(TimePassed(), 1.0)
    # What came during the pause is read in any order.
    one.step(BytesReceived(Speaker().say(), STRANGER), 20.0)

    assert one.codec.peer == HERE
    assert one.codec.strangers == 1


def test_how_long_a_vehicle_may_be_silent_is_a_setting_and_follows_the_speedup() -> None:
    one = bridge(peer_silence_s=10.0)
    one.step(BytesReceived(Speaker().say(), HERE), 1.0)
    for tenth in range(10, 95):
        one.step(TimePassed(), tenth / 10)
    one.step(BytesReceived(Speaker().say(), ELSEWHERE), 9.5)

    assert one.codec.peer == HERE
    assert BridgeConfig(1, ORIGIN).for_speedup(20.0).peer_silence_s == 60.0
