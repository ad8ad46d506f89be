"""Flies the mission that stands on the vehicle, item after item."""

from __future__ import annotations

from enum import Enum
from typing import TYPE_CHECKING

from pymavlink.dialects.v20 import ardupilotmega as mavlink

from sim.autopilot.events import FirmwareEvent
from sim.autopilot.flight import FlightMode, Milestone, MotionPhase
from sim.autopilot.mission_flight import MissionFlight
from sim.autopilot.mission_item import LOOKS, StoredMissionItem

if TYPE_CHECKING:
    from sim.autopilot.pilot import Pilot

_ITEMS_COMPARED = 3
"""Navigation items, from the current one, whose change makes the autopilot start it anew."""
_REPEAT_S = 1.0


class MissionRunState(Enum):
    """How far the mission has come."""

    NOT_STARTED = "not started"
    RUNNING = "running"
    STOPPED = "stopped"
    COMPLETE = "complete"


class MissionRun:
    """Where in the mission the vehicle is."""

    def __init__(self, pilot: Pilot) -> None:
        self.state = MissionRunState.NOT_STARTED
        self.current: int | None = None
        """Number of the item being flown, or to be flown on resuming."""
        self.told = 0
        """The number that is told as the current one."""
        self.flight = MissionFlight(pilot)
        self._pilot = pilot
        self._store = pilot.store
        self._behaviour = pilot.flavour.missions
        self._first_seq = self._behaviour.first_item
        self.repeat_s: float | None = None
        """When the last item reached is told again [s]."""
        self._repeats_left = 0
        self._reached_seq = 0
        self.hold_until_s: float | None = None
        """When the time on the spot is over [s]."""
        self._set_seq: int | None = None
        """Item that was asked for while the mission did not run, if it is begun there."""
        self._limit_s = 0.0
        """For how long the mission gives way to targets; 0: until it is told to go on."""
        self._landing = False
        """A landing item has reached its place and is descending."""
        self.begun = False
        """It has been flown, as far as it came."""

    @property
    def present(self) -> bool:
        """Whether there is anything to fly."""
        return self._store.next_navigation(self._first_seq) is not None

    @property
    def gives_way(self) -> bool:
        """Whether the mission runs, and lets targets be told."""
        item = self._current_item()
        gives_way = item is not None and item.command == mavlink.MAV_CMD_NAV_GUIDED_ENABLE
        return self.state is MissionRunState.RUNNING and gives_way

    @property
    def starts_with_take_off(self) -> bool:
        """Whether the mission can begin on the ground."""
        first = self._store.next_navigation(self._first_seq)
        item = None if first is None else self._store.item(first)
        return item is not None and item.command == mavlink.MAV_CMD_NAV_TAKEOFF

    @property
    def can_rise(self) -> bool:
        """Whether it may be begun on the ground."""
        return self._behaviour.climbs_first or self.starts_with_take_off

    @property
    def leaves_ground(self) -> bool:
        """Whether it does so as soon as its mode is entered, or the motors run."""
        by_itself = self._behaviour.takes_off_by_itself and self.starts_with_take_off
        return self.flight.climb_due or by_itself

    def lands_instead(self, now_s: float) -> bool:
        """Go on with the mission's landing, where the way home leads there; whether it does."""
        landing = self._pilot.flavour.lands_by_mission(self._pilot)
        if landing is None or self._pilot.flight.on_ground:
            return False
        self.set_current(landing, now_s)
        self._pilot.enter(FlightMode.AUTO, now_s)
        return True

    def start_or_resume(self, now_s: float) -> None:
        """Go on with the current item; from the beginning if there is none."""
        self._limit_s = 0.0
        if self.state is MissionRunState.STOPPED and self.current is not None:
            self.state = MissionRunState.RUNNING
            self._begin_from(self.current if self._set_seq is None else self._set_seq, now_s)
            return
        self.state = MissionRunState.RUNNING
        self._begin_from(self._first_seq, now_s)

    def stop(self) -> None:
        """Leave the mission where it is; `start_or_resume` flies the current item again."""
        if self.state is MissionRunState.RUNNING:
            self.state = MissionRunState.STOPPED
        self.hold_until_s = None
        self.repeat_s = None

    def reset(self) -> None:
        """Forget the place in the mission, as disarming does."""
        self.stop()
        self.current = self._set_seq = None
        if self.state is MissionRunState.COMPLETE and not self._behaviour.restarts:
            self.state = MissionRunState.NOT_STARTED
        if not self._behaviour.keeps_number:
            self.told = 0

    def clear(self) -> bool:
        """Delete the mission; False while it is being flown."""
        if self.state is MissionRunState.RUNNING:
            return False
        self._store.items = ()
        self._rewind()
        return True

    def set_current(self, seq: int, now_s: float) -> bool:
        """Go to an item, at once if the mission runs; False if there is nothing from there on."""
        first = self._store.next_navigation(max(seq, self._first_seq))
        if seq >= len(self._store.items) or first is None:
            return False
        if self.state is MissionRunState.RUNNING:
            self._begin_from(max(seq, self._first_seq), now_s)
        else:
            self._go_to(seq if self._behaviour.upload_rewinds else first)
            self._set_seq = max(seq, self._first_seq)
            self.state = MissionRunState.STOPPED
        return True

    def mission_changed(self, old: tuple[StoredMissionItem, ...], now_s: float) -> bool:
        """Take up a mission that replaced ``old`` while this one ran; True if it made a change.

        The current item is begun anew if it or one of the next two differs and it gives
        no way to targets, as ArduCopter does, or the whole mission if anything differs, where
        the firmware goes back to the first item; otherwise the vehicle flies on.
        """
        rewinds = self._behaviour.upload_rewinds and old != self._store.items
        if self.state is not MissionRunState.RUNNING:
            if not self._store.items or rewinds:
                self._rewind()
            return False
        if rewinds:
            self.repeat_s = None
            self._begin_from(self._first_seq, now_s)
            return True
        same = self._upcoming(old) == self._upcoming(self._store.items)
        if self.current is None or same or self._gave_way(old):
            return False
        self._begin_from(self.current, now_s)
        return True

    def end_hold(self, at_s: float) -> None:
        """End the time on the spot."""
        self.hold_until_s = None
        self._complete_current(at_s)

    def repeat(self, at_s: float) -> None:
        """Tell the last item reached again."""
        self._pilot.outbox.broadcast(
            mavlink.MAVLink_mission_item_reached_message(self._reached_seq)
        )
        self._repeats_left -= 1
        self.repeat_s = at_s + _REPEAT_S if self._repeats_left > 0 else None

    def on_milestone(self, milestone: Milestone, at_s: float) -> None:
        """Hear what the flight came to while the mission runs."""
        item = self._current_item()
        if (
            self.state is not MissionRunState.RUNNING
            or item is None
            or self.hold_until_s is not None
        ):
            return
        match item.command, milestone:
            case mavlink.MAV_CMD_NAV_TAKEOFF, Milestone.TAKEN_OFF:
                self._complete_current(at_s)
            case (
                mavlink.MAV_CMD_NAV_WAYPOINT | mavlink.MAV_CMD_NAV_LOITER_TIME,
                Milestone.REACHED,
            ):
                self._hold(max(0.0, item.params[0]), at_s)
            case mavlink.MAV_CMD_NAV_LAND, Milestone.REACHED if not self._landing:
                self._land(at_s)
            case mavlink.MAV_CMD_NAV_LOITER_TO_ALT, Milestone.UNDERWAY:
                self._follow_way_down()
            case (
                mavlink.MAV_CMD_NAV_LAND | mavlink.MAV_CMD_NAV_RETURN_TO_LAUNCH,
                Milestone.LANDED,
            ):
                self._complete_current(at_s)

    def _current_item(self) -> StoredMissionItem | None:
        return None if self.current is None else self._store.item(self.current)

    def _gave_way(self, items: tuple[StoredMissionItem, ...]) -> bool:
        current = self.current or 0
        return current < len(items) and items[current].command == mavlink.MAV_CMD_NAV_GUIDED_ENABLE

    def _upcoming(self, items: tuple[StoredMissionItem, ...]) -> list[StoredMissionItem]:
        upcoming = [item for item in items[self.current or 0 :] if item.is_navigation]
        return upcoming[:_ITEMS_COMPARED]

    def _begin_from(self, seq: int, now_s: float) -> None:
        """Do what is done at once, and begin the first item that takes time."""
        self.hold_until_s = self._set_seq = None
        self._landing = False
        self.begun = True
        done: list[int] = []
        while (item := self._store.item(seq)) is not None:
            self._pilot.narrator.tell(FirmwareEvent.ITEM_BEGUN, seq=seq, name=item.name)
            if item.is_navigation:
                break
            if item.command == mavlink.MAV_CMD_DO_SET_CAM_TRIGG_DIST:
                self.flight.trigger(item)
                if not self._behaviour.tells_camera:
                    seq += 1
                    continue
            elif item.command in LOOKS:
                self.flight.look(item, now_s)
            elif item.command == mavlink.MAV_CMD_DO_GUIDED_LIMITS:
                self._limit_s = item.params[0]
            elif item.params[1] > 0.0:
                self.flight.change_speed(item.params[1], now_s)
            done.append(seq)
            seq += 1
        # Told once the next item that takes time is begun.
        for each in done:
            self._reached(each, now_s)
        if item is not None:
            self._go_to(seq)
            self._begin(item, now_s)
            return
        self.state = MissionRunState.COMPLETE
        self.repeat_s = None
        self.flight.finish(now_s)

    def _begin(self, item: StoredMissionItem, now_s: float) -> None:
        match item.command:
            case mavlink.MAV_CMD_NAV_TAKEOFF:
                self.flight.take_off(item, now_s)
            case mavlink.MAV_CMD_NAV_GUIDED_ENABLE if item.params[0] == 0.0:
                self._complete_current(now_s)
            case mavlink.MAV_CMD_NAV_GUIDED_ENABLE:
                self.flight.give_way(now_s)
                self.hold_until_s = now_s + self._limit_s if self._limit_s > 0.0 else None
            case mavlink.MAV_CMD_NAV_RETURN_TO_LAUNCH if self._behaviour.forgets_mode:
                self._leave_by_returning(now_s)
            case mavlink.MAV_CMD_NAV_RETURN_TO_LAUNCH:
                self.flight.return_home(now_s)
            case mavlink.MAV_CMD_NAV_LOITER_TO_ALT:
                self.flight.come_down(now_s)
            case mavlink.MAV_CMD_NAV_LAND if item.lat_e7 == 0 and item.lon_e7 == 0:
                self._land(now_s)
            case _:
                self.flight.navigate(item, now_s, passes=self._passes(item))

    def _follow_way_down(self) -> None:
        """The circle is left, and all that follows is one line down."""
        commands = [item.command for item in self._store.items]
        land = mavlink.MAV_CMD_NAV_LAND
        if self._pilot.flight.activity is MotionPhase.LANDING and land in commands:
            self._go_to(commands.index(land))
            self._landing = True

    def _passes(self, item: StoredMissionItem) -> bool:
        """Whether the mission goes on from a place to another without a pause."""
        following = self._store.next_navigation((self.current or 0) + 1)
        after = None if following is None else self._store.item(following)
        waypoint = mavlink.MAV_CMD_NAV_WAYPOINT
        on = item.command == waypoint and after is not None and after.command == waypoint
        return on and not item.params[0] > 0.0

    def _leave_by_returning(self, now_s: float) -> None:
        """Call the item done and leave the mission, for the mode that returns home."""
        seq = self.current or 0
        following = self._store.next_navigation(seq + 1)
        if following is None:
            self._complete_current(now_s)
        else:
            self._reached(seq, now_s)
            self._go_to(following)
        self.flight.return_home(now_s)

    def _go_to(self, seq: int) -> None:
        self.current = self.told = seq

    def _rewind(self) -> None:
        self.state = MissionRunState.NOT_STARTED
        self.current = self._set_seq = None
        self.begun = False
        self.told = 0
        self.repeat_s = None

    def _reached(self, seq: int, at_s: float) -> None:
        self._pilot.outbox.broadcast(mavlink.MAVLink_mission_item_reached_message(seq))
        self._reached_seq = seq
        self._repeats_left = self._behaviour.repeats_reached
        self.repeat_s = at_s + _REPEAT_S if self._repeats_left > 0 else None

    def _land(self, now_s: float) -> None:
        self._landing = True
        self.flight.land(now_s)

    def _hold(self, duration_s: float, now_s: float) -> None:
        if duration_s > 0.0:
            self.hold_until_s = now_s + duration_s
        else:
            self._complete_current(now_s)

    def _complete_current(self, at_s: float) -> None:
        if self.current is None or (item := self._store.item(self.current)) is None:
            return
        seq = self.current
        following = self._store.item(seq + 1)
        # Where returning leaves the mission, that is done at once too, and alone is told; so is
        # the trigger of another component's camera.
        returns = mavlink.MAV_CMD_NAV_RETURN_TO_LAUNCH if self._behaviour.forgets_mode else None
        told = (
            {mavlink.MAV_CMD_DO_SET_CAM_TRIGG_DIST, *LOOKS} if self._behaviour.tells_camera else ()
        )
        if following is None or following.command not in (returns, *told):
            self._reached(seq, at_s)
        if item.command == mavlink.MAV_CMD_NAV_WAYPOINT:
            self._pilot.narrator.tell(FirmwareEvent.WAYPOINT_REACHED, seq=seq)
        self._begin_from(seq + 1, at_s)
