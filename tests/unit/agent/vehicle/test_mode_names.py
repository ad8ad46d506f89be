"""A vehicle's own names of its modes, and which mode it was asked for.

What real firmware says: ArduCopter 4.8 has 25 modes and tells the first alone when it is asked for
all; PX4 1.17 tells all 26, those of MAVLink's standard without a name.
"""

from __future__ import annotations

import pytest
from pymavlink.dialects.v20 import development as later_dialect

from agent.core.interface import HandedOver
from agent.vehicle.codec import MavlinkCodec
from agent.vehicle.messages import AvailableMode, AvailableModesChange, CurrentMode
from tests.support.bridge_flight import ORIGIN, BridgeFlight
from tests.support.fake_copter import ASK, FakeCopter
from tests.support.fake_px4 import FakePx4
from tests.support.mavlink_frames import frame

OWN_MODE = {FakeCopter: 105, FakePx4: 4 << 16 | 11 << 24}
"""Of the vehicle's owner: ours have no name for it."""
EITHER = pytest.mark.parametrize("fake", [FakeCopter, FakePx4])


def mode(index: int, number: int, name: bytes) -> bytes:
    return frame(later_dialect.MAVLink_available_modes_message(25, index, 0, number, 0, name))


def heard(data: bytes) -> list[object]:
    return [each.message for each in MavlinkCodec(1).decode(data)]


def named(fake: type[FakeCopter]) -> FakeCopter:
    """A vehicle that tells its modes."""
    vehicle = fake(ORIGIN)
    vehicle.modes = {n: f"Mode {n}" for n in range(5)} | {OWN_MODE[fake]: "Soar"}
    return vehicle


def taken(flight: BridgeFlight) -> str:
    """Why the vehicle is no longer ours, once it is not."""
    handed = flight.run_until(HandedOver)
    assert isinstance(handed, HandedOver)
    return handed.reason


def test_messages_are_read_as_pymavlink_writes_them() -> None:
    whole = b"A name of five and thirty characters"[:35]
    assert heard(mode(25, 0xFFFFFFFF, whole)) == [AvailableMode(0xFFFFFFFF, whole.decode(), 25, 25)]
    assert heard(mode(1, 27, b"Auto RTL")) == [AvailableMode(27, "Auto RTL", 1, 25)]
    assert heard(mode(2, 0, b"")) == [AvailableMode(0, "", 2, 25)]
    current = later_dialect.MAVLink_current_mode_message(5, 0x04050000, 0x04030000)
    assert heard(frame(current)) == [CurrentMode(0x04050000, 0x04030000)]
    monitor = later_dialect.MAVLink_available_modes_monitor_message(200)
    assert heard(frame(monitor)) == [AvailableModesChange(200)]


def test_what_cannot_be_printed_does_not_come_through() -> None:
    (told,) = heard(mode(1, 3, b"So\x1b[2Jar\xff"))
    assert told == AvailableMode(3, "So?[2Jar\ufffd", 1, 25)


@pytest.mark.parametrize("place", [4, 8, 12, 20, 30, -1])
def test_a_broken_frame_is_no_message(place: int) -> None:
    data = bytearray(mode(1, 27, b"Auto RTL, and home"))
    data[place] ^= 0x10
    assert not any(isinstance(each, AvailableMode) for each in heard(bytes(data)))


@EITHER
def test_every_mode_is_asked_for_once_and_a_pilots_is_called_by_its_name(
    fake: type[FakeCopter],
) -> None:
    vehicle = named(fake)
    flight = BridgeFlight(vehicle).flying()
    asked = [int(m.param2) for m in vehicle.commands(ASK)]
    assert asked == ([0] if fake is FakePx4 else [0, 2, 3, 4, 5, 6])
    vehicle.set_mode(OWN_MODE[fake])
    assert "switched it to Soar" in taken(flight)


@EITHER
def test_who_tells_no_modes_is_asked_once_and_known_by_numbers(fake: type[FakeCopter]) -> None:
    vehicle = fake(ORIGIN)
    flight = BridgeFlight(vehicle).flying()
    assert len(vehicle.commands(ASK)) == 1
    vehicle.set_mode(OWN_MODE[fake])
    number = "105" if fake is FakeCopter else "4.11"
    assert f"switched it to mode {number}" in taken(flight)


def test_who_forgets_the_first_answer_is_asked_again() -> None:
    vehicle = named(FakeCopter)
    tell, forgotten = vehicle.say, list[object]()

    def say_but_the_first(message: object) -> None:
        if getattr(message, "mode_index", 0) and not forgotten:
            forgotten.append(message)
        else:
            tell(message)

    vehicle.say = say_but_the_first  # type: ignore[method-assign]
    flight = BridgeFlight(vehicle).flying()
    assert [int(m.param2) for m in vehicle.commands(ASK)] == [0, 0, 2, 3, 4, 5, 6]
    vehicle.set_mode(OWN_MODE[FakeCopter])
    assert "switched it to Soar" in taken(flight)


def test_a_lost_answer_costs_one_name() -> None:
    vehicle = named(FakeCopter)
    tell = vehicle.say

    def say_but_the_third(message: object) -> None:
        if getattr(message, "mode_index", 0) != 3:
            tell(message)

    vehicle.say = say_but_the_third  # type: ignore[method-assign]
    BridgeFlight(vehicle).flying()
    assert [int(m.param2) for m in vehicle.commands(ASK)] == [0, 2, 3, 4, 5, 6]


def test_modes_that_changed_are_asked_for_again() -> None:
    vehicle = named(FakePx4)
    flight = BridgeFlight(vehicle).flying()
    vehicle.say(later_dialect.MAVLink_available_modes_monitor_message(0))
    flight.run(2.0)
    assert len(vehicle.commands(ASK)) == 1
    vehicle.modes[OWN_MODE[FakePx4]] = "Glide"
    vehicle.say(later_dialect.MAVLink_available_modes_monitor_message(1))
    flight.run(2.0)
    assert len(vehicle.commands(ASK)) == 2
    vehicle.set_mode(OWN_MODE[FakePx4])
    assert "switched it to Glide" in taken(flight)


@pytest.mark.parametrize(
    ("intended", "who"), [(4 << 16 | 3 << 24, "a failsafe"), (4 << 16 | 5 << 24, "its pilot or")]
)
def test_a_mode_that_nobody_asked_for_is_a_failsafes(intended: int, who: str) -> None:
    vehicle = FakePx4(ORIGIN)
    flight = BridgeFlight(vehicle).flying()
    vehicle.say(later_dialect.MAVLink_current_mode_message(5, vehicle.return_mode, intended))
    vehicle.set_mode(vehicle.return_mode)
    assert taken(flight).startswith(f"{who}")
