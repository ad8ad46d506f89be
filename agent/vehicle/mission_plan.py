"""One target as a mission that is complete in itself, and how it is started.

Speed, place, patience, home: every such mission has the same items in the same order. So a
vehicle that takes items one by one, as ArduPilot does, holds a complete mission after each of
them: to the old place or to the new one, and then home. The place is one waypoint with a hold
time, since a leg of no length between two is nothing that was seen flown; MISSION_ITEM_REACHED
comes only when the hold is over. Where the firmware flies to single targets better than to
waypoints, the mission gives way to targets for a time before its place, limited by an item
before: firmware carries out only such commands as stand before the item that they are for.

To start it, the current item is put right first, then the mode is set until it is *seen*: PX4
acknowledges the mission mode and does not enter it for up to 2 s after an upload, and both
firmwares go on where an earlier mission was left. What was heard before the mission was verified
counts for nothing. A mission that gives way is begun anew for each target, and then the vehicle is
told the mission's own place by a target; one that does not take it is sent on to the place as an
item.

Protocol: https://mavlink.io/en/services/mission.html#current_mission_item
Commands: https://mavlink.io/en/messages/common.html
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

from agent.vehicle.commands import CommandEnded, CommandOutcome, result_text
from agent.vehicle.conversation import Conversation
from agent.vehicle.firmware.profile import Firmware
from agent.vehicle.messages import (
    AltitudeFrame,
    Heartbeat,
    Inbound,
    MissionCurrent,
    MissionItem,
    MissionSetCurrent,
)

_CMD_NAV_WAYPOINT = 16

_CMD_NAV_RETURN_TO_LAUNCH = 20

_CMD_NAV_GUIDED_ENABLE = 92

_CMD_DO_CHANGE_SPEED = 178

_CMD_DO_GUIDED_LIMITS = 222

_ON = 1.0

_GROUND_SPEED = 1.0

_UNCHANGED = -1.0

LONGEST_HOLD_S = 65_000
"""ArduPilot keeps hold times in 16 bits."""


@dataclass(frozen=True, slots=True)
class MissionSeqs:
    """Numbers of the items; the vehicle's own come first."""

    vehicle_items: int
    gives_way: bool = False
    """Whether it gives way to targets before its own place."""
    corners: int = 0
    """Waypoints on the way to its place; none where it gives way."""

    @property
    def speed(self) -> int:
        """Where the mission is begun."""
        return self.vehicle_items

    @property
    def target(self) -> int:
        """The place to fly to and to wait at."""
        return self.vehicle_items + (3 if self.gives_way else 1) + self.corners

    @property
    def way(self) -> range:
        """The place, and the corners on the way there."""
        return range(self.target - self.corners, self.target + 1)

    @property
    def guided(self) -> int | None:
        """Where it gives way to targets; None where it does not."""
        return self.target - 1 if self.gives_way else None

    @property
    def home(self) -> int:
        """The way home."""
        return self.target + 1

    @property
    def count(self) -> int:
        """Of all items."""
        return self.home + 1


Corner = tuple[float, float, float]
"""Latitude, longitude and height above mean sea level [degrees, degrees, m]."""

MOST_CORNERS = 100
"""Beyond, a path takes too long to be put on a vehicle."""


@dataclass(frozen=True, slots=True)
class MissionPlan:
    """One target, and what to do if nothing follows it."""

    lat_deg: float
    lon_deg: float
    alt_m: float
    """Height above mean sea level."""
    speed_m_s: float
    hold_s: int
    """Wait at the target before going home [s]; firmwares count whole seconds."""
    guided_s: int = 0
    """Time before for which it gives way to targets [s]; 0: it does not."""
    corners: tuple[Corner, ...] = ()
    """Flown through before, without stopping; none where it gives way."""

    def seqs(self, firmware: Firmware) -> MissionSeqs:
        """Numbers of its items."""
        vehicle_items = firmware.mission_vehicle_items
        return MissionSeqs(vehicle_items, self.guided_s > 0, len(self.corners))

    def items(self, firmware: Firmware) -> tuple[MissionItem, ...]:
        """The mission in that firmware's terms."""
        seqs = self.seqs(firmware)
        place = (AltitudeFrame.MEAN_SEA_LEVEL, self.lat_deg, self.lon_deg, self.alt_m)
        nowhere = (AltitudeFrame.NONE, 0.0, 0.0, 0.0)
        speed = (_GROUND_SPEED, self.speed_m_s, _UNCHANGED, 0.0)
        hold = firmware.waypoint_params(float(self.hold_s))
        vehicles = (MissionItem(i, _CMD_NAV_WAYPOINT, *place) for i in range(seqs.vehicle_items))
        way: tuple[MissionItem, ...] = ()
        if seqs.guided is not None:
            limits, on = (float(self.guided_s), 0.0, 0.0, 0.0), (_ON, 0.0, 0.0, 0.0)
            way = (
                MissionItem(seqs.guided - 1, _CMD_DO_GUIDED_LIMITS, *nowhere, limits),
                MissionItem(seqs.guided, _CMD_NAV_GUIDED_ENABLE, *nowhere, on),
            )
        return (
            *vehicles,
            MissionItem(seqs.speed, _CMD_DO_CHANGE_SPEED, *nowhere, speed, current=True),
            *way,
            *self._corner_items(firmware, seqs),
            MissionItem(seqs.target, _CMD_NAV_WAYPOINT, *place, hold),
            MissionItem(seqs.home, _CMD_NAV_RETURN_TO_LAUNCH, *nowhere),
        )

    def _corner_items(self, firmware: Firmware, seqs: MissionSeqs) -> tuple[MissionItem, ...]:
        passed = firmware.waypoint_params(0.0)
        frame = AltitudeFrame.MEAN_SEA_LEVEL
        return tuple(
            MissionItem(seq, _CMD_NAV_WAYPOINT, frame, *corner, passed)
            for seq, corner in zip(seqs.way, self.corners, strict=False)
        )


