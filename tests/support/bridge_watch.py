"""What must hold after every step of a bridge, whatever it hears: all of it in one place.

1. It never raises (who steps it sees to that).
2. All it sends are whole MAVLink frames of its own, addressed to the configured vehicle
   and to nobody else.
3. Of the commands there are only those of its phase, and those give what was ordered: a
   mode of ours, motors, a takeoff and targets.
4. A target lies within the fence and is one that was ordered, or, while the vehicle is
   being stopped, where it said it was since the order, or the nearest place within the
   fence; and that is in reach of another place that it told. One that an earlier life may
   have left climbing may be sent above where it said it was. What names no place is a
   pause, only told to stop a vehicle.
5. After a hand-over it says nothing but heartbeats and requests for messages, until it is
   given a new order.
6. What goes home, or is not known to be ours, is given no mission; one that was being given to
   a vehicle on the ground is given whole, or cleared.
7. It reports what was asked for: the leg under way, once; numbers that are numbers.
8. It wants to be called again within a heartbeat's interval, and not at once for ever.
9. It remembers no more for hearing more.
10. What it makes the vehicle do next may follow what it made it do before.
11. No target lies in a zone, nor straight behind one from wherever the vehicle said it was or was
   sent, unless that is in the zone too.
12. A fence is put on a vehicle of corners of zones that were told, outside of which it has been,
and neither where it stands at a base nor once it is somebody else's.
13. A vehicle that has landed for another battery is not told anything, and its motors are not
   started before somebody has let it start again since.

Leaves out: whether it does anything useful.
"""

from __future__ import annotations

import math
from collections import deque
from dataclasses import dataclass, field, replace
from typing import Any

from pymavlink.dialects.v20 import ardupilotmega as mavlink

from agent.core.interface import (
    Arrived,
    GiveWay,
    GoTo,
    HandedOver,
    HandOverExplained,
    HeardAgain,
    Hold,
    KeepOut,
    Landed,
    Prepare,
    Ready,
    Refused,
    Return,
    Swap,
    Swapped,
    Telemetry,
    VehicleReady,
    VehicleReport,
)
from agent.vehicle.activity import FlightPhase
from agent.vehicle.bridge import Bridge
from agent.vehicle.config import BridgeConfig, CommandStyle
from agent.vehicle.conversation import BridgeAction, SendBytes
from agent.vehicle.firmware.ardupilot import ArduCopter
from agent.vehicle.firmware.px4 import Px4Copter
from agent.vehicle.later_messages import AVAILABLE_MODES_ID
from agent.vehicle.session import BridgeEvent, TimePassed
from agent.vehicle.transitions import SUCCESSORS
from swarm.model.frames import enu_from_wgs84
from tests.support.bridge_memory import see_buffer, see_memory
from tests.support.broken_rule import BrokenError, hold
from tests.support.fake_copter import (
    ASK,
    INTERVAL,
    FakeCopter,
)
from tests.support.fake_fences import FENCE
from tests.support.fake_px4 import FakePx4
from tests.support.phase_commands import (
    COMMANDS,
    COMMANDS_OF_MISSIONS,
    GIVES_WAY,
    IN_OUR_HANDS,
    LIMITS,
    LOOK_AHEAD,
    LOOK_AT,
    MISSION_ITEMS,
    MISSION_MESSAGES,
    MISSION_READING,
    TRIGGER,
    WAYPOINT,
    WITHOUT_MISSION,
)
from tests.support.zone_watch import TOLERANCE_M, Point, ZoneWatch

_MODE_ENABLED = 1.0
_PLACES = 50
_CLIMB_ASIDE_M = 0.5
_FASTEST_M_S = 50.0
_RECENT = 20
_LEAP_M = 25.0
"""Two places that a vehicle told are farther apart only if it was somewhere else."""
_FAKES: dict[type, type[FakeCopter]] = {ArduCopter: FakeCopter, Px4Copter: FakePx4}


