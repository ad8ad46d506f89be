"""Mission transfer as a transaction."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from agent.vehicle.messages import (
    AltitudeFrame,
    Inbound,
    MissionAck,
    MissionClearAll,
    MissionCount,
    MissionItem,
    MissionKind,
    MissionRequest,
    MissionRequestList,
    Outbound,
)
from agent.vehicle.mission_transfer import (
    MissionFailed,
    MissionInForce,
    MissionPolicy,
    MissionRead,
    MissionTransfer,
)


def mission(*heights_m: float) -> tuple[MissionItem, ...]:
    home = MissionItem(0, 16, AltitudeFrame.MEAN_SEA_LEVEL, 47.0, 8.0, 0.0)
    places = (
        MissionItem(i, 16, AltitudeFrame.HOME, 47.0 + i / 1e3, 8.0, height_m)
        for i, height_m in enumerate(heights_m, start=1)
    )
    return (home, *places)


OLD = mission(10.0, 11.0)
NEW = mission(20.0, 21.0, 22.0)


class FakeStore:
    """Takes items in place, one by one, as ArduPilot does; half a mission stays half."""

    def __init__(self) -> None:
        self.items: list[MissionItem] = []
        self.count = 0
        self.wanted: int | None = None
        self.asked_s = 0.0

    def on_message(self, message: Outbound, now_s: float) -> list[Inbound]:
        match message:
            case MissionCount(count):
                self.count, self.wanted, self.asked_s = count, 0, now_s
                del self.items[count:]
                return [MissionRequest(0)]
            case MissionItem(seq) if seq == self.wanted:
                self.items[seq : seq + 1] = [message]
                self.wanted, self.asked_s = seq + 1, now_s
                if self.wanted < self.count:
                    return [MissionRequest(self.wanted)]
                self.wanted = None
                self.items[0] = replace(self.items[0], alt_m=488.0)  # home is its own
                return [MissionAck(0)]
            case MissionClearAll():
                if self.wanted is not None:
                    return [MissionAck(1)]
                self.items.clear()
                return [MissionAck(0)]
            case MissionRequestList():
                return [MissionCount(len(self.items))]
            case MissionRequest(seq) if seq < len(self.items):
                return [self.items[seq]]
            case _:
                return []

    def on_time(self, now_s: float) -> list[Inbound]:
        """ArduPilot repeats an unanswered request every second, and gives up after eight."""
        if self.wanted is None or now_s < self.asked_s + 1.0:
            return []
        self.asked_s += 1.0
        return [MissionRequest(self.wanted)]


Spoil = Callable[[object], int]


def transfer(
    machine: MissionTransfer,
    store: FakeStore,
    items: tuple[MissionItem, ...],
    *,
    up: Spoil = lambda _: 1,
    down: Spoil = lambda _: 1,
) -> MissionInForce | MissionFailed:
    """Carry a transfer through; ``up`` and ``down`` say how often a message gets through."""
    now_s = 0.0
    outbox: list[Outbound] = machine.upload(items, now_s)
    for _ in range(4_000):
        inbox: list[Inbound] = []
        for message in outbox:
            for _ in range(up(message)):
                inbox += store.on_message(message, now_s)
        inbox += store.on_time(now_s)
        outbox = []
        for answer in inbox:
            for _ in range(down(answer)):
                outbox += machine.on_message(answer, now_s)
        if machine.result is not None:
            assert not isinstance(machine.result, MissionRead)
            return machine.result
        now_s += 0.1
        outbox += machine.on_time(now_s)
    raise AssertionError("the transfer hangs")


def test_mission_is_in_force_once_read_back() -> None:
    machine, store = MissionTransfer(MissionPolicy()), FakeStore()
    assert transfer(machine, store, NEW) == MissionInForce(NEW)
    assert machine.in_force == NEW
    assert tuple(store.items[1:]) == NEW[1:]
    assert not machine.busy


def test_upload_cut_in_the_middle_leaves_the_old_mission_in_force() -> None:
    machine, store = MissionTransfer(MissionPolicy()), FakeStore()
    transfer(machine, store, OLD)
    cut = iter([1, 1])

    def up(message: object) -> int:
        return next(cut, 0) if isinstance(message, MissionItem) and message.alt_m >= 20.0 else 1

    result = transfer(machine, store, NEW, up=up)
    assert isinstance(result, MissionFailed)
    assert result.old_mission_verified
    assert machine.in_force == OLD
    assert tuple(store.items[1:]) == OLD[1:], "the vehicle was given its old mission back"


def test_link_that_dies_in_the_middle_is_reported_as_unverified() -> None:
    machine, store = MissionTransfer(MissionPolicy()), FakeStore()
    transfer(machine, store, OLD)
    left = iter(range(3))
    result = transfer(machine, store, NEW, up=lambda _: 0 if next(left, None) is None else 1)
    assert isinstance(result, MissionFailed)
    assert not result.old_mission_verified
    assert machine.in_force == OLD


def test_vehicle_that_never_answers_keeps_its_mission() -> None:
    machine, store = MissionTransfer(MissionPolicy()), FakeStore()
    transfer(machine, store, OLD)
    result = transfer(machine, store, NEW, up=lambda _: 0)
    assert result == MissionFailed("no answer while announcing", old_mission_verified=True)


def test_lost_final_acknowledgement_is_made_good_by_reading_back() -> None:
    machine, store = MissionTransfer(MissionPolicy()), FakeStore()
    result = transfer(machine, store, NEW, down=lambda m: 0 if isinstance(m, MissionAck) else 1)
    assert result == MissionInForce(NEW)


def test_acknowledged_mission_that_reads_back_differently_is_a_failure() -> None:
    class Forgetful(FakeStore):
        def on_message(self, message: Outbound, now_s: float) -> list[Inbound]:
            answers = super().on_message(message, now_s)
            return [
                replace(a, alt_m=5.0) if isinstance(a, MissionItem) and a.alt_m == 22.0 else a
                for a in answers
            ]

    machine, store = MissionTransfer(MissionPolicy()), Forgetful()
    transfer(machine, store, OLD)
    result = transfer(machine, store, NEW)
    assert result == MissionFailed(
        "read back from the vehicle, item 3 differs", old_mission_verified=True
    )
    assert tuple(store.items[1:]) == OLD[1:]


def test_refused_mission_is_reported_with_its_result() -> None:
    machine = MissionTransfer(MissionPolicy())
    machine.upload(NEW, 0.0)
    machine.on_message(MissionRequest(0), 0.1)
    cancelled = MissionAck(15)
    assert machine.on_message(MissionAck(4), 0.2) == [cancelled, MissionClearAll()]
    machine.on_message(MissionAck(0), 0.3)
    machine.on_message(MissionCount(1), 0.4)
    assert machine.result == MissionFailed(
        "the vehicle refused the mission (result 4)", old_mission_verified=True
    )
    assert machine.in_force is None


def test_mission_that_cannot_be_cleared_is_reported_as_unverified() -> None:
    for answers in ((), (MissionAck(1),), (MissionAck(0), MissionCount(4))):
        machine = MissionTransfer(MissionPolicy(tries=2))
        machine.upload(NEW, 0.0)
        machine.on_message(MissionRequest(0), 0.0)
        machine.on_message(MissionAck(4), 0.0)
        for answer in answers:
            machine.on_message(answer, 0.0)
        assert machine.on_time(2.0) in ([MissionClearAll()], [])
        machine.on_time(4.0)
        assert machine.result == MissionFailed(
            "the vehicle refused the mission (result 4)", old_mission_verified=False
        )


@pytest.mark.parametrize("seed", range(50))
def test_first_mission_that_fails_on_a_bad_link_leaves_none_or_says_so(seed: int) -> None:
    chance = np.random.default_rng(seed)

    def spoil(message: object) -> int:
        lost = 0.9 if isinstance(message, MissionItem) and message.seq > 1 else 0.2
        return int(chance.choice([0, 1], p=[lost, 1.0 - lost]))

    machine, store = MissionTransfer(MissionPolicy(tries=3)), FakeStore()
    store.items = list(OLD)
    result = transfer(machine, store, NEW, up=spoil, down=spoil)
    if isinstance(result, MissionInForce):
        assert tuple(store.items[1:]) == NEW[1:]
    elif result.old_mission_verified:
        assert store.items in ([], list(OLD))


def test_what_stands_on_the_vehicle_is_cleared_on_request() -> None:
    machine, store = MissionTransfer(MissionPolicy()), FakeStore()
    transfer(machine, store, OLD)
    [clears] = machine.clear(0.0)
    [acknowledged] = store.on_message(clears, 0.0)
    [asks] = machine.on_message(acknowledged, 0.0)
    assert machine.busy  # that it is clear is still to be seen
    [counted] = store.on_message(asks, 0.0)
    machine.on_message(counted, 0.0)
    assert machine.result == MissionInForce(())
    assert machine.in_force is None
    assert store.items == []


def test_clearing_that_is_not_answered_is_given_up_in_the_end() -> None:
    machine = MissionTransfer(MissionPolicy(tries=2))
    machine.clear(0.0)
    for now_s in range(2, 20, 2):
        machine.on_time(float(now_s))
    assert machine.result == MissionFailed(
        "no answer while clearing the mission", old_mission_verified=False
    )


def test_a_fence_is_transferred_apart_from_missions() -> None:
    fence = MissionKind.FENCE
    items = tuple(replace(item, kind=fence) for item in NEW)
    machine = MissionTransfer(MissionPolicy(vehicle_items=0), fence)
    assert machine.upload(items, 0.0) == [MissionCount(4, fence)]
    assert machine.on_message(MissionRequest(0), 0.0) == []
    assert machine.on_message(MissionAck(4), 0.0) == []
    assert machine.on_message(MissionRequest(0, fence), 0.0) == [items[0]]
    assert machine.busy


def test_a_vehicle_that_knows_no_fences_says_so_at_once() -> None:
    fence = MissionKind.FENCE
    machine = MissionTransfer(MissionPolicy(vehicle_items=0), fence)
    assert machine.read(range(1, 9), 0.0) == [MissionRequestList(fence)]
    machine.on_message(MissionAck(3, fence), 0.0)
    assert isinstance(machine.result, MissionFailed)
    assert machine.result.unsupported


def test_acknowledgement_of_an_older_upload_ends_nothing() -> None:
    machine = MissionTransfer(MissionPolicy())
    machine.upload(NEW, 0.0)
    assert machine.on_message(MissionAck(0), 0.1) == []
    machine.on_message(MissionRequest(0), 0.1)
    assert machine.on_message(MissionAck(0), 0.1) == []
    assert machine.busy


def test_messages_without_a_transfer_change_nothing() -> None:
    machine = MissionTransfer(MissionPolicy())
    for message in (MissionRequest(0), MissionCount(3), NEW[1], MissionAck(0)):
        assert machine.on_message(message, 0.0) == []
    assert machine.on_time(1e9) == []
    assert machine.next_deadline_s() is None


def test_request_beyond_the_end_is_not_answered() -> None:
    machine = MissionTransfer(MissionPolicy())
    machine.upload(NEW, 0.0)
    assert machine.on_message(MissionRequest(4), 0.1) == []


def test_aborted_transfer_says_what_is_known() -> None:
    machine = MissionTransfer(MissionPolicy())
    machine.upload(NEW, 0.0)
    machine.on_message(MissionRequest(0), 0.1)
    machine.abort("the autopilot rebooted")
    assert machine.result == MissionFailed("the autopilot rebooted", old_mission_verified=False)
    assert not machine.busy


def test_second_upload_meanwhile_is_misuse() -> None:
    machine = MissionTransfer(MissionPolicy())
    machine.upload(NEW, 0.0)
    with pytest.raises(ValueError, match="under way"):
        machine.upload(OLD, 0.0)
    with pytest.raises(ValueError, match="numbered"):
        MissionTransfer(MissionPolicy()).upload(NEW[1:], 0.0)


@pytest.mark.parametrize("seed", range(200))
def test_loss_doubling_and_reordering_end_right_or_reported(seed: int) -> None:
    chance = np.random.default_rng(seed)

    def spoil(_: object) -> int:
        return int(chance.choice([0, 1, 2], p=[0.2, 0.7, 0.1]))

    machine, store = MissionTransfer(MissionPolicy()), FakeStore()
    transfer(machine, store, OLD)
    result = transfer(machine, store, NEW, up=spoil, down=spoil)
    held = tuple(store.items[1:])
    if isinstance(result, MissionInForce):
        assert held == NEW[1:]
        assert machine.in_force == NEW
    else:
        assert machine.in_force == OLD
        if result.old_mission_verified:
            assert held == OLD[1:]


def test_vehicle_is_asked_what_stands_on_it() -> None:
    machine, store = MissionTransfer(MissionPolicy()), FakeStore()
    transfer(machine, store, OLD)
    outbox = machine.read({len(OLD)}, 0.0)
    while machine.result is None:
        answers = [answer for message in outbox for answer in store.on_message(message, 0.0)]
        outbox = [out for answer in answers for out in machine.on_message(answer, 0.0)]
    assert isinstance(machine.result, MissionRead)
    assert machine.result.items[1:] == OLD[1:]
    assert machine.in_force == OLD


def test_missions_of_another_length_are_not_read() -> None:
    machine = MissionTransfer(MissionPolicy())
    assert machine.read({4}, 0.0) == [MissionRequestList()]
    machine.on_message(MissionCount(7), 0.1)
    assert machine.result == MissionRead(7, ())
    machine.upload(NEW, 0.2)
    with pytest.raises(ValueError, match="under way"):
        machine.read({4}, 0.2)


def test_vehicle_busy_with_an_older_transfer_is_asked_again() -> None:
    machine = MissionTransfer(MissionPolicy())
    machine.upload(NEW, 0.0)
    assert machine.on_message(MissionAck(1), 0.1) == []
    assert machine.busy
    assert machine.on_time(1.6) == [MissionCount(len(NEW))]


def test_older_upload_that_the_vehicle_goes_on_with_is_cancelled() -> None:
    machine = MissionTransfer(MissionPolicy(tries=3))
    machine.upload(NEW, 0.0)
    assert machine.on_message(MissionRequest(2), 0.1) == [MissionAck(15), MissionCount(len(NEW))]
    machine.on_message(MissionRequest(2), 0.2)
    machine.on_message(MissionRequest(2), 0.3)
    assert machine.result == MissionFailed(
        "the vehicle is busy with another transfer", old_mission_verified=True
    )


def test_mission_left_half_uploaded_is_not_taken_for_verified_by_the_next_upload() -> None:
    machine, store = MissionTransfer(MissionPolicy()), FakeStore()
    transfer(machine, store, OLD)
    machine.upload(NEW, 0.0)
    machine.on_message(MissionRequest(0), 0.0)
    machine.abort("somebody else has the vehicle")
    result = transfer(machine, store, NEW, up=lambda _: 0)
    assert isinstance(result, MissionFailed)
    assert not result.old_mission_verified


@pytest.mark.parametrize(
    ("told", "same"),
    [
        ({}, True),
        ({"alt_m": 19.99}, True),
        ({"params": (60.0, 0.0, 0.0, 0.0)}, True),
        ({"params": (60.0, 0.0, 0.0, 1.0)}, False),
        ({"params": (59.0, 0.0, 0.0, math.nan)}, False),
        ({"alt_m": 20.5}, False),
        ({"lat_deg": 47.00001}, False),
        ({"frame": AltitudeFrame.HOME}, False),
        ({"command": 17}, False),
    ],
)
def test_read_back_is_compared_with_tolerance_for_the_wire_and_for_nothing_else(
    told: dict[str, Any], *, same: bool
) -> None:
    params = (60.0, 0.0, 0.0, math.nan)
    meant = MissionItem(0, 16, AltitudeFrame.MEAN_SEA_LEVEL, 47.0, 8.0, 20.0, params)
    machine = MissionTransfer(MissionPolicy(vehicle_items=0))
    machine.upload([meant], 0.0)
    for message in (MissionRequest(0), MissionAck(0), MissionCount(1), replace(meant, **told)):
        machine.on_message(message, 0.1)
    assert (machine.result == MissionInForce((meant,))) is same


def test_frame_of_an_item_without_a_place_is_the_vehicles_own_affair() -> None:
    meant = MissionItem(0, 20, AltitudeFrame.NONE, 0.0, 0.0, 0.0)
    machine = MissionTransfer(MissionPolicy(vehicle_items=0))
    machine.upload([meant], 0.0)
    told = replace(meant, frame=AltitudeFrame.MEAN_SEA_LEVEL)
    for message in (MissionRequest(0), MissionAck(0), MissionCount(1), told):
        machine.on_message(message, 0.1)
    assert machine.result == MissionInForce((meant,))
