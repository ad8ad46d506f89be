"""What the autopilot allows and does: modes, arming, targets, home, mission.

What happens by itself happens at its own instant, however late and seldom `step` is called.
"""

from __future__ import annotations

import math
from collections.abc import Callable

from sim.autopilot.battery import BatteryModel
from sim.autopilot.camera import VehicleCamera
from sim.autopilot.config import VehicleConfig
from sim.autopilot.events import FirmwareEvent, Narrator, Outbox
from sim.autopilot.failsafes import FailsafeMonitor
from sim.autopilot.fence import FenceStore
from sim.autopilot.fence_monitor import FenceMonitor
from sim.autopilot.firmware.model import FirmwareModel
from sim.autopilot.flight import FlightMode, FlightStateMachine, Milestone, MotionPhase
from sim.autopilot.ground_contact import GroundContact
from sim.autopilot.mission_item import StoredMissionItem
from sim.autopilot.mission_run import MissionRun, MissionRunState
from sim.autopilot.mission_store import MissionStore
from sim.autopilot.parameters import ParameterRole, ParameterServer, ParameterTable
from sim.autopilot.positions import home_position, origin_position
from sim.autopilot.readiness import PowerUpStage, Readiness
from sim.world.motion import Point

_PREARM_TEXT_S = 30.0
"""How often a vehicle that can't be armed says why [s]."""
_TASKS = frozenset({FlightMode.TAKEOFF, FlightMode.AUTO, FlightMode.LAND})
"""Modes that are entered for something that comes to an end."""