def _corners_of(way: Sequence[MissionItem]) -> tuple[Corner, ...] | None:
    """The corners that these items are; None if they are none of ours."""
    for item in way:
        waypoint = item.command == _CMD_NAV_WAYPOINT and item.params[0] == 0.0
        if not waypoint or item.frame is not AltitudeFrame.MEAN_SEA_LEVEL:
            return None
    return tuple((item.lat_deg, item.lon_deg, item.alt_m) for item in way)


def recognise_plan(items: Sequence[MissionItem], firmware: Firmware) -> MissionPlan | None:
    """The plan that makes such a mission; None if it is not one of ours."""
    own = firmware.mission_vehicle_items
    if not MissionSeqs(own).count <= len(items) <= MissionSeqs(own, corners=MOST_CORNERS).count:
        return None
    speed, *way, target, home = items[own:]
    gives_way = len(way) == 2 and way[0].command == _CMD_DO_GUIDED_LIMITS
    guided_s = _limit_s(way) if gives_way else 0
    corners = () if gives_way else _corners_of(way)
    commands = (speed.command, target.command, home.command)
    if commands != (_CMD_DO_CHANGE_SPEED, _CMD_NAV_WAYPOINT, _CMD_NAV_RETURN_TO_LAUNCH):
        return None
    hold_s, speed_m_s = target.params[0], speed.params[1]
    ours = (
        target.frame is AltitudeFrame.MEAN_SEA_LEVEL
        and speed.params[2] == _UNCHANGED
        and math.isfinite(hold_s)
        and hold_s >= 1.0
        and speed_m_s > 0.0
    )
    if not ours or guided_s is None or corners is None:
        return None
    place = (target.lat_deg, target.lon_deg, target.alt_m)
    return MissionPlan(*place, speed_m_s, round(hold_s), guided_s, corners)


def _limit_s(way: Sequence[MissionItem]) -> int | None:
    """For how long these items give way to targets; None if they are not ours."""
    limits, guided = way
    commands = (limits.command, guided.command)
    if commands != (_CMD_DO_GUIDED_LIMITS, _CMD_NAV_GUIDED_ENABLE) or guided.params[0] != _ON:
        return None
    return round(limits.params[0]) if limits.params[0] >= 1.0 else None


_MODE_TAG = "mission mode"

_PLACE_TAG = "mission target"

_SPEED_TAG = "mission speed"

_REFUSALS = 2
"""So often a target may be refused: the first time perhaps because it came too early."""

_LOOKS = 2.0
"""Wait that many effect timeouts for the vehicle to say which item it flies."""


