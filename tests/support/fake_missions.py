"""Missions of the scripted vehicles: transfer and flight, as the recordings and sources have it.

ArduCopter takes items in place, one by one, and flies in AUTO whatever stands there at the
moment; PX4 keeps an upload apart until its last item has come. Both wait at a waypoint for
its hold time and say that it is reached only then. Leaves out: jumps, conditions, splines.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any

from pymavlink.dialects.v20 import ardupilotmega as mavlink

from swarm.model.frames import enu_from_wgs84, wgs84_from_enu

if TYPE_CHECKING:
    from tests.support.fake_copter import FakeCopter


OK, ERROR, UNSUPPORTED, INVALID_SEQUENCE, DENIED, CANCELLED = 0, 1, 3, 13, 14, 15
WAYPOINT, LAUNCH, GIVE_WAY, SPEED, LIMITS = 16, 20, 92, 178, 222
_GROUND = (255, 191)


class CopterMissions:
    """ArduCopter's."""

    ask_again_s, patience_s = 1.0, 8.0

    def __init__(self, copter: FakeCopter) -> None:
        self.copter = copter
        self.items: list[Any] = []
        """MISSION_ITEM_INTs by number."""
        self.current = 0
        self.verdict: int | None = None
        """Refuse the next upload at its last item, with this result."""
        self.flown: list[tuple[float, float]] = []
        """Where it set out for in the mission mode [m; east, north]."""
        self.going_home = False
        self._wanted: int | None = None
        self._count = 0
        self._asked_s = self._heard_s = 0.0
        self._near_since_s: float | None = None
        self._holds_s = 0.0
        self._limit_s = self._gives_way_until_s = 0.0
        self._forgets_speed = False
        self._speed_m_s: float | None = None

    # Transfer.

    def on_count(self, m: Any) -> None:
        del self.items[m.count :]
        self._begin_upload(m.count)

    def _begin_upload(self, count: int) -> None:
        self._count, self._wanted = count, 0
        self._heard_s = self.copter.now_s
        self._ask()

    def _ask(self) -> None:
        self._asked_s = self.copter.now_s
        assert self._wanted is not None
        self.copter.say(mavlink.MAVLink_mission_request_message(*_GROUND, self._wanted))

    def on_item(self, m: Any) -> None:
        if self._wanted is None:
            return
        if m.seq != self._wanted:
            self.ack(INVALID_SEQUENCE)
            return
        self._heard_s = self.copter.now_s
        if self.verdict is not None and m.seq == self._count - 1:
            self._wanted = None
            self.ack(self.verdict)
            return
        before = self.items[m.seq] if m.seq < len(self.items) else None
        self.items[m.seq : m.seq + 1] = [m]
        changed = before is None or _content(before) != _content(m)
        flies_to_it = m.command == WAYPOINT and m.seq == self.current
        if changed and flies_to_it and self.runs and not self.going_home:
            self.copter.text(2, "Auto mission changed, restarted command")
            self._fly(self.current)
        self._wanted += 1
        if self._wanted < self._count:
            self._ask()
        else:
            self._wanted = None
            self.ack(OK)

    def on_request_list(self, _: Any) -> None:
        if self._wanted is not None:
            self.ack(DENIED)
            return
        self.copter.say(mavlink.MAVLink_mission_count_message(*_GROUND, len(self.items)))

    def on_request(self, m: Any) -> None:
        if self._wanted is not None:
            self.ack(DENIED)
        elif m.seq < len(self.items):
            self.copter.say(self._told(m.seq))
        else:
            self.ack(ERROR)

    def _told(self, seq: int) -> Any:
        m = self.items[seq]
        frame, x, y, z = {5: 0, 6: 3}.get(m.frame, 0), m.x, m.y, math.trunc(m.z * 100) / 100
        params = (m.param1, m.param2, m.param3, 0.0)
        if seq == 0:
            lat_deg, lon_deg, z = wgs84_from_enu(self.copter.origin, self.copter.home_m)
            frame, x, y, params = 0, round(lat_deg * 1e7), round(lon_deg * 1e7), (0.0,) * 4
        elif m.command == WAYPOINT:
            params = (float(int(m.param1)), 0.0, 0.0, 0.0)
        else:
            x = y = 0
        return mavlink.MAVLink_mission_item_int_message(
            *_GROUND, seq, frame, m.command, 0, 1, *params, x, y, z
        )

    def on_clear_all(self, _: Any) -> None:
        if self._wanted is not None or self.runs:
            self.ack(ERROR)
            return
        self.items, self.current = [], 0
        self.ack(OK)

    def on_ack(self, m: Any) -> None:
        """ArduPilot does not listen to acknowledgements."""

    def ack(self, result: int) -> None:
        self.copter.say(mavlink.MAVLink_mission_ack_message(*_GROUND, result))

    # Flight.

    @property
    def runs(self) -> bool:
        return bool(self.copter.mode == self.copter.mission_mode)

    def on_set_current(self, m: Any) -> None:
        if m.seq >= len(self.items):
            return
        self.set_current(max(m.seq, 1))
        self.copter.say(mavlink.MAVLink_mission_current_message(m.seq))  # as an acknowledgement

    def set_current(self, seq: int) -> None:
        if self.runs:
            self._fly(seq)
        else:
            self.current = seq
            while self.items[self.current].command in (SPEED, LIMITS):
                self.current += 1

    def say_current(self) -> None:
        self.copter.say(mavlink.MAVLink_mission_current_message(self.current))

    def refusal(self) -> str | None:
        """Why the mission mode is not entered; None if it is."""
        if not self.copter.airborne:
            return "Auto: Missing Takeoff Cmd"
        return None if len(self.items) > 1 else "Mode change to AUTO failed"

    def enter(self) -> None:
        """The mission mode begins: go on where it was left, commands before included."""
        self.going_home = False
        seq = max(self.current, 1)
        while self.items[seq - 1].command in (SPEED, LIMITS):
            seq -= 1
        self._limit_s = 0.0
        self._fly(seq)

    def leave(self) -> None:
        self.going_home = False
        self._near_since_s = None

    def _fly(self, seq: int) -> None:
        copter = self.copter
        while seq < len(self.items) and self.items[seq].command in (SPEED, LIMITS):
            if self.items[seq].command == SPEED:
                self._speed_m_s = copter.speed_m_s = self.items[seq].param2
            else:
                self._limit_s = self.items[seq].param1
            seq += 1
        self.current, self.going_home, self._near_since_s = seq, False, None
        item = self.items[seq]
        if item.command == LAUNCH:
            self._go_home()
            return
        if item.command == GIVE_WAY:
            self._forgets_speed, copter.target_m = True, None
            self._gives_way_until_s = copter.now_s + (self._limit_s or math.inf)
            return
        copter.speed_m_s = self._speed_m_s or copter.speed_m_s
        assert item.frame in (0, 5), "above mean sea level"
        target_m = enu_from_wgs84(copter.origin, item.x / 1e7, item.y / 1e7, item.z)
        self._holds_s = float(int(item.param1))
        self.flown.append((round(target_m[0], 1), round(target_m[1], 1)))
        if not copter.stuck:
            copter.target_m = target_m

    @property
    def gives_way(self) -> bool:
        """Whether it flies to targets meanwhile."""
        known = self.current < len(self.items)
        return self.runs and known and self.items[self.current].command == GIVE_WAY

    def take_target(self, target_m: tuple[float, float, float]) -> None:
        """A target was told: the first one makes it forget the speed."""
        self.flown.append((round(target_m[0], 1), round(target_m[1], 1)))
        if self._forgets_speed:
            self._forgets_speed = False
            self.copter.speed_m_s = self.copter.default_speed_m_s

    def _go_home(self) -> None:
        self.going_home = True
        self.copter.begin_return()

    def advance(self) -> None:
        copter = self.copter
        if self._wanted is not None:
            if copter.now_s - self._heard_s > self.patience_s:
                self._wanted = None
                self._on_timeout()
            elif copter.now_s - self._asked_s > self.ask_again_s:
                self._ask()
        if not self.runs or self.going_home or self.current >= len(self.items):
            return
        if self.gives_way:
            if copter.now_s >= self._gives_way_until_s:
                self.say_reached(self.current)
                self._fly(self.current + 1)
            return
        item = self.items[self.current]
        if self._near_since_s is None and self._is_near(item):
            self._near_since_s = copter.now_s
        if self._near_since_s is not None and copter.now_s - self._near_since_s >= self._holds_s:
            self.say_reached(self.current)
            self._fly(self.current + 1)

    def _on_timeout(self) -> None:
        self.ack(CANCELLED)

    def _is_near(self, item: Any) -> bool:
        target_m = enu_from_wgs84(self.copter.origin, item.x / 1e7, item.y / 1e7, item.z)
        return math.dist(self.copter.position_m, target_m) <= 2.0

    def say_reached(self, seq: int) -> None:
        self.copter.say(mavlink.MAVLink_mission_item_reached_message(seq))


