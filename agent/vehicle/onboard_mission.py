"""The mission that stands on one vehicle: put in force, flown, kept from running out.

It outlives the legs. While the vehicle waits at its target, the wait is renewed by the
same mission with another hold time, which both firmwares take for a changed one and begin
anew; so the vehicle comes home by itself only if nobody renews it any more. After a failed
upload the vehicle goes on with the mission verified before. Leaves out: judging arrival
(agent.vehicle.leg), who may command the vehicle (agent.vehicle.bridge), and ground
stations that change the mission while it is flown.

Where the mission gives way to targets first, its hold begins when that time is over, or later:
what is said here of the hold counts from when the vehicle is near, so it is never too late.

Protocol: https://mavlink.io/en/services/mission.html
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import replace
from enum import Enum, auto

from agent.vehicle.commands import CommandEnded
from agent.vehicle.conversation import Conversation
from agent.vehicle.firmware.profile import Firmware
from agent.vehicle.messages import Heartbeat, Inbound, MissionCurrent, MissionReached, Outbound
from agent.vehicle.mission_plan import (
    LONGEST_HOLD_S,
    MOST_CORNERS,
    MissionPlan,
    MissionSeqs,
    MissionStart,
    recognise_plan,
)
from agent.vehicle.mission_transfer import (
    MissionFailed,
    MissionInForce,
    MissionPolicy,
    MissionRead,
    MissionTransfer,
)
from swarm.model.frames import enu_from_wgs84, wgs84_from_enu
from swarm.protocol.fields import Point
from swarm.protocol.timing import earliest

_RENEWAL_FRAC = 0.5
"""The wait is renewed when that share of the patience is left."""
_SPARE_S, _SPARE = 10.0, 1.5
"""A mission gives way for that long, and for so many times the flight [s]."""
_LEAST_CLIMB_M_S = 1.0
_HOLD_SLACK_S = 2.0
"""A hold may end that much earlier than it seems: it begins before the mission is read back."""


class _Stage(Enum):
    IDLE = auto()
    """Nothing is wanted of the mission."""
    UPLOADING_FIRST = auto()
    """Uploaded to stand on the vehicle, and not to be flown yet."""
    UPLOADING = auto()
    STARTING = auto()
    FLOWN = auto()


class OnboardMission:
    """What one vehicle does if it hears nothing more.

    Args:
        conversation: with the vehicle.
        firmware: which it is.
        free_line: called before a transfer begins, to end any other one.
    """

    def __init__(
        self,
        conversation: Conversation,
        firmware: Firmware,
        free_line: Callable[[], None] = lambda: None,
    ) -> None:
        self._conversation = conversation
        self._free_line = free_line
        self._config = config = conversation.config
        self._firmware = firmware
        vehicle_items = firmware.mission_vehicle_items
        self._transfer = MissionTransfer(
            MissionPolicy(config.mission_reply_timeout_s, config.mission_tries, vehicle_items)
        )
        self._near_m = max(config.reached_radius_m, config.acceptance_radius_m)
        self._stage = _Stage.IDLE
        self._wanted: MissionPlan | None = None
        self._sent: MissionPlan | None = None
        """What the transfer under way carries; None while it carries nothing of ours."""
        self._standing: MissionPlan | None = None
        """What was verified last."""
        self._start: MissionStart | None = None
        self._place_enu_m: Point | None = None
        self._mode_seen = False
        """The vehicle flies missions, and nothing but a pilot or its own return changes that."""
        self._awaited = False
        """Somebody still waits for the vehicle to arrive: the wait there is not renewed yet."""
        self._renewing = False
        self._inherited = False
        """The mission flown is an earlier life's."""
        self._mode_asked = False
        """The vehicle may take up the mission mode because of us."""
        self._renew_at_s = -math.inf
        self._look_at_s = -math.inf
        self._begun_s = 0.0
        self._near_since_s: float | None = None
        """When the hold may have begun."""
        self.reached = False
        """The vehicle says that it reached the target, and it is near."""
        self.failure: str | None = None
        """Why the newest target is not flown to; None while it may be."""
        self.unverified = False
        """The vehicle flies missions, and which one is not known: it should be stopped."""
        self.coming_home = False
        """The wait at the target ran out, and the mission's own return began."""
        self._current: int | None = None
        """Item that the vehicle says it flies, since the mission was begun."""
        self.takings = 0
        """How often the vehicle was seen to take up a mission."""
        self.is_ours: bool | None = None
        """Whether the mission found on the vehicle is one of ours; None before it is known."""

    # What is wanted.

    @property
    def is_flown(self) -> bool:
        """Whether the newest target is what the vehicle is seen to fly to, or to wait at."""
        return self._stage is _Stage.FLOWN and self._wanted == self._standing

    @property
    def is_past_corners(self) -> bool:
        """Whether it flies to the place itself; by its own word where corners lead there."""
        standing = self._standing
        if standing is None or not standing.corners:
            return True
        return self._current == standing.seqs(self._firmware).target

    @property
    def has_corners(self) -> bool:
        """Whether what stands on the vehicle leads there by corners."""
        return self._standing is not None and bool(self._standing.corners)

    def fly_to(
        self,
        target_enu_m: Point,
        stay_s: float,
        speed_m_s: float,
        via_enu_m: Sequence[Point] = (),
    ) -> None:
        """Put a target in force, in place of the last one, and the corners on the way there.

        By corners it is flown as it stands, for only so it is flown to the end if the agent dies.
        """
        hold_s = math.ceil(stay_s + self._config.mission_patience_s)
        place = wgs84_from_enu(self._config.origin, target_enu_m)
        guided_s = 0 if via_enu_m else self._guided_s(target_enu_m, speed_m_s)
        corners = tuple(wgs84_from_enu(self._config.origin, corner) for corner in via_enu_m)
        wait_s = min(max(1, hold_s), LONGEST_HOLD_S)
        plan = MissionPlan(*place, speed_m_s, wait_s, guided_s, corners)
        self._awaited, self._renewing = True, False
        self.failure, self.reached, self.unverified = None, False, False
        if self._stage is _Stage.IDLE and self._mode_seen:
            # It was being taken out of the mission mode: whether it was is still to be seen.
            self._mode_seen, self._mode_asked = False, True
        self._conversation.say(*self._want(plan))

    def upload(self, target_enu_m: Point, speed_m_s: float) -> list[Outbound]:
        """Put a first target on the vehicle, which flies to it once it is told to `begin`."""
        if self._stage is _Stage.UPLOADING_FIRST:
            return []
        place = wgs84_from_enu(self._config.origin, target_enu_m)
        hold_s = min(math.ceil(self._config.mission_patience_s), LONGEST_HOLD_S)
        self.failure = None
        guided_s = self._guided_s(target_enu_m, speed_m_s)
        out = self._want(MissionPlan(*place, speed_m_s, max(1, hold_s), guided_s))
        self._stage = _Stage.UPLOADING_FIRST
        return out

    def begin(self) -> None:
        """Fly the mission that was uploaded."""
        if self.is_uploaded:
            self._begin()

    @property
    def is_uploaded(self) -> bool:
        """Whether a mission of ours was verified on the vehicle, and is not flown yet."""
        return self._stage is _Stage.IDLE and self._standing is not None

    @property
    def is_uploading(self) -> bool:
        """Whether the first mission is on its way to the vehicle."""
        return self._stage is _Stage.UPLOADING_FIRST

    @property
    def is_transferring(self) -> bool:
        """Whether a mission is on its way to the vehicle, or read from it."""
        return self._transfer.busy

    @property
    def may_be_flown(self) -> bool:
        """Whether the vehicle may be in the mission mode because of us."""
        return self._mode_seen or self._mode_asked

    def restart(self) -> None:
        """Begin the mission anew: the vehicle stands still elsewhere than at its target."""
        if self._stage is _Stage.FLOWN:
            self._begin(again=True)

    def wait_there(self) -> None:
        """The leg is over: keep the vehicle waiting until something else is wanted."""
        self._awaited = False

    def suspend(self) -> None:
        """The vehicle is to be taken out of the mission mode; a transfer under way goes on."""
        self._stage = _Stage.IDLE
        self._wanted = self._start = None
        self._awaited = self._renewing = False
        self.unverified = self.coming_home = False

    def stand_down(self) -> None:
        """The vehicle flies in another mode, or is going to; what stands on it just stands."""
        self.suspend()
        self._mode_asked = self._mode_seen = False

    def call_off(self) -> None:
        """The vehicle goes home: it is to fly no mission, and an upload under way ends here."""
        self.stand_down()
        self._conversation.say(*self._transfer.cancel("the vehicle goes home"))
        self._settle()

    def carry_on(self) -> None:
        """The vehicle could not be taken out of the mission mode after all."""
        if self._mode_seen and self._standing is not None:
            self._stage, self._wanted = _Stage.FLOWN, self._standing

    def abort(self, reason: str) -> None:
        """Say nothing more, because link or vehicle are somebody else's."""
        self.stand_down()
        self._sent = self.is_ours = None
        self._transfer.abort(reason)

    def look(self) -> None:
        """Ask which mission the vehicle flies; `is_ours` tells."""
        now_s = self._conversation.now_s
        if self._transfer.busy or self.is_ours is not None or now_s < self._look_at_s:
            return
        self._look_at_s = now_s + self._config.retry_delay_s
        own = self._firmware.mission_vehicle_items
        counts = {MissionSeqs(own, corners=corners).count for corners in range(MOST_CORNERS + 1)}
        self._free_line()
        self._conversation.say(*self._transfer.read(counts, now_s))

    def expects(self, custom_mode: int) -> bool:
        """Whether that mode is the mission's doing; else somebody switched to it."""
        firmware = self._firmware
        if firmware.is_mission(custom_mode):
            return self._mode_seen or self._mode_asked
        if firmware.is_commanded(custom_mode):
            return not self._mode_seen
        if firmware.is_returning(custom_mode) and self._mode_seen and self._hold_is_over:
            self.coming_home = True
        return self.coming_home

    # What happens.

    def on_message(self, message: Inbound) -> None:
        """Take what concerns missions."""
        if isinstance(message, MissionCurrent):
            self._current = message.seq
        if self._start is not None:
            self._start.on_message(message)
        elif self._stage is _Stage.FLOWN and self._standing is not None:
            seqs = self._standing.seqs(self._firmware)
            match message:
                case MissionCurrent(seq) if seq == seqs.home:
                    self.coming_home = True
                case MissionReached(seq) if seq == seqs.target:
                    self._on_reached()
                case _:
                    pass
        self._conversation.say(*self._transfer.on_message(message, self._conversation.now_s))
        self._settle()

    def on_ended(self, ended: CommandEnded) -> None:
        """Take a command's outcome."""
        if self._start is not None:
            self._start.on_ended(ended)

    def on_position(self, position_enu_m: Point) -> None:
        """Note how near the vehicle is."""
        self._place_enu_m = position_enu_m
        flown = self._stage in (_Stage.STARTING, _Stage.FLOWN)
        if flown and self._near_since_s is None and self._is_near():
            # Of a mission that an earlier life left, the hold may have begun long ago.
            self._near_since_s = -math.inf if self._inherited else self._conversation.now_s

    def advance(self, heartbeat: Heartbeat, heard_at_s: float) -> None:
        """Do what state and time ask for."""
        self._conversation.say(*self._transfer.on_time(self._conversation.now_s))
        self._settle()
        start = self._start
        if self._stage is _Stage.STARTING and start is not None:
            start.advance(heartbeat, heard_at_s)
            self._mode_asked |= start.mode_asked
            if start.done:
                start.cancel()
                self._stage, self._start = _Stage.FLOWN, None
                self.takings += 1
                self._mode_seen, self._renewing, self._inherited = True, False, False
            elif start.failure is not None:
                in_mission = self._firmware.is_mission(heartbeat.custom_mode)
                self._give_up(start.failure, astray=in_mission)
        elif self._stage is _Stage.IDLE and self._mode_asked:
            # Given up, and then the vehicle took it up after all.
            self.unverified |= self._firmware.is_mission(heartbeat.custom_mode)
        if self._stage is _Stage.FLOWN:
            self._renew_in_time()

    def next_deadline_s(self) -> float | None:
        """When `advance` has something to do, beside what follows from news."""
        return earliest(self._transfer.next_deadline_s(), self._renewal_s())

    @property
    def is_starting(self) -> bool:
        """Whether `advance` should look often."""
        return self._stage is _Stage.STARTING

    # Pieces.

    def _want(self, plan: MissionPlan) -> list[Outbound]:
        if plan == self._standing:
            # Neither firmware begins an identical mission anew.
            plan = replace(plan, hold_s=plan.hold_s + 1)
        if self._start is not None:
            self._start.cancel()
        self._wanted, self._start = plan, None
        self._stage = _Stage.UPLOADING
        self.coming_home = False
        return [] if self._transfer.busy else self._upload(plan)

    def _upload(self, plan: MissionPlan) -> list[Outbound]:
        self._sent = plan
        self._free_line()
        return self._transfer.upload(plan.items(self._firmware), self._conversation.now_s)

    def _settle(self) -> None:
        """Take the outcome of a transfer, once."""
        if self._transfer.busy or self._transfer.result is None:
            return
        result, self._transfer.result = self._transfer.result, None
        sent, self._sent = self._sent, None
        if isinstance(result, MissionRead):
            self._adopt(result)
        elif isinstance(result, MissionInForce):
            self._standing = sent
        laying = self._stage is _Stage.UPLOADING_FIRST
        if self._wanted is None or not (laying or self._stage is _Stage.UPLOADING):
            return
        if sent != self._wanted:
            self._conversation.say(*self._upload(self._wanted))
        elif isinstance(result, MissionFailed):
            self._give_up(result.reason, astray=not result.old_mission_verified)
        elif laying:
            self._stage = _Stage.IDLE
        else:
            # One that gives way is not taken up by itself: it goes on as it was begun.
            plan = self._wanted
            anew = plan.guided_s > 0 or (
                bool(plan.corners) and not self._firmware.missions_begin_anew
            )
            self._begin(again=anew and not self._renewing)

    def _begin(self, *, again: bool = False) -> None:
        plan = self._standing
        if plan is not None:
            self._stage = _Stage.STARTING
            self._begun_s, self._near_since_s = self._conversation.now_s, None
            self._current = None
            self._start = MissionStart(self._conversation, self._firmware, plan, again=again)

    def _give_up(self, reason: str, *, astray: bool) -> None:
        """The wanted mission is not flown: go on with the one that stands, if it may.

        Of a vehicle ``astray`` it is not known what it flies in the mission mode: it may not.
        """
        failed_to_start = self._start is not None
        self._start = None
        if self._renewing:
            # Old or new, it is the same place with the way home behind it.
            self._renewing, astray = False, False
            self._renew_at_s = self._conversation.now_s + self._config.retry_delay_s
        else:
            self.failure = reason
        self._awaited = False
        self._wanted = self._standing
        if astray and (self._mode_seen or failed_to_start):
            self.unverified = True
            self._stage = _Stage.IDLE
        elif self._mode_seen and self._standing is not None and not failed_to_start:
            self._begin()
        else:
            self._stage = _Stage.FLOWN if self._mode_seen else _Stage.IDLE

    def _adopt(self, read: MissionRead) -> None:
        """Take on a mission that an earlier life left on the vehicle."""
        plan = recognise_plan(read.items, self._firmware)
        self.is_ours = plan is not None
        if plan is None:
            return
        self._transfer.in_force = read.items
        self._wanted = self._standing = plan
        self._stage, self._mode_seen = _Stage.FLOWN, True
        # Renewed once it is known that it is to wait: it may be called home.
        self._inherited = self._awaited = True
        self._begun_s, self._near_since_s = self._conversation.now_s, None

    def _guided_s(self, target_enu_m: Point, speed_m_s: float) -> int:
        """How long a mission gives way to targets: for the flight, with something to spare."""
        if not self._firmware.missions_give_way:
            return 0
        place_enu_m = self._place_enu_m
        if place_enu_m is None:
            return min(math.ceil(_SPARE_S + self._config.mission_patience_s), LONGEST_HOLD_S)
        climb_s = abs(target_enu_m[2] - place_enu_m[2]) / _LEAST_CLIMB_M_S
        flight_s = math.dist(target_enu_m, place_enu_m) / speed_m_s + climb_s
        return min(math.ceil(_SPARE_S + _SPARE * flight_s), LONGEST_HOLD_S)

    def _on_reached(self) -> None:
        """The item is done, which it cannot be before its hold time: else it is an echo."""
        standing, now_s = self._standing, self._conversation.now_s
        if standing is None or now_s < self._begun_s + standing.hold_s - _HOLD_SLACK_S:
            return
        self.reached = self._awaited and self._is_near()
        self.coming_home = True

    def _is_near(self) -> bool:
        standing, place_enu_m = self._standing, self._place_enu_m
        if standing is None or place_enu_m is None:
            return False
        target_enu_m = enu_from_wgs84(
            self._config.origin, standing.lat_deg, standing.lon_deg, standing.alt_m
        )
        return math.dist(place_enu_m, target_enu_m) <= self._near_m

    @property
    def _hold_is_over(self) -> bool:
        near_s, standing = self._near_since_s, self._standing
        if near_s is None or standing is None:
            return False
        return self._conversation.now_s >= near_s + standing.hold_s - _HOLD_SLACK_S

    def _renewal_s(self) -> float | None:
        """When the wait is to be renewed; None while there is nothing to renew."""
        near_s, standing = self._near_since_s, self._standing
        flown = self._stage is _Stage.FLOWN and not self.coming_home
        if near_s is None or standing is None or self._awaited or not flown:
            return None
        out_s = near_s + standing.hold_s - _RENEWAL_FRAC * self._config.mission_patience_s
        return max(out_s, self._renew_at_s)

    def _renew_in_time(self) -> None:
        due_s, standing = self._renewal_s(), self._standing
        if due_s is None or standing is None or self._conversation.now_s < due_s:
            return
        self._renewing = True
        # Up and down in turn, so that it always differs and never grows.
        hold_s = standing.hold_s + (-1 if standing.hold_s % 2 else 1)
        self._conversation.say(*self._want(replace(standing, hold_s=max(1, hold_s))))
