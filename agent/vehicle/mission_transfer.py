"""Mission transfer as one transaction: upload, acknowledgement, read back, compare.

The read-back decides: an upload whose acknowledgement got lost is still good if the vehicle tells
the same items, and one that was acknowledged is not if it tells others. After any failure the last
verified mission stays the one in force; where the vehicle may hold part of the new one, the old one
is uploaded again before the failure is reported; if none was ever verified, all is cleared, so that
no half mission can be flown. A vehicle may also be asked what stands on it, and be told to
clear it. Fences are transferred in the same way, apart from missions.

Protocol: https://mavlink.io/en/services/mission.html
"""

from __future__ import annotations

import math
from collections.abc import Collection, Sequence
from dataclasses import dataclass
from enum import Enum

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

_ACCEPTED = 0
_ERROR = 1
_UNSUPPORTED = 3
_INVALID_SEQUENCE = 13
_OPERATION_CANCELLED = 15
"""MAV_MISSION_RESULT values."""
_PATIENT_TRIES = 3
"""A reading that makes no progress for that many transmissions is begun anew, once."""
_PLACE_TOLERANCE_DEG = 2e-7
_ALT_TOLERANCE_M = 0.02
"""ArduPilot cuts heights to whole centimetres."""
_PARAM_TOLERANCE = 1e-3


@dataclass(frozen=True, slots=True)
class MissionPolicy:
    """Patience with a transfer; durations are vehicle seconds.

    Raises:
        ValueError: a number is not positive.
    """

    reply_timeout_s: float = 1.5
    """Wait for the vehicle's next message of the transfer."""
    tries: int = 6
    """Transmissions of one message without progress before giving up."""
    vehicle_items: int = 1
    """Leading items that belong to the vehicle and are not compared (home on ArduPilot)."""

    def __post_init__(self) -> None:
        if not (self.reply_timeout_s > 0.0 and self.tries > 0 and self.vehicle_items >= 0):
            raise ValueError(f"a mission policy needs positive patience: {self}")


@dataclass(frozen=True, slots=True)
class MissionInForce:
    """The vehicle holds exactly these items."""

    items: tuple[MissionItem, ...]


@dataclass(frozen=True, slots=True)
class MissionFailed:
    """The upload failed; the mission in force is still the one verified before."""

    reason: str
    old_mission_verified: bool
    """The vehicle was seen to hold the old mission, or none at all; if not, do not start one."""
    unsupported: bool = False
    """The vehicle says that it knows no missions of that kind, or no such item."""


@dataclass(frozen=True, slots=True)
class MissionRead:
    """What stands on the vehicle, as far as it was asked for."""

    count: int
    """Items it holds."""
    items: tuple[MissionItem, ...]
    """All of them if there are as many as expected, else none."""


class _Phase(Enum):
    IDLE = "idle"
    ANNOUNCING = "announcing"
    SENDING = "sending"
    CLEARING = "clearing the mission"
    ASKING_COUNT = "asking for the count"
    ASKING_ITEMS = "asking for items"