class Pilot:
    """The autopilot of one vehicle, from power-up at ``boot_s`` on.

    Parameters, mission, fence and battery outlast a reboot. ``mode_changed`` is called with the
    time [s] as soon as the mode is another one.
    """

    def __init__(
        self,
        config: VehicleConfig,
        flavour: FirmwareModel,
        parameters: ParameterTable,
        store: MissionStore,
        fence_store: FenceStore,
        outbox: Outbox,
        battery: BatteryModel,
        boot_s: float,
        mode_changed: Callable[[float], None],
    ) -> None:
        self.config = config
        self.flavour = flavour
        self.outbox = outbox
        self.battery = battery
        self.parameters = parameters
        self.parameter_server = ParameterServer(parameters, outbox, flavour.parameter_habits)
        self.narrator = Narrator(outbox, flavour, config.system_id)
        self.readiness = Readiness(config.delays, boot_s)
        motion = config.motion()
        self.flight = FlightStateMachine(config, self.parameters, motion, flavour.jerk_cost_s)
        self.store = store
        self.run = MissionRun(self)
        self.mode = flavour.modes.at_boot
        self.armed = False
        self.stands_since_s: float | None = None
        """When the motors stopped after a flight [s]; None while they run, before the first flight
        and with a battery that was changed since."""
        self._flew = False
        self.task_done = False
        """What the last take-off, mission or landing was for is done."""
        self._mode_changed = mode_changed
        self._home_locked = False
        self._auto_armed = False
        """The vehicle may leave the ground in AUTO."""
        self._position_control = False
        """A place was flown to since GUIDED was entered or the vehicle took off."""
        self._disarm_s: float | None = None
        self._disarm_occasion = FirmwareEvent.DISARMED_UNUSED
        self._take_off_up_m: float | None = None
        """Height that was asked for [m], until the take-off begins; None: the usual one."""
        self._mission_checked_s = boot_s
        """From when on the mission on the vehicle can be begun [s]."""
        self._prearm_text_s = boot_s + _PREARM_TEXT_S
        self.failsafes = FailsafeMonitor(self)
        self.fence_store = fence_store
        self.fence = FenceMonitor(self, fence_store)
        self._ground_contact = GroundContact(self)
        self.camera = VehicleCamera(self)

    # --- Time -------------------------------------------------------------------

    def deadline_s(self) -> float:
        """When something happens next by itself [s]."""
        return min([due_s for due_s in self._dues_s() if due_s is not None])

    def advance(self, now_s: float) -> None:
        """Let everything happen, in order and at its own instant, that is due by ``now_s``."""
        while True:
            dues_s = self._dues_s()
            first_s = min([due_s for due_s in dues_s if due_s is not None])
            if first_s > now_s:
                return
            self._happen(dues_s.index(first_s), first_s)

    def _dues_s(self) -> tuple[float | None, ...]:
        """When each of what `_happen` knows is due; all of it is asked for at every step."""
        return (
            self._prearm_text_s,
            self.readiness.deadline_s(),
            self.flight.deadline_s(),
            self.run.hold_until_s,
            self.run.repeat_s,
            self._disarm_s,
            self.failsafes.deadline_s(),
            self.fence.deadline_s(),
            self._ground_contact.deadline_s(),
        )

    def _happen(self, what: int, at_s: float) -> None:
        happenings: tuple[Callable[[float], None], ...] = (
            self._say_obstacle,
            self._pass_stage,
            self._advance_flight,
            self.run.end_hold,
            self.run.repeat,
            lambda at_s: self._disarm(at_s, self._disarm_occasion),
            self.failsafes.advance,
            self.fence.advance,
            self._ground_contact.advance,
        )
        happenings[what](at_s)

    def _pass_stage(self, at_s: float) -> None:
        stage = self.readiness.advance()
        match stage:
            case PowerUpStage.BOOTED:
                # A mode that was set meanwhile was acknowledged, and is lost here.
                self.mode = self.flavour.modes.at_boot
                self._mode_changed(at_s)
                self.parameter_server.tell_at_boot()
            case PowerUpStage.ORIGIN:
                self.outbox.broadcast(origin_position(self.config.origin, self._boot_us(at_s)))
                self.set_home(self.position_enu_m(at_s), at_s, lock=False)
                self.parameter_server.announce("MIS_TOTAL", float(max(1, len(self.store.items))))
        if (text := self.flavour.stage_texts.get(stage)) is not None:
            self.outbox.text(text.severity, text.template)

    def _say_obstacle(self, at_s: float) -> None:
        self._prearm_text_s = at_s + _PREARM_TEXT_S
        for obstacle in () if self.armed else self.obstacles:
            self.narrator.tell(FirmwareEvent.NOT_READY, obstacle=obstacle)

    def _advance_flight(self, at_s: float) -> None:
        stood, landing = self.flight.on_ground, self.flight.activity is MotionPhase.LANDING
        milestone = self.flight.advance(at_s)
        if stood and not self.flight.on_ground:
            self._flew = True
            self.battery.start(at_s)
            self.narrator.tell(FirmwareEvent.LIFTED_OFF)
        lands = self.flight.activity is MotionPhase.LANDING and not landing
        if lands and self.mode is FlightMode.RTL:
            self.narrator.tell(FirmwareEvent.RETURN_LANDING)
        if self.config.drains_in_flight and self.flight.on_ground:
            self.battery.stop(at_s)
        if milestone is Milestone.LANDED:
            self._landed(at_s)
        elif milestone is Milestone.TAKEN_OFF and self.mode is self.flavour.modes.for_take_off:
            self._taken_off(at_s)
        elif self.mode is FlightMode.AUTO and self.run.flight.continues(milestone, at_s):
            return
        if self.mode is FlightMode.AUTO:
            self.run.on_milestone(milestone, at_s)

    def finish_task(self, now_s: float, *, motors_stop: bool = False) -> None:
        """Be done with what the mode was for."""
        self.task_done = True
        if motors_stop:
            self._disarm(now_s, FirmwareEvent.DISARMED_LANDED)

    def _landed(self, at_s: float) -> None:
        self.narrator.tell(FirmwareEvent.LANDED)
        if self.mode is FlightMode.RTL:
            self.narrator.tell(FirmwareEvent.RETURN_LANDED)
        if self.mode is not FlightMode.AUTO:
            self.task_done = True
        if (delay := self.flavour.disarm_delay(self.mode)) is None:
            self._disarm(at_s, FirmwareEvent.DISARMED_LANDED)
        elif self.armed:
            self._disarm_after(delay, at_s, FirmwareEvent.DISARMED_LANDED)

    def _taken_off(self, at_s: float) -> None:
        """Leave the mode that was entered for taking off."""
        self.task_done = True
        self.enter(self.flavour.modes.for_reposition, at_s)

    # --- What is asked for --------------------------------------------------------

    def position_enu_m(self, now_s: float) -> Point:
        """Where the vehicle is [m]."""
        return self.flight.motion.position_enu_m(now_s)

    def told_enu_m(self, now_s: float) -> Point:
        """Where the vehicle says it is [m]: without GPS, above or below the last fix."""
        place_enu_m = self.position_enu_m(now_s)
        last_fix_enu_m = self.readiness.last_fix_enu_m
        return place_enu_m if last_fix_enu_m is None else (*last_fix_enu_m[:2], place_enu_m[2])

    def set_mode(self, mode: FlightMode, now_s: float) -> bool:
        """Change the mode; False, with a text, where the autopilot refuses."""
        if mode is self.mode:
            return True
        if mode is FlightMode.AUTO and self._mission_unavailable(now_s):
            unavailable = FirmwareEvent.MISSION_UNAVAILABLE
            if self.flight.on_ground:
                unavailable = FirmwareEvent.MISSION_UNAVAILABLE_ON_GROUND
            self.narrator.tell(unavailable)
            return True  # acknowledged all the same
        refusal = self._mode_refusal(mode)
        if refusal is not None:
            name = self.flavour.mode_name(mode)
            self.narrator.tell(FirmwareEvent.MODE_REFUSED, mode=name, reason=refusal)
            return False
        self.enter(mode, now_s)
        return True

    def _mission_unavailable(self, now_s: float) -> bool:
        over = self.run.state is MissionRunState.COMPLETE and not self.flavour.missions.restarts
        return self.run.present and (over or now_s < self._mission_checked_s)

    def _mode_refusal(self, mode: FlightMode) -> str | None:
        if not self.readiness.booted:
            return None
        if self.armed and mode.needs_position and not self.readiness.has_position:
            return "requires position"
        if mode is not FlightMode.AUTO:
            return None
        grounded = self.armed and self.flight.on_ground and not self.run.can_rise
        if self.run.present and grounded:
            self.narrator.tell(FirmwareEvent.MISSION_WITHOUT_TAKE_OFF)
        return "init failed" if grounded or not self.run.present else None

    def enter(self, mode: FlightMode, now_s: float) -> None:
        """Be in a mode from now on, and begin to do what it is for."""
        if self.mode is FlightMode.AUTO:
            self.run.stop()
        self.mode = mode
        if mode in _TASKS:
            self.task_done = False
        if mode is not FlightMode.TAKEOFF:
            self._take_off_up_m = None
        self._mode_changed(now_s)
        self._position_control = False
        self.run.flight.begin()
        self.flight.override_cruise(None, now_s)
        if self.armed:
            self._fly(mode, now_s)

    def _fly(self, mode: FlightMode, now_s: float) -> None:
        """Begin to do what a mode is for."""
        if mode is FlightMode.AUTO:
            if self._auto_armed or not self.flight.on_ground or self.run.leaves_ground:
                self.narrator.tell(FirmwareEvent.MISSION_BEGUN)
                self.run.start_or_resume(now_s)
        elif mode is FlightMode.TAKEOFF:
            self._rise(now_s)
            return
        elif mode is FlightMode.RTL:
            self._return(now_s)
        elif mode is FlightMode.LAND:
            self.flight.land(now_s)
        else:
            # In manual modes too: a pilot who takes over is taken to hold the place.
            self.flight.hold(now_s)
        if self.flight.on_ground and self.run.state is not MissionRunState.RUNNING:
            self.stay_on_ground(now_s)

    def _return(self, now_s: float) -> None:
        if self.run.lands_instead(now_s):
            return
        self.flight.return_home(now_s, self.flavour.landing_enu_m(self))
        if self.flight.activity is MotionPhase.CLIMBING:
            up_m = self.flight.motion.target_enu_m[2]
            self.narrator.tell(
                FirmwareEvent.RETURN_BEGUN,
                altitude_m=math.ceil(self.config.origin.alt_m + up_m),
                above_home_m=math.ceil(up_m - self.flight.home_enu_m[2]),
            )

    def arm(self, now_s: float, *, forced: bool) -> bool:
        """Start the motors; False, with a text, while the vehicle isn't ready."""
        if self.armed:
            return True
        obstacles = self._arming_obstacles(forced=forced)
        # A text that names no obstacle is said once.
        for obstacle in obstacles[:1] if self.flavour.numbers_texts else obstacles:
            self.narrator.tell(FirmwareEvent.ARMING_REFUSED, obstacle=obstacle)
        if obstacles:
            return False
        self.armed = True
        self.stands_since_s = None
        self.fence.armed(now_s)
        self._ground_contact.armed(now_s)
        self._flew = self.flight.rouse()
        if self._flew or not self.config.drains_in_flight:
            self.battery.start(now_s)
        if not self._flew:
            self._disarm_unused(now_s)
        if self.flavour.tells_origin_when_armed:
            self.outbox.broadcast(origin_position(self.config.origin, self._boot_us(now_s)))
        if not self._home_locked:
            self.set_home_here(now_s)
        self.narrator.tell(FirmwareEvent.ARMED)
        begins = self.mode in (FlightMode.TAKEOFF, FlightMode.AUTO)
        if begins and self.flavour.modes.flies_when_armed:
            self._fly(self.mode, now_s)
        return True

    @property
    def obstacles(self) -> tuple[str, ...]:
        """Why the vehicle can't be armed in its mode, in its words; empty when it can."""
        if (obstacle := self.readiness.obstacle(self.mode)) is not None:
            return (obstacle,)
        return (*self.failsafes.obstacles, *self.fence.obstacles)

    def _arming_obstacles(self, *, forced: bool) -> tuple[str, ...]:
        if not self.flight.on_ground:
            return ("Falling",)
        obstacles = self.obstacles
        if not obstacles and self.mode in self.flavour.modes.unarmable:
            obstacles = (f"{self.flavour.mode_name(self.mode)} mode not armable",)
        # Force overcomes checks, but starts no motors of a computer that is still booting.
        return () if forced and self.readiness.booted else obstacles

    def disarm(self, now_s: float, *, forced: bool) -> bool:
        """Stop the motors; False in the air, unless forced."""
        if not self.armed:
            return True
        if not (forced or self.flight.on_ground or self.flight.drives):
            self.narrator.tell(FirmwareEvent.DISARMING_REFUSED)
            return False
        self._disarm(now_s, FirmwareEvent.DISARMED)
        return True

    def _disarm(self, now_s: float, occasion: FirmwareEvent) -> None:
        self._disarm_s = None
        if not self.armed:
            return
        self.armed = False
        self.battery.stop(now_s)
        self.failsafes.disarmed()
        self.fence.disarmed(now_s)
        self._ground_contact.disarmed()
        self._auto_armed = False
        self.run.reset()
        self.flight.fall(now_s)
        if self._flew and self.flight.on_ground:
            self.stands_since_s = now_s
            self._flew = False
            if self.flavour.home_follows_landing:
                self._home_locked = False
                self.set_home_here(now_s)
        self.narrator.tell(occasion)
        after = self.flavour.modes.after_flight
        if after is not None and (self.mode in _TASKS or self.mode is FlightMode.RTL):
            self.mode = after
            self._mode_changed(now_s)

    def stay_on_ground(self, now_s: float) -> None:
        """Give up a take-off that has not begun to rise; the motors stop after the usual delay."""
        self.flight.hold(now_s)
        if self._disarm_s is None:
            self._disarm_unused(now_s)

    def _disarm_unused(self, now_s: float) -> None:
        self._disarm_after(ParameterRole.DISARM_DELAY_S, now_s, FirmwareEvent.DISARMED_UNUSED)

    def _disarm_after(self, setting: ParameterRole, now_s: float, occasion: FirmwareEvent) -> None:
        """Stop the motors after some time on the ground; 0 or less leaves them on."""
        delay_s = self.parameters.value_si(setting)
        self._disarm_s = now_s + delay_s if delay_s > 0.0 else None
        self._disarm_occasion = occasion

    def take_off(self, up_m: float | None, now_s: float) -> bool:
        """Rise to a height in the local frame [m], None for the usual one; False if refused."""
        own_mode = self.flavour.modes.for_take_off
        if own_mode is not None:
            self._take_off_up_m = up_m
            if self.mode is own_mode and self.armed:
                self._fly(own_mode, now_s)
                return True
            accepted = self.set_mode(own_mode, now_s)
            if not accepted:
                self._take_off_up_m = None
            return accepted
        ready = self.armed and self.mode is FlightMode.GUIDED and self.flight.on_ground
        ready = ready and self.readiness.has_position
        if not ready or up_m is None or up_m <= self.position_enu_m(now_s)[2]:
            return False
        self.lift(up_m, now_s)
        return True

    def _rise(self, now_s: float) -> None:
        """Take off in the mode for it, as high as was asked, but not lower than usual."""
        home_up_m = self.flight.home_enu_m[2]
        least_up_m = home_up_m + self.parameters.value_si(ParameterRole.TAKE_OFF_HEIGHT_M)
        up_m, self._take_off_up_m = self._take_off_up_m, None
        if up_m is None or up_m < least_up_m:
            if up_m is not None:
                height_m = self.config.origin.alt_m + least_up_m
                self.narrator.tell(FirmwareEvent.TAKE_OFF_RAISED, height_m=height_m)
            up_m = least_up_m
        if up_m > self.position_enu_m(now_s)[2]:
            self.lift(up_m, now_s)
        else:
            self._taken_off(now_s)

    def lift(self, up_m: float, now_s: float) -> None:
        """Rise to a height in the local frame [m]."""
        self._disarm_s = None
        self._auto_armed = True
        self._position_control = False
        self.flight.take_off(up_m, now_s)

    def fly_guided(self, target_enu_m: Point, now_s: float, speed_m_s: float | None = None) -> None:
        """Fly to a place at once, in the mode for it, at the usual speed or one of its own.

        On the ground the target is taken and not flown; worse, it takes the place
        of a take-off that has not left the ground yet, as on ArduCopter.
        """
        if not self.armed:
            return
        if self.flight.on_ground:
            self.stay_on_ground(now_s)
            return
        if not self._position_control:
            self._position_control = True
            if self.flavour.forgets_speed:
                self.flight.override_cruise(None, now_s)
        self.flight.navigate(target_enu_m, now_s, speed_m_s)

    @property
    def takes_targets(self) -> bool:
        """Whether targets are flown to in the present mode."""
        return self.mode is self.flavour.modes.for_reposition or (
            self.mode is FlightMode.AUTO and self.run.gives_way
        )

    def let_targets(self, now_s: float) -> None:
        """Stay, and fly to targets from now on as if the mode for them had been entered."""
        self._position_control = False
        self.flight.hold(now_s)

    def change_speed(self, speed_m_s: float, now_s: float) -> bool:
        """Fly on at another speed [m/s]; False in modes that have none of their own."""
        if self.mode not in self.flavour.modes.change_speed:
            return False
        self.flight.override_cruise(speed_m_s, now_s)
        return True

    def start_mission(self, now_s: float) -> bool:
        """Fly the mission, from the ground too; False where AUTO is refused."""
        if not self.set_mode(FlightMode.AUTO, now_s) or self.mode is not FlightMode.AUTO:
            return False
        if self.flavour.modes.flies_when_armed:
            return self.arm(now_s, forced=False)
        if self.armed:
            self._auto_armed = True
            if self.run.state is not MissionRunState.RUNNING:
                self.run.start_or_resume(now_s)
        return True

    def set_home_here(self, now_s: float) -> None:
        """Put home where the vehicle is, and tell everybody if that is elsewhere."""
        here_enu_m = self.position_enu_m(now_s)
        if self.flight.home_enu_m != here_enu_m:
            self.set_home(here_enu_m, now_s, lock=False)

    def set_home(self, home_enu_m: Point, now_s: float, *, lock: bool) -> None:
        """Put home elsewhere and tell everybody; locked, it stays there when arming."""
        self.flight.home_enu_m = home_enu_m
        self._home_locked = self._home_locked or lock
        self.outbox.broadcast(home_position(self.config.origin, home_enu_m, self._boot_us(now_s)))

    def mission_uploaded(self, old: tuple[StoredMissionItem, ...], now_s: float) -> None:
        """Hear that another mission has taken the place of ``old``."""
        self.narrator.tell(FirmwareEvent.MISSION_RECEIVED)
        self._mission_checked_s = now_s + self.flavour.missions.check_s
        self.parameter_server.announce("MIS_TOTAL", float(len(self.store.items)))
        if self.flavour.missions.upload_rewinds and old != self.store.items:
            self.task_done = False
        if self.run.mission_changed(old, now_s):
            runs = self.run.state is MissionRunState.RUNNING
            told, in_vain = FirmwareEvent.MISSION_REPLACED, FirmwareEvent.MISSION_REPLACED_IN_VAIN
            self.narrator.tell(told if runs else in_vain)

    def _boot_us(self, now_s: float) -> int:
        return round((now_s - self.readiness.boot_s) * 1e6)