class MissionStart:
    """Starts one verified mission, once.

    Args:
        conversation: with the vehicle.
        firmware: what flies it.
        plan: the mission.
        again: begin the mission anew even if its target is what the vehicle flies to.
    """

    def __init__(
        self,
        conversation: Conversation,
        firmware: Firmware,
        plan: MissionPlan,
        *,
        again: bool = False,
    ) -> None:
        self._conversation = conversation
        self._config = config = conversation.config
        self._commands = conversation.commands
        self._firmware = firmware
        self._plan = plan
        self._seqs = plan.seqs(firmware)
        self._first = self._seqs.speed
        """Item to begin with."""
        self._told: set[str] = set()
        """What the vehicle took while the mission gave way."""
        self._place_refusals = 0
        self._began_s = now_s = conversation.now_s
        self._again = again
        self._current: int | None = None
        self._sets = 0
        self._next_set_s = -math.inf
        self._look_until_s = now_s + _LOOKS * config.effect_timeout_s
        self._next_mode_s = -math.inf
        self._mode_tries = 0
        self._refusal = "it is acknowledged, but never seen in the heartbeat"
        self.done = False
        """The vehicle is seen to fly to the target in the mission mode."""
        self.failure: str | None = None

    @property
    def mode_asked(self) -> bool:
        """Whether the vehicle was told to fly missions."""
        return self._mode_tries > 0

    def on_message(self, message: Inbound) -> None:
        """Note which item is current."""
        if isinstance(message, MissionCurrent):
            self._current = message.seq

    def cancel(self) -> None:
        """Tell the vehicle nothing more."""
        for tag in (_PLACE_TAG, _SPEED_TAG):
            self._conversation.cancel(tag)

    def on_ended(self, ended: CommandEnded) -> None:
        """Take the outcome of a command."""
        now_s = self._conversation.now_s
        if ended.tag in (_PLACE_TAG, _SPEED_TAG):
            self._on_told(ended)
        if ended.tag != _MODE_TAG:
            return
        if ended.ending is CommandOutcome.ACCEPTED:
            self._next_mode_s = now_s + self._config.effect_timeout_s / 2.0
        else:
            self._refusal = result_text(ended.result)
            self._next_mode_s = now_s + self._config.retry_delay_s

    def advance(self, heartbeat: Heartbeat, heard_at_s: float) -> None:
        """Do what is still missing; a heartbeat older than the mission proves nothing."""
        if self.done or self.failure is not None:
            return
        seqs, now_s = self._seqs, self._conversation.now_s
        begun = self._current is not None and seqs.speed <= self._current <= seqs.target
        if not self._firmware.is_mission(heartbeat.custom_mode):
            if begun and self._sets:
                self._set_mode(now_s)
            else:
                self._set_current(now_s)
        elif self._again:
            self._set_current(now_s)
        elif self._is_guided and not self._told >= {_PLACE_TAG, _SPEED_TAG}:
            self._guide()
        elif self._is_on_its_way:
            self.done = heard_at_s > self._began_s
        elif not (begun or self._current is None) or now_s >= self._look_until_s:
            self._set_current(now_s)

    def _set_current(self, now_s: float) -> None:
        if now_s < self._next_set_s:
            return
        if self._sets >= self._config.mode_tries:
            if self._current == self._seqs.target:
                self._first = self._seqs.target
                return
            told = "nothing" if self._current is None else f"item {self._current}"
            self.failure = f"the vehicle does not take up the mission, but says it flies {told}"
            return
        self._sets += 1
        self._next_set_s = now_s + self._config.commands.ack_timeout_s
        self._look_until_s = now_s + _LOOKS * self._config.effect_timeout_s
        self._again = False
        self._current = None
        self._told.clear()
        self._conversation.say(MissionSetCurrent(self._first))

    @property
    def _is_guided(self) -> bool:
        """Whether the vehicle, told to begin anew, gives way to targets.

        ArduPilot answers with the number that it was told, and has begun by then.
        """
        guided, current = self._seqs.guided, self._current
        begins = self._sets > 0 and self._first == self._seqs.speed
        if not begins or guided is None or current is None:
            return False
        return self._seqs.speed <= current <= guided

    @property
    def _is_on_its_way(self) -> bool:
        """Whether it is seen to fly to the place, as a target or as the item."""
        if self._current in self._seqs.way:
            # Begun anew it gives way first: this was said before, or its time was over early.
            alone = self._seqs.guided is None or self._sets == 0 or bool(self._told)
            return alone or self._first == self._seqs.target
        begun_before = self._sets == 0 and self._current == self._seqs.guided
        return self._current is not None and (self._is_guided or begun_before)

    def _guide(self) -> None:
        """Tell the vehicle the mission's place as a target, and then the speed."""
        if self._commands.pending(_PLACE_TAG) or self._commands.pending(_SPEED_TAG):
            return
        plan = self._plan
        if _PLACE_TAG in self._told:
            self._conversation.send(_SPEED_TAG, self._firmware.change_speed(plan.speed_m_s))
        else:
            place = (plan.lat_deg, plan.lon_deg, plan.alt_m)
            target = self._firmware.reposition(*place, plan.speed_m_s)
            self._conversation.send(_PLACE_TAG, target)

    def _on_told(self, ended: CommandEnded) -> None:
        if ended.ending is CommandOutcome.ACCEPTED:
            self._told.add(ended.tag)
            return
        self._current = None  # to be heard again, as it may not give way yet, or any more
        self._place_refusals += 1
        unanswered = ended.ending is CommandOutcome.UNANSWERED
        if unanswered or ended.tag == _SPEED_TAG or self._place_refusals >= _REFUSALS:
            self._first, self._sets = self._seqs.target, 0
            self._again = True

    def _set_mode(self, now_s: float) -> None:
        if self._commands.pending(_MODE_TAG) or now_s < self._next_mode_s:
            return
        if self._mode_tries >= self._config.mode_tries:
            self.failure = f"the mission mode cannot be set ({self._refusal})"
            return
        self._mode_tries += 1
        self._conversation.send(_MODE_TAG, self._firmware.set_mission_mode())