class MissionTransfer:
    """Uploads missions of one kind to one vehicle, one at a time."""

    def __init__(self, policy: MissionPolicy, kind: MissionKind = MissionKind.FLIGHT) -> None:
        self._policy = policy
        self._kind = kind
        self._phase = _Phase.IDLE
        self._items: tuple[MissionItem, ...] = ()
        self._read_back: list[MissionItem] = []
        self._count = 0
        """Items that the vehicle says it holds, while they are read."""
        self._deadline_s = math.inf
        self._tries = 0
        self._last: list[Outbound] = []
        self._furthest_seq = -1
        self._touched = False
        """The vehicle may hold part of a mission that was never verified."""
        self._second_reading = False
        self._began_reading_anew = False
        self._cleared = False
        """The vehicle says that it cleared what it held."""
        self._reading: Collection[int] | None = None
        """How many items are worth reading of a vehicle that is only asked; None while
        something is uploaded."""
        self._failure: str | None = None
        self._unsupported = False
        self.in_force: tuple[MissionItem, ...] | None = None
        """Items last verified on the vehicle; None if none ever were."""
        self.result: MissionInForce | MissionFailed | MissionRead | None = None
        """Outcome of the last upload or reading; None while it runs."""

    @property
    def busy(self) -> bool:
        """Whether a transfer is under way."""
        return self._phase is not _Phase.IDLE

    def upload(self, items: Sequence[MissionItem], now_s: float) -> list[Outbound]:
        """Begin to put ``items`` in force.

        Raises:
            ValueError: a transfer is under way, there are no items, or their numbers
                are not 0, 1, 2, …
        """
        if self.busy:
            raise ValueError("a mission transfer is under way already")
        if not items or [item.seq for item in items] != list(range(len(items))):
            raise ValueError("mission items must be numbered 0, 1, 2, … without a gap")
        self._begin(None)
        return self._announce(tuple(items), now_s)

    def read(self, counts: Collection[int], now_s: float) -> list[Outbound]:
        """Begin to ask what stands on the vehicle; only so many items are read, no others.

        Raises:
            ValueError: a transfer is under way.
        """
        if self.busy:
            raise ValueError("a mission transfer is under way already")
        self._begin(counts)
        return self._ask_count(now_s)

    def clear(self, now_s: float) -> list[Outbound]:
        """Begin to leave nothing on the vehicle; it is done when that is in force.

        Raises:
            ValueError: a transfer is under way.
        """
        if self.busy:
            raise ValueError("a mission transfer is under way already")
        self._begin(None)
        self.in_force, self._touched = None, True
        return self._clear(now_s)

    def on_message(self, message: Inbound, now_s: float) -> list[Outbound]:
        """Go on with the transfer; messages that do not belong to it change nothing."""
        if getattr(message, "kind", None) is not self._kind:
            return []
        match message:
            case MissionRequest(seq) if self._phase in (_Phase.ANNOUNCING, _Phase.SENDING):
                return self._on_request(seq, now_s)
            case MissionAck(result) if self._phase is _Phase.SENDING:
                return self._on_upload_ack(result, now_s)
            case MissionAck(result) if self._phase is _Phase.ANNOUNCING and result != _ACCEPTED:
                if result == _ERROR:
                    return []  # PX4 is busy with an older transfer until that times out
                return self._refused(result, now_s)
            case MissionAck(result) if (
                result == _UNSUPPORTED and self._reading is not None and self.busy
            ):
                return self._refused(result, now_s)
            case MissionAck(result) if self._phase is _Phase.CLEARING and result == _ACCEPTED:
                # Perhaps an older transfer's: the count will tell.
                self._cleared = True
                return self._ask_count(now_s)
            case MissionCount(count) if self._phase is _Phase.ASKING_COUNT:
                return self._on_count(count, now_s)
            case MissionItem() if self._phase is _Phase.ASKING_ITEMS:
                return self._on_item(message, now_s)
            case _:
                return []

    def on_time(self, now_s: float) -> list[Outbound]:
        """Repeat what was not answered in time, or give up."""
        if not self.busy or now_s < self._deadline_s:
            return []
        stuck = self._phase is _Phase.ASKING_ITEMS and self._tries >= _PATIENT_TRIES
        if stuck and not self._began_reading_anew:
            # PX4 ends a reading that makes no progress, and says nothing then.
            self._began_reading_anew = True
            return self._ask_count(now_s)
        if self._tries < self._policy.tries:
            return self._say(self._last, now_s, again=True)
        if self._phase is _Phase.SENDING and self._furthest_seq == len(self._items) - 1:
            # Every item was asked for, so perhaps only the acknowledgement got lost.
            return self._ask_count(now_s)
        return self._fail(f"no answer while {self._phase.value}", now_s)

    def cancel(self, reason: str) -> list[Outbound]:
        """Stop at once, and tell the vehicle; nothing is restored."""
        out: list[Outbound] = [self._ack(_OPERATION_CANCELLED)] if self.busy else []
        self.abort(reason)
        return out

    def abort(self, reason: str) -> None:
        """Stop at once without a word, because the link or the vehicle is lost."""
        if self.busy:
            self._phase = _Phase.IDLE
            self.result = MissionFailed(self._failure or reason, not self._touched)

    def next_deadline_s(self) -> float | None:
        """When `on_time` has something to do; None while idle."""
        return self._deadline_s if self.busy else None

    def _begin(self, reading: Collection[int] | None) -> None:
        self._failure = self.result = None
        self._reading, self._cleared, self._unsupported = reading, False, False

    def _ack(self, result: int) -> MissionAck:
        return MissionAck(result, self._kind)

    def _announce(self, items: tuple[MissionItem, ...], now_s: float) -> list[Outbound]:
        self._items = items
        self._phase = _Phase.ANNOUNCING
        self._furthest_seq = -1
        self._second_reading = self._began_reading_anew = False
        return self._say([MissionCount(len(items), self._kind)], now_s)

    def _on_request(self, seq: int, now_s: float) -> list[Outbound]:
        if seq >= len(self._items):
            return []
        if self._phase is _Phase.ANNOUNCING and seq > 0:
            # PX4 goes on with an older transfer until it hears that this one was given up.
            if self._tries >= self._policy.tries:
                return self._fail("the vehicle is busy with another transfer", now_s)
            out: list[Outbound] = [self._ack(_OPERATION_CANCELLED), *self._last]
            self._say(self._last, now_s, again=True)
            return out
        self._touched = True
        self._phase = _Phase.SENDING
        # The vehicle asks again for what it did not get: only a higher number is progress.
        again = seq <= self._furthest_seq
        if again and self._tries >= self._policy.tries:
            return self._fail(f"item {seq} does not get through", now_s)
        self._furthest_seq = max(self._furthest_seq, seq)
        return self._say([self._items[seq]], now_s, again=again)

    def _on_upload_ack(self, result: int, now_s: float) -> list[Outbound]:
        if result in (_INVALID_SEQUENCE, _ERROR):
            return []  # an answer to what came twice; a transfer that ended asks no more
        if result != _ACCEPTED:
            return self._refused(result, now_s)
        if self._furthest_seq != len(self._items) - 1:
            return []  # an older transfer's: this one is not through yet
        return self._ask_count(now_s)

    def _ask_count(self, now_s: float) -> list[Outbound]:
        self._phase = _Phase.ASKING_COUNT
        self._read_back = []
        return self._say([MissionRequestList(self._kind)], now_s)

    def _on_count(self, count: int, now_s: float) -> list[Outbound]:
        if self._cleared:
            return self._on_count_of_cleared(count, now_s)
        if self._reading is not None and count not in self._reading:
            self._phase = _Phase.IDLE
            self.result = MissionRead(count, ())
            return [self._ack(_ACCEPTED)]
        if self._reading is None and count != len(self._items):
            return self._differs(f"it holds {count} items, not {len(self._items)}", now_s)
        self._count = count
        self._phase = _Phase.ASKING_ITEMS
        return self._say([MissionRequest(0, self._kind)], now_s)

    def _on_count_of_cleared(self, count: int, now_s: float) -> list[Outbound]:
        if count > self._policy.vehicle_items:
            return self._fail("it is not cleared", now_s)
        self._touched = False
        self._phase = _Phase.IDLE
        if self._failure is None:
            self.result = MissionInForce(())
        else:
            self.result = MissionFailed(self._failure, True, self._unsupported)
        return [self._ack(_ACCEPTED)]

    def _on_item(self, item: MissionItem, now_s: float) -> list[Outbound]:
        wanted = len(self._read_back)
        if item.seq != wanted:
            return []  # doubled or late
        reading = self._reading is not None
        ours = reading or wanted < self._policy.vehicle_items or _same(item, self._items[wanted])
        if not ours:
            return self._differs(f"item {wanted} differs", now_s)
        self._read_back.append(item)
        if len(self._read_back) < self._count:
            return self._say([MissionRequest(wanted + 1, self._kind)], now_s)
        return self._verified()

    def _differs(self, what: str, now_s: float) -> list[Outbound]:
        if self._second_reading:
            return self._fail(f"read back from the vehicle, {what}", now_s)
        # A late message of an older transfer looks like a difference: read once more.
        self._second_reading = True
        return self._ask_count(now_s)

    def _verified(self) -> list[Outbound]:
        self._phase = _Phase.IDLE
        if self._reading is not None:
            self.result = MissionRead(self._count, tuple(self._read_back))
            return [self._ack(_ACCEPTED)]
        self._touched = False
        if self._failure is None:
            self.in_force = self._items
            self.result = MissionInForce(self._items)
        else:
            self.result = MissionFailed(self._failure, True, self._unsupported)
        return [self._ack(_ACCEPTED)]

    def _refused(self, result: int, now_s: float) -> list[Outbound]:
        self._unsupported |= self._failure is None and result == _UNSUPPORTED
        return self._fail(f"the vehicle refused the mission (result {result})", now_s)

    def _clear(self, now_s: float) -> list[Outbound]:
        self._phase = _Phase.CLEARING
        return self._say([MissionClearAll(self._kind)], now_s)

    def _fail(self, reason: str, now_s: float) -> list[Outbound]:
        out: list[Outbound] = [self._ack(_OPERATION_CANCELLED)]
        if self._failure is None:
            self._failure = reason
            if self._touched and self._reading is None:
                if self.in_force is not None:
                    return out + self._announce(self.in_force, now_s)
                return out + self._clear(now_s)
        self._phase = _Phase.IDLE
        self.result = MissionFailed(self._failure or reason, not self._touched, self._unsupported)
        return out

    def _say(
        self, messages: list[Outbound], now_s: float, *, again: bool = False
    ) -> list[Outbound]:
        self._tries = self._tries + 1 if again else 1
        self._last = messages
        self._deadline_s = now_s + self._policy.reply_timeout_s
        return messages


def _same(told: MissionItem, meant: MissionItem) -> bool:
    """Whether the vehicle's item is the one meant, but for the wire's rounding.

    Of an item without a place, ArduPilot tells another frame than it was told.
    """
    return (
        told.command == meant.command
        and (meant.frame is AltitudeFrame.NONE or _same_place(told, meant))
        and told.autocontinue == meant.autocontinue
        and all(
            # NaN is "as you like", which some firmwares remember as 0.
            (math.isnan(b) and (math.isnan(a) or a == 0.0)) or abs(a - b) <= _PARAM_TOLERANCE
            for a, b in zip(told.params, meant.params, strict=True)
        )
    )


def _same_place(told: MissionItem, meant: MissionItem) -> bool:
    return (
        told.frame == meant.frame
        and abs(told.lat_deg - meant.lat_deg) <= _PLACE_TOLERANCE_DEG
        and abs(told.lon_deg - meant.lon_deg) <= _PLACE_TOLERANCE_DEG
        and abs(told.alt_m - meant.alt_m) <= _ALT_TOLERANCE_M
    )