class Px4Missions(CopterMissions):
    """PX4's."""

    ask_again_s, patience_s = 0.25, 5.0

    def __init__(self, copter: FakeCopter) -> None:
        super().__init__(copter)
        self._staged: list[Any] = []
        self._sending: int | None = None
        self._accepted_s = -math.inf
        self._reached: tuple[int, int] | None = None
        self._reached_due_s = 0.0

    def on_count(self, m: Any) -> None:
        self._heard_s = self.copter.now_s
        if self._sending is not None or self._wanted or self.copter.fence.busy:
            self.ack(ERROR)
            return
        self._staged = []
        self._begin_upload(m.count)

    def _ask(self) -> None:
        self._asked_s = self.copter.now_s
        assert self._wanted is not None
        self.copter.say(mavlink.MAVLink_mission_request_int_message(*_GROUND, self._wanted))

    def on_item(self, m: Any) -> None:
        if self._wanted is None:
            self.ack(OK if m.seq + 1 == len(self._staged) else ERROR)
            return
        self._heard_s = self.copter.now_s
        if m.seq != self._wanted:
            return
        if m.command in (GIVE_WAY, LIMITS) or (m.command != WAYPOINT) != (m.frame == 2):
            self._wanted = None
            self.ack(UNSUPPORTED)
            return
        self._staged.append(m)
        self._wanted += 1
        if self._wanted < self._count:
            self._ask()
            return
        self._wanted = None
        if self.verdict is not None:
            self.ack(self.verdict)
            return
        if [_content(i) for i in self._staged] != [_content(i) for i in self.items]:
            self._replace()
        self.ack(OK)

    def _replace(self) -> None:
        self.items = list(self._staged)
        self._accepted_s = self.copter.now_s
        current = [i.seq for i in self.items if i.current]
        self.current = current[0] if current else min(self.current, len(self.items) - 1)
        if self.runs:
            self._fly(self.current)

    def on_request_list(self, _: Any) -> None:
        if self._wanted is not None:
            return
        self._sending, self._heard_s = 0, self.copter.now_s
        self.copter.say(mavlink.MAVLink_mission_count_message(*_GROUND, len(self.items)))

    def on_request(self, m: Any) -> None:
        if self._sending is None:
            return
        self._heard_s = self.copter.now_s
        if m.seq not in (self._sending, self._sending - 1) or m.seq >= len(self.items):
            self._sending = None
            self.ack(ERROR)
            return
        self._sending = m.seq + 1
        self.copter.say(self._told(m.seq))

    def _told(self, seq: int) -> Any:
        m = self.items[seq]
        fields = (m.param1, m.param2, m.param3, m.param4, m.x, m.y, m.z)
        return mavlink.MAVLink_mission_item_int_message(
            *_GROUND, seq, m.frame, m.command, int(seq == self.current), 1, *fields
        )

    def on_clear_all(self, _: Any) -> None:
        if self._sending is not None or self._wanted is not None:
            self.copter.text(2, "WPM: IGN CLEAR CMD: Busy")
            return
        self.items, self.current = [], 0
        self.ack(OK)

    def on_ack(self, m: Any) -> None:
        self._sending = None
        if m.type == CANCELLED:
            self._wanted = None

    def _on_timeout(self) -> None:
        self.copter.text(2, "Operation timeout")

    def on_set_current(self, m: Any) -> None:
        if self._sending is not None or self._wanted is not None:
            self.copter.text(2, "WPM: IGN WP CURR CMD: Busy")
        elif m.seq < len(self.items):
            self.current = m.seq
            if self.runs:
                self._fly(m.seq)
            self.say_current()

    def refusal(self) -> str | None:
        young = self.copter.now_s - self._accepted_s < 2.0
        return "No valid mission available, loitering" if young or not self.items else None

    def enter(self) -> None:
        self._fly(self.current)

    def _fly(self, seq: int) -> None:
        super()._fly(seq)
        self.say_current()

    def _go_home(self) -> None:
        self.copter.set_mode(self.copter.return_mode)

    def advance(self) -> None:
        now_s = self.copter.now_s
        if self._sending is not None and now_s - self._heard_s > self.patience_s:
            self._sending = None
        super().advance()
        if self._reached is not None and now_s >= self._reached_due_s:
            seq, left = self._reached
            self._reached, self._reached_due_s = (seq, left - 1) if left > 1 else None, now_s + 0.5
            super().say_reached(seq)

    def say_reached(self, seq: int) -> None:
        super().say_reached(seq)
        self._reached, self._reached_due_s = (seq, 10), self.copter.now_s + 0.5


def _content(item: Any) -> tuple[Any, ...]:
    """What makes an item another one; NaN is equal to itself here."""
    params = (item.param1, item.param2, item.param3, item.param4)
    numbers = tuple(None if math.isnan(p) else p for p in params)
    return (item.frame, item.command, item.x, item.y, item.z, *numbers)
