"""What the autopilot allows and does: modes, arming, targets, home, mission.

Everything that happens by itself happens at its own instant, however late the
next `step` comes, so flights do not depend on how often the vehicle is called.
Leaves out: decoding of commands (sim.autopilot.commands) and telemetry.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

from pymavlink.dialects.v20 import ardupilotmega as mavlink

from sim.autopilot.battery import Battery
from sim.autopilot.config import VehicleConfig
from sim.autopilot.events import Outbox
from sim.autopilot.failsafes import FailSafes
from sim.autopilot.flavours.base import Flavour
from sim.autopilot.flight import Flight, Milestone
from sim.autopilot.geo import place_enu_m, place_wgs84_e7
from sim.autopilot.messages import home_position, origin_position
from sim.autopilot.mission_items import MissionItem, MissionStore
from sim.autopilot.mission_run import MissionRun, RunState
from sim.autopilot.modes import Mode
from sim.autopilot.params import ParameterServer, ParameterTable, Setting
from sim.autopilot.readiness import Readiness, Stage
from sim.kinematics import Point

__all__ = ["Pilot"]

_PREARM_TEXT_S = 30.0
"""How often a vehicle that can't be armed says why [s]."""


class Pilot:
    """The autopilot of one vehicle, from power-up on.

    Args:
        config: the vehicle it flies.
        flavour: whose firmware it is.
        parameters: what the ground set; outlasts a reboot.
        store: the mission on the vehicle; outlasts a reboot.
        outbox: takes what it says.
        battery: what it flies on; outlasts a reboot.
        boot_s: when it is powered up [s].
        mode_changed: called with the time [s] as soon as the mode is another one.
    """

    def __init__(
        self,
        config: VehicleConfig,
        flavour: Flavour,
        parameters: ParameterTable,
        store: MissionStore,
        outbox: Outbox,
        battery: Battery,
        boot_s: float,
        mode_changed: Callable[[float], None],
    ) -> None:
        self.config = config
        self.flavour = flavour
        self.outbox = outbox
        self.parameters = parameters
        self.parameter_server = ParameterServer(
            self.parameters,
            outbox,
            reports_errors=flavour.reports_parameter_errors,
            unanswered=flavour.unanswered_parameters,
        )
        self.readiness = Readiness(config.delays, boot_s)
        self.flight = Flight(config, self.parameters, config.motion())
        self.store = store
        self.run = MissionRun(self.store, self, outbox, flavour.first_item)
        self.mode = flavour.boot_mode
        self.armed = False
        self._mode_changed = mode_changed
        self._home_locked = False
        self._auto_armed = False
        """The vehicle may leave the ground in AUTO."""
        self._position_control = False
        """A place was flown to since GUIDED was entered or the vehicle took off."""
        self._disarm_s: float | None = None
        self._prearm_text_s = boot_s + _PREARM_TEXT_S
        self.battery = battery
        self.failsafes = FailSafes(self, battery)

    # --- Time -------------------------------------------------------------------

    def deadline_s(self) -> float:
        """When something happens next by itself [s]."""
        return min(deadline_s for deadline_s, _ in self._deadlines())

    def advance(self, now_s: float) -> None:
        """Let everything happen, in order and at its own instant, that is due by ``now_s``."""
        while True:
            deadline_s, happen = min(self._deadlines(), key=lambda due: due[0])
            if deadline_s > now_s:
                return
            happen(deadline_s)

    def _deadlines(self) -> list[tuple[float, Callable[[float], None]]]:
        due: list[tuple[float, Callable[[float], None]]] = [
            (self._prearm_text_s, self._say_obstacle)
        ]
        for deadline_s, happen in (
            (self.readiness.deadline_s(), self._pass_stage),
            (self.flight.deadline_s(), self._advance_flight),
            (self.run.deadline_s(), self.run.advance),
            (self._disarm_s, self._disarm),
            (self.failsafes.deadline_s(), self.failsafes.advance),
        ):
            if deadline_s is not None:
                due.append((deadline_s, happen))
        return due

    def _pass_stage(self, at_s: float) -> None:
        stage = self.readiness.advance()
        match stage:
            case Stage.BOOTED:
                # A mode that was set meanwhile was acknowledged, and is lost here.
                self.mode = self.flavour.boot_mode
                self._mode_changed(at_s)
            case Stage.ORIGIN:
                self.outbox.broadcast(origin_position(self.config.origin, self._boot_us(at_s)))
                self.set_home(self.position_enu_m(at_s), at_s, lock=False)
                self.parameter_server.announce("MIS_TOTAL", float(max(1, len(self.store.items))))
            case Stage.SENSORS | Stage.POSITION:
                pass
        if stage in self.flavour.stage_texts:
            self.outbox.text(mavlink.MAV_SEVERITY_INFO, self.flavour.stage_texts[stage])

    def _say_obstacle(self, at_s: float) -> None:
        self._prearm_text_s = at_s + _PREARM_TEXT_S
        obstacle = self.readiness.obstacle(self.mode)
        if obstacle is not None and not self.armed:
            self.outbox.text(mavlink.MAV_SEVERITY_CRITICAL, self.flavour.not_ready(obstacle))

    def _advance_flight(self, at_s: float) -> None:
        milestone = self.flight.advance(at_s)
        if milestone is Milestone.LANDED:
            if self.mode in (Mode.RTL, Mode.LAND):
                self._disarm(at_s)
            elif self.armed:
                self._arm_delay(at_s)
        if self.mode is Mode.AUTO:
            self.run.on_milestone(milestone, at_s)

    # --- What is asked for --------------------------------------------------------

    def position_enu_m(self, now_s: float) -> Point:
        """Where the vehicle is [m]."""
        return self.flight.motion.position_enu_m(now_s)

    def told_enu_m(self, now_s: float) -> Point:
        """Where the vehicle says it is [m]: without GPS, above or below the last fix."""
        place_enu_m = self.position_enu_m(now_s)
        last_fix_enu_m = self.readiness.last_fix_enu_m
        return place_enu_m if last_fix_enu_m is None else (*last_fix_enu_m[:2], place_enu_m[2])

    def set_mode(self, mode: Mode, now_s: float) -> bool:
        """Change the mode; False, with a text, where the autopilot refuses."""
        if mode is self.mode:
            return True
        refusal = self._mode_refusal(mode)
        if refusal is not None:
            self.outbox.text(
                mavlink.MAV_SEVERITY_WARNING, f"Mode change to {mode.value} failed: {refusal}"
            )
            return False
        self._enter(mode, now_s)
        return True

    def _mode_refusal(self, mode: Mode) -> str | None:
        if not self.readiness.booted:
            return None
        if self.armed and mode.needs_position and not self.readiness.has_position:
            return "requires position"
        if mode is Mode.AUTO:
            if not self.run.present:
                return "init failed"
            if self.armed and self.flight.on_ground and not self.run.starts_with_take_off:
                self.outbox.text(mavlink.MAV_SEVERITY_CRITICAL, "Auto: Missing Takeoff Cmd")
                return "init failed"
        return None

    def _enter(self, mode: Mode, now_s: float) -> None:
        if self.mode is Mode.AUTO:
            self.run.stop()
        self.mode = mode
        self._mode_changed(now_s)
        self._position_control = False
        self.flight.override_cruise(None, now_s)
        if not self.armed:
            return
        if mode is Mode.AUTO:
            if self._auto_armed or not self.flight.on_ground:
                self.run.start_or_resume(now_s)
        elif mode is Mode.RTL:
            self.flight.return_home(now_s)
        elif mode is Mode.LAND:
            self.flight.land(now_s)
        else:
            # In manual modes too: a pilot who takes over is taken to hold the place.
            self.flight.hold(now_s)
        if self.flight.on_ground and self.run.state is not RunState.RUNNING:
            self._stay_on_ground(now_s)

    def arm(self, now_s: float, *, forced: bool) -> bool:
        """Start the motors; False, with a text, while the vehicle isn't ready."""
        if self.armed:
            return True
        obstacle = self._arming_obstacle(forced=forced)
        if obstacle is not None:
            self.outbox.text(mavlink.MAV_SEVERITY_CRITICAL, self.flavour.cannot_arm(obstacle))
            return False
        self.armed = True
        self.battery.start(now_s)
        self._arm_delay(now_s)
        self.outbox.broadcast(origin_position(self.config.origin, self._boot_us(now_s)))
        here_enu_m = self.position_enu_m(now_s)
        if not self._home_locked and self.flight.home_enu_m != here_enu_m:
            self.set_home(here_enu_m, now_s, lock=False)
        self.outbox.text(mavlink.MAV_SEVERITY_INFO, "Arming motors")
        return True

    def _arming_obstacle(self, *, forced: bool) -> str | None:
        if not self.flight.on_ground:
            return "Falling"
        obstacle = self.readiness.obstacle(self.mode)
        if obstacle is None and self.mode in self.flavour.unarmable_modes:
            obstacle = f"{self.mode.value} mode not armable"
        # Force overcomes checks, but starts no motors of a computer that is still booting.
        return None if forced and self.readiness.booted else obstacle

    def disarm(self, now_s: float, *, forced: bool) -> bool:
        """Stop the motors; False in the air, unless forced."""
        if not self.armed:
            return True
        if not forced and not self.flight.on_ground:
            return False
        self._disarm(now_s)
        return True

    def _disarm(self, now_s: float) -> None:
        self._disarm_s = None
        if not self.armed:
            return
        self.armed = False
        self.battery.stop(now_s)
        self._auto_armed = False
        self.run.reset()
        self.flight.fall(now_s)
        self.outbox.text(mavlink.MAV_SEVERITY_INFO, "Disarming motors")

    def _stay_on_ground(self, now_s: float) -> None:
        """Give up a take-off that has not begun to rise; the motors stop after the usual delay."""
        self.flight.hold(now_s)
        if self._disarm_s is None:
            self._arm_delay(now_s)

    def _arm_delay(self, now_s: float) -> None:
        delay_s = self.parameters.value_si(Setting.DISARM_DELAY_S)
        self._disarm_s = now_s + delay_s if delay_s > 0.0 else None

    def take_off(self, up_m: float, now_s: float) -> bool:
        """Rise to a height in the local frame [m]; False unless armed, guided, on the ground."""
        ready = self.armed and self.mode is Mode.GUIDED and self.flight.on_ground
        if not ready or not self.readiness.has_position:
            return False
        if up_m <= self.position_enu_m(now_s)[2]:
            return False
        self._lift(up_m, now_s)
        return True

    def _lift(self, up_m: float, now_s: float) -> None:
        self._disarm_s = None
        self._auto_armed = True
        self._position_control = False
        self.flight.take_off(up_m, now_s)

    def fly_guided(self, target_enu_m: Point, now_s: float) -> None:
        """Fly to a place at once, in GUIDED.

        On the ground the target is taken and not flown; worse, it takes the place
        of a take-off that has not left the ground yet, as on ArduCopter.
        """
        if not self.armed:
            return
        if self.flight.on_ground:
            self._stay_on_ground(now_s)
            return
        if not self._position_control:
            self._position_control = True
            if self.flavour.forgets_speed:
                self.flight.override_cruise(None, now_s)
        self.flight.navigate(target_enu_m, now_s)

    def change_speed(self, speed_m_s: float, now_s: float) -> bool:
        """Fly on at another speed [m/s]; False in modes that have none of their own."""
        if self.mode not in (Mode.GUIDED, Mode.AUTO, Mode.RTL):
            return False
        self.flight.override_cruise(speed_m_s, now_s)
        return True

    def start_mission(self, now_s: float) -> bool:
        """Fly the mission, from the ground too; False where AUTO is refused."""
        if not self.set_mode(Mode.AUTO, now_s):
            return False
        if self.armed:
            self._auto_armed = True
            if self.run.state is not RunState.RUNNING:
                self.run.start_or_resume(now_s)
        return True

    def set_home(self, home_enu_m: Point, now_s: float, *, lock: bool) -> None:
        """Put home elsewhere and tell everybody; locked, it stays there when arming."""
        self.flight.home_enu_m = home_enu_m
        self._home_locked = self._home_locked or lock
        self.outbox.broadcast(home_position(self.config.origin, home_enu_m, self._boot_us(now_s)))

    def mission_uploaded(self, old: tuple[MissionItem, ...], now_s: float) -> None:
        """Hear that another mission has taken the place of ``old``."""
        self.outbox.text(mavlink.MAV_SEVERITY_INFO, "Flight plan received")
        self.parameter_server.announce("MIS_TOTAL", float(len(self.store.items)))
        if self.run.mission_changed(old, now_s):
            restarted = self.run.state is RunState.RUNNING
            self.outbox.text(
                mavlink.MAV_SEVERITY_CRITICAL,
                "Auto mission changed, restarted command"
                if restarted
                else "Auto mission changed but failed to restart command",
            )

    def home_item(self) -> MissionItem:
        """Home as item 0 of a mission."""
        lat_e7, lon_e7, alt_mm = place_wgs84_e7(self.config.origin, self.flight.home_enu_m)
        return MissionItem(
            frame=mavlink.MAV_FRAME_GLOBAL,
            command=mavlink.MAV_CMD_NAV_WAYPOINT,
            params=(0.0, 0.0, 0.0, 0.0),
            lat_e7=lat_e7,
            lon_e7=lon_e7,
            height_m=alt_mm / 1e3,
        )

    # --- What a mission asks for (MissionPilot) -----------------------------------

    def mission_take_off(self, item: MissionItem, now_s: float) -> None:
        """Rise to the height of the item, at least to where the vehicle is."""
        place = self._place(replace(item, lat_e7=0, lon_e7=0), now_s)
        self._lift(max(place[2], self.position_enu_m(now_s)[2]), now_s)

    def mission_navigate(self, item: MissionItem, now_s: float) -> None:
        """Fly to the place of the item; not from the ground."""
        if self.flight.on_ground:
            self._stay_on_ground(now_s)
        else:
            self.flight.navigate(self._place(item, now_s), now_s)

    def mission_land(self, now_s: float) -> None:
        """Land where the vehicle is."""
        self.flight.land(now_s)

    def mission_return(self, now_s: float) -> None:
        """Return home and land."""
        self.flight.return_home(now_s)

    def mission_change_speed(self, speed_m_s: float, now_s: float) -> None:
        """Fly at another speed [m/s] until AUTO is left."""
        self.flight.override_cruise(speed_m_s, now_s)

    def mission_finished(self, now_s: float) -> None:
        """Stay where the last item ended: in the air, or on the ground with motors stopped."""
        if self.flight.on_ground:
            self._disarm(now_s)
        else:
            self.flight.hold(now_s)

    def _place(self, item: MissionItem, now_s: float) -> Point:
        """Place of an item [m]; zeros mean where the vehicle is, as ArduPilot reads them."""
        here_enu_m = self.position_enu_m(now_s)
        place = place_enu_m(
            self.config.origin,
            item.frame,
            item.lat_e7,
            item.lon_e7,
            item.height_m,
            self.flight.home_enu_m[2],
        )
        if place is None:
            return here_enu_m
        east_m, north_m, up_m = place
        if item.lat_e7 == 0 and item.lon_e7 == 0:
            east_m, north_m, _ = here_enu_m
        if item.height_m == 0.0:
            up_m = here_enu_m[2]
        return east_m, north_m, up_m

    def _boot_us(self, now_s: float) -> int:
        return round((now_s - self.readiness.boot_s) * 1e6)