def _is_of_fence(message: Any) -> bool:
    """Whether it is about the vehicle's own fence, which moves nothing."""
    match message.get_type():
        case "PARAM_REQUEST_READ":
            return True
        case "COMMAND_LONG":
            return bool(message.command == mavlink.MAV_CMD_DO_FENCE_ENABLE)
        case _:
            return bool(getattr(message, "mission_type", None) == mavlink.MAV_MISSION_TYPE_FENCE)


@dataclass(frozen=True, slots=True)
class _Task:
    """What a bridge has been ordered to do."""

    places_m: tuple[Point, ...] = ()
    """Where the vehicle may be sent: the last places ordered. An older mission stays in force
    if the vehicle does not take a newer one, and may be taken up again after a hand-over."""
    leg: int | None = None
    """Under way."""
    climbs: bool = False
    """An earlier life had it in the air: it may climb from where it is."""
    base_m: Point | None = None
    """Where to land for another battery."""
    told_m: list[tuple[Point, float]] = field(default_factory=list)
    """Where the vehicle said it was when it was ordered, and since; and when."""


class BridgeWatch:
    """Watches one bridge from its beginning.

    Args:
        bridge: steps are taken through `step` only.
        fake: the kind of vehicle it flies, for the numbers of modes; a heartbeat that says
            otherwise is believed as long as the vehicle is not flown.
    """

    def __init__(self, bridge: Bridge, fake: type[FakeCopter]) -> None:
        self.bridge = bridge
        self.fake = fake
        self.steps = 0
        self._parser = mavlink.MAVLink(None)
        self._heres_m: deque[tuple[Point, float]] = deque(maxlen=_RECENT)
        """Where the vehicle last said it was, and when."""
        self._now_s = 0.0
        self._task = _Task()
        self._task_before = self._task
        """As it was before this step."""
        self._ordered: object = None
        """In this step."""
        self._gave_mission = False
        """Whether the vehicle has been given a mission since the last return."""
        self._prepared = False
        """Whether `Prepare` has been ordered and not been answered."""
        self._silent = False
        """Handed over, and nothing ordered since."""
        self._lost = False
        """Handed over for its silence, and neither heard again nor handed over otherwise since."""
        self._heard_again = False
        """Since it was handed over."""
        self._mode_wanted: set[tuple[float, float]] = set()
        self._zones = ZoneWatch(bridge)
        self._base_m: Point | None = None
        """Where it was last ordered to land for another battery."""
        self._swap_leg: int | None = None
        """Number of that order."""
        self._swap_before: tuple[Point | None, int | None] = None, None
        """As these were before this step."""
        self._stood = self._may_start = False
        """Whether it landed there and has not flown since, and may start again."""
        self._left_m: tuple[Point, ...] = ()
        """Corners of the mission that an earlier life left on the vehicle, which is told anew."""

    def step(self, event: BridgeEvent, now_s: float) -> list[BridgeAction]:
        """Step the bridge and look at what it does."""
        self.steps += 1
        self._now_s = now_s
        before = self.bridge.phase
        self._task_before, self._ordered = self._task, event
        self._swap_before = self._base_m, self._swap_leg
        if isinstance(event, Prepare | GoTo | Hold | Return | Swap):
            self._note(event)
        elif isinstance(event, KeepOut):
            self._zones.tell(event)
        elif isinstance(event, GiveWay):
            places_m = (*self._task.places_m[-_PLACES:], *event.path_enu_m)
            self._task = replace(self._task, places_m=places_m)
        elif isinstance(event, Ready):
            let = before is FlightPhase.STANDING and event.leg == self._swap_leg
            self._may_start |= let
        self._gave_mission &= not isinstance(event, Return)
        actions = self.bridge.step(event, now_s)
        self.fake = _FAKES.get(type(self.bridge._session.firmware), self.fake)
        self._see_what_was_left()
        after = self.bridge.phase
        if after not in (FlightPhase.STANDING, FlightPhase.PREPARING):
            self._stood = self._may_start = False
        follows = after is before or after in SUCCESSORS[before]
        hold(follows, f"{after.value} follows {before.value}")
        for action in actions:
            if isinstance(action, SendBytes):
                self._look_at(self._decoded(action.data), before, after)
            else:
                self._take(action)
        actions += self._see_deadline(now_s)
        if self.steps % 500 == 0:
            see_memory(self.bridge)
        see_buffer(self.bridge)
        return actions

    def _note(self, order: Prepare | GoTo | Hold | Return | Swap) -> None:
        self._silent = False
        places_m = self._task.places_m
        if isinstance(order, GoTo | Return):
            corners_m = order.via_enu_m if isinstance(order, GoTo) else order.path_enu_m
            places_m += corners_m
            if self._stood and self._base_m is not None and isinstance(order, GoTo):
                first_m = (*corners_m, order.position_enu_m)[0]
                places_m += ((*self._base_m[:2], first_m[2]),)
        match order:
            case Prepare(position_enu_m, left_in_air=climbs):
                self._prepared = True
                self._task = _Task((*places_m[-_PLACES:], position_enu_m), climbs=climbs)
            case GoTo(leg, position_enu_m):
                self._task = _Task((*places_m[-_PLACES:], position_enu_m), leg)
            case Return(via_enu_m=tuple() as via_enu_m):
                self._task = _Task((*places_m[-_PLACES:], via_enu_m))
            case Swap(leg, position_enu_m):
                self._base_m, self._swap_leg = position_enu_m, leg
                self._task = _Task(places_m, leg, base_m=position_enu_m)
            case Hold() if self.bridge.phase is FlightPhase.STANDING:
                pass  # it stands already, and is looked after as before
            case Hold() | Return():
                self._task = _Task(places_m)
        self._task.told_m.extend(self._heres_m)

    # What it sends.

    def _decoded(self, data: bytes) -> Any:
        messages = self._parser.parse_buffer(data) or []
        hold(len(messages) == 1, f"sent {len(messages)} messages as one: {data.hex()}")
        message = messages[0]
        config = self.bridge.config
        sender = (message.get_srcSystem(), message.get_srcComponent())
        hold(sender == (config.ground_system_id, config.ground_component_id), f"sent as {sender}")
        if message.get_type() != "HEARTBEAT":
            target = (message.target_system, message.target_component)
            hold(target == (config.system_id, 1), f"{message.get_type()} sent to {target}")
        return message

    def _look_at(self, message: Any, before: FlightPhase, after: FlightPhase) -> None:
        name = message.get_type()
        phases = {before, after}
        missions = self.bridge.config.command is CommandStyle.MISSION
        if name == "HEARTBEAT":
            hold(message.type == mavlink.MAV_TYPE_GCS, f"heartbeat of type {message.type}")
            return
        if name == "COMMAND_LONG" and message.command == INTERVAL:
            hold(message.param2 > 0.0, f"message interval {message.param2}")
            return
        if name == "COMMAND_LONG" and message.command == ASK:
            hold(message.param1 == AVAILABLE_MODES_ID, f"asks for message {message.param1}")
            return
        if name in ("PARAM_REQUEST_READ", "PARAM_SET") and message.param_id in self.fake.jerk_names:
            self._see_jerk(message)
            return
        fences = self._heard_again and _is_of_fence(message)  # it is ours, without an order yet
        hold(fences or not self._silent, f"{name} after a hand-over: {message}")
        if getattr(message, "mission_type", 0) == FENCE:
            places_m = [*self._heres_m, *self._task.told_m]
            self._zones.see_fence(name, message, phases, places_m)
            return
        if name == "PARAM_REQUEST_READ" and message.param_id in self.fake.fence_names:
            hold(self._zones.any_told, "asks for its fence, though there is no zone")
        elif name in ("PARAM_REQUEST_READ", "PARAM_SET"):
            hold(FlightPhase.PREPARING in phases, f"{name} while {before}, {after}")
            readable = self.fake.failsafe_names | self.fake.limit_names
            read = readable if name == "PARAM_REQUEST_READ" else frozenset()
            known = message.param_id in read or message.param_id in self.fake.speed_names
            hold(known, f"{name} of {message.param_id}")
        elif name in MISSION_MESSAGES:
            hold(missions, f"{name}, though commanded by targets")
            if name not in MISSION_READING:
                self._see_giving(name, phases)
            if name == "MISSION_ITEM_INT":
                hold(message.command in MISSION_ITEMS, f"mission item {message.command}")
                if message.command == WAYPOINT:
                    self._see_place(message, phases)
                elif message.command in (LIMITS, GIVES_WAY):
                    hold(self.fake is FakeCopter, "an item that it does not know")
                    hold(message.param1 >= 1.0, f"gives way for {message.param1} s")
        elif name in ("COMMAND_LONG", "COMMAND_INT"):
            self._see_command(message, phases, missions=missions)
        else:
            hold(False, f"sends {name}")

    def _see_jerk(self, message: Any) -> None:
        """Raised in flight only; put back at any time, even after a hand-over: it moves nothing."""
        firmware = self.bridge._session.firmware
        override_spec = None if firmware is None else firmware.override_spec
        hold(override_spec is not None, f"{message.param_id} of a vehicle that needs no other")
        if message.get_type() == "PARAM_SET" and override_spec is not None:
            raised = message.param_value > override_spec.value
            hold(message.param_value <= 1.01 * override_spec.value, f"jerk {message.param_value}")
            hold(not (raised and self._silent), "jerk raised after a hand-over")

    def _see_giving(self, name: str, phases: set[FlightPhase]) -> None:
        """What a vehicle that is no longer prepared was being given is given whole, or cleared."""
        hold(not isinstance(self._ordered, Return), f"{name} in the step of a return")
        if phases <= WITHOUT_MISSION:
            ends = self._gave_mission and name != "MISSION_SET_CURRENT"
            hold(phases == {FlightPhase.IDLE} and ends, f"{name} {phases}")
        self._gave_mission = True

    def _see_command(self, message: Any, phases: set[FlightPhase], *, missions: bool) -> None:
        allowed = set[int]().union(*(COMMANDS[phase] for phase in phases))
        if missions:
            allowed |= set[int]().union(*(COMMANDS_OF_MISSIONS.get(p, set()) for p in phases))
        if phases & IN_OUR_HANDS:
            allowed |= {TRIGGER, LOOK_AHEAD}
        if FlightPhase.FLYING in phases:
            allowed.add(LOOK_AT)
        hold(message.command in allowed, f"commands {message.command} while {phases}")
        match message.command:
            case 192:
                if message.get_type() == "COMMAND_INT":
                    self._see_place(message, phases)
                else:
                    self._see_pause(message, phases)
            case 22:
                self._see_takeoff(message)
            case 400:
                hold(message.param1 in (0.0, 1.0), f"motors {message.param1}")
                hold(message.param2 == 0.0, "motors by force")
                if message.param1 == 1.0:
                    hold(FlightPhase.PREPARING in phases, f"motors started while {phases}")
                    may_start = self._may_start or not self._stood
                    hold(may_start, "motors started at a base, though nobody let it start")
            case 176:
                hold(message.param1 == _MODE_ENABLED, f"mode of kind {message.param1}")
                self._see_mode(message, phases, missions=missions)
            case 206:
                hold(message.param1 in (0.0, 15.0), f"pictures every {message.param1} m")
                flies = FlightPhase.FLYING in phases
                hold(flies or message.param1 == 0.0, f"pictures while {phases}")
            case 207:
                hold(self.fake is FakeCopter, "switches a fence that has no switch")
                hold(message.param2 == 4.0, f"switches fences {message.param2}")
            case 178:
                hold(0.0 < message.param2 < 100.0, f"speed {message.param2} m/s")

    def _see_mode(self, message: Any, phases: set[FlightPhase], *, missions: bool) -> None:
        """The guided mode, that of missions if there are, and that of the return for it."""
        mode = int(message.param2)
        if self.fake.autopilot == mavlink.MAV_AUTOPILOT_PX4:
            mode = mode << 16 | int(message.param3) << 24
        if mode == self.fake.return_mode:
            hold(FlightPhase.RETURNING in phases, f"sent home while {phases}")
        elif mode == self.fake.land_mode:
            comes_down = {FlightPhase.RETURNING, FlightPhase.LANDING} & phases
            hold(bool(comes_down), f"landed while {phases}")
        elif mode != self.fake.own_mode:
            hold(missions and mode == self.fake.mission_mode, f"mode {mode}")

    def _see_what_was_left(self) -> None:
        mission, origin = self.bridge._session.mission, self.bridge.config.origin
        if mission is not None and mission._inherited and mission._standing is not None:
            left = mission._standing
            place = left.lat_deg, left.lon_deg, left.alt_m
            self._left_m = tuple(enu_from_wgs84(origin, *c) for c in (*left.corners, place))

    def _see_place(self, message: Any, phases: set[FlightPhase]) -> None:
        config = self.bridge.config
        place_m = enu_from_wgs84(config.origin, message.x / 1e7, message.y / 1e7, message.z)
        hold(math.isfinite(message.z), f"sent to height {message.z}")
        fault = config.out_of_bounds(place_m)
        hold(fault is None, f"sent beyond the fence, to {place_m}: {fault}")
        if FlightPhase.HOLDING in phases and self._is_borne_out(place_m):
            return
        places_m, base_m = self._task.places_m, self._task.base_m
        ordered = any(_near(place_m, place) for place in (*places_m, *self._left_m))
        if FlightPhase.LANDING in phases and base_m is not None:
            ordered |= math.dist(place_m[:2], base_m[:2]) <= TOLERANCE_M
        if self._task.climbs:
            here_m = [told_m for told_m, _ in self._task.told_m]
            ordered |= any(
                math.dist(place_m[:2], told_m[:2]) <= _CLIMB_ASIDE_M for told_m in here_m
            )
        from_m = [told for told, _ in (*self._task.told_m, *self._heres_m)]
        self._zones.see_way(place_m, [*from_m, *self._task.places_m])
        hold(ordered, f"sent to {place_m}, not to {places_m[-3:]}")

    def _is_borne_out(self, place_m: Point) -> bool:
        """Whether the vehicle told it is there, or so near that it stops there by itself.

        And another place from which it can have come.
        """
        told_m, session = self._task.told_m, self.bridge._session
        set_m_s2 = session.set_m_s2
        stop_m = 0.0 if set_m_s2 is None else session.cruise_speed_m_s**2 / (2.0 * set_m_s2)
        return any(
            _near(place_m, _fenced(there_m, self.bridge.config), stop_m)
            and any(
                other is not told_m[place]
                and math.dist(other[0], there_m) <= _LEAP_M + _FASTEST_M_S * abs(at_s - other[1])
                for other in told_m
            )
            for place, (there_m, at_s) in enumerate(told_m)
        )

    def _see_pause(self, message: Any, phases: set[FlightPhase]) -> None:
        named = [p for p in (message.param5, message.param6, message.param7) if not math.isnan(p)]
        hold(not named, f"a place in a long command: {named}")
        hold(self.fake.autopilot == mavlink.MAV_AUTOPILOT_PX4, "a pause that it does not know")
        hold(FlightPhase.HOLDING in phases, f"paused while {phases}")

    def _see_takeoff(self, message: Any) -> None:
        """Above home on ArduPilot, above the sea on PX4: at most across the fence."""
        config = self.bridge.config
        height_m = message.param7
        if self.fake.autopilot == mavlink.MAV_AUTOPILOT_PX4:
            height_m -= config.origin.alt_m
            hold(abs(height_m) <= config.fence_height_m + 0.1, f"takeoff to {height_m} m")
        else:
            hold(0.0 < height_m <= 2.0 * config.fence_height_m, f"takeoff by {height_m} m")

    # What it reports.

    def _take(self, report: VehicleReport) -> None:
        match report:
            case HandedOver(_, silent):
                hold(self._heard_again or not self._silent, "handed over twice")
                self._silent, self._heard_again, self._lost = True, False, silent
                self._prepared = False
                self._task = _Task(self._task.places_m)
            case HeardAgain():
                hold(self._lost, "heard again, though it was not silent")
                self._lost, self._heard_again = False, True
            case HandOverExplained():
                hold(self.bridge.phase is FlightPhase.HANDED_OVER, "explained, though it is ours")
            case Landed(leg):
                hold(leg == self._task.leg, f"landed by order {leg}, not {self._task.leg}")
                self._stood = True
                self._may_start |= self.bridge.config.ready_by_itself
            case Swapped(leg):
                hold(leg == self._swap_leg, f"swapped by order {leg}, not {self._swap_leg}")
                hold(self._may_start, "ready, though nobody let it start")
            case VehicleReady():
                hold(self._prepared, "ready, though nobody asked")
                self._prepared = False
            case Arrived(leg):
                under_way = self._task.leg
                hold(leg == under_way, f"arrived on leg {leg}, under way is {under_way}")
                self._task = replace(self._task, leg=None)
            case Refused(order) if order is self._ordered:
                self._task = self._task_before  # it changes nothing
                self._base_m, self._swap_leg = self._swap_before
            case Refused() if self.bridge.phase is FlightPhase.STANDING:
                # It did not leave, and stands there by the same order still.
                self._task = replace(self._task, leg=self._swap_leg)
            case Refused():
                self._task = replace(self._task, leg=None)
            case Telemetry(position, velocity, battery_frac):
                self._heres_m.append((position, self._now_s))
                self._task.told_m.append((position, self._now_s))
                numbers = (*position, *velocity, battery_frac or 0.0)
                hold(all(math.isfinite(n) for n in numbers), f"telemetry {report}")
            case _:
                pass

    # How it goes on.

    def _see_deadline(self, now_s: float) -> list[BridgeAction]:
        more: list[BridgeAction] = []
        for _ in range(3):
            deadline_s = self.bridge.next_deadline_s()
            latest_s = now_s + self.bridge.config.heartbeat_interval_s
            hold(deadline_s <= latest_s, f"wants to be called at {deadline_s}, now is {now_s}")
            if deadline_s > now_s:
                return more
            before = self.bridge.phase
            for action in self.bridge.step(TimePassed(), now_s):
                more.append(action)
                if isinstance(action, SendBytes):
                    self._look_at(self._decoded(action.data), before, self.bridge.phase)
                else:
                    self._take(action)
        raise BrokenError(f"wants to be called at {deadline_s} for ever, now is {now_s}")


def _fenced(place_m: Point, config: BridgeConfig) -> Point:
    """That place, or the one nearest to it that is a little within the fence."""
    east_m, north_m, up_m = place_m
    away_m = math.hypot(east_m, north_m)
    if away_m > config.fence_radius_m:
        scale = 0.999 * config.fence_radius_m / away_m
        east_m, north_m = scale * east_m, scale * north_m
    if abs(up_m) > config.fence_height_m:
        up_m = math.copysign(0.999 * config.fence_height_m, up_m)
    return (east_m, north_m, up_m)


def _near(a: Point, b: Point, beside_m: float = 0.0) -> bool:
    return math.dist(a[:2], b[:2]) <= beside_m + TOLERANCE_M and abs(a[2] - b[2]) <= TOLERANCE_M
