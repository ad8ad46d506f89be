"""From a silent box to a vehicle that takes targets, at its start or where it flies already.

No script: every time something is heard, the next step follows from the state *seen*,
so an overwritten mode, an automatic disarming on the ground or a vehicle that flies
already need no cases of their own. A vehicle that somebody else armed or flies is waited
for, and once it is disarmed it does not start by itself. Every step has a limit. A vehicle
that is resumed in the air keeps its old target meanwhile: only its speed is set, and not
even that if it flies a mission of ours. Commanded by missions, it gets one that ends at home
while it stands on the ground, and is not ready before it flies it. What counts as consent to fly
a vehicle stands in agent.vehicle.supervision, and what it is asked beforehand in
agent.vehicle.preflight.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

from agent.core.interface import Prepare
from agent.vehicle.commands import (
    CommandEnded,
    RepeatedCommand,
    VehicleCommand,
    result_text,
)
from agent.vehicle.firmware.profile import Firmware
from agent.vehicle.leg import RepositionLeg
from agent.vehicle.messages import Heartbeat, Inbound, Landed, Outbound, Position, StatusText
from agent.vehicle.onboard_mission import OnboardMission
from agent.vehicle.preflight import CruiseSpeedSetting, FailsafeCheck, home_alt_m, start_fault
from agent.vehicle.session import VehicleSession
from agent.vehicle.state import VehicleState
from agent.vehicle.supervision import PilotConsent
from swarm.model.frames import wgs84_from_enu

__all__ = ["Preparation"]


Point = tuple[float, float, float]

_CLIMB_PROGRESS_M = 0.2
_CLIMB_TOLERANCE_FRAC = 0.05
_CLIMB_TOLERANCE_M = 1.0
"""Autopilots end a takeoff that much too low, and go on from there."""
_STATE_UNINIT = 0
"""MAV_STATE."""
_PREARM_TEXT_AGE_S = 35.0
"""ArduPilot repeats what fails before arming every 30 s."""
_CAME_DOWN = (
    "it was left in the air and stands on the ground now: look after it, "
    "and start its agent with --rejoin"
)
_CLIMB_STOPPED = "the vehicle took off and then stopped climbing"
_ARMED_BY_OTHERS = "somebody else armed it and disarmed it again; prepare it again to take off"
_FLOWN_BY_PILOT = "its pilot flew and landed it; prepare it again to take off"


@dataclass(frozen=True, slots=True)
class _Step:
    """One thing that is asked of the vehicle until it is seen, but not for ever."""

    what: str
    command: RepeatedCommand


class Preparation:
    """The steps of one preparation of one vehicle.

    Args:
        session: with the vehicle; its mission may stand there since an earlier life.
        firmware: what flies it.
        order: the order.
        ours: the vehicle flies, or may fly, on our orders already.
    """

    def __init__(
        self, session: VehicleSession, firmware: Firmware, order: Prepare, *, ours: bool
    ) -> None:
        config, commands = session.config, session.commands
        self._order = order
        self._mission = session.mission
        self._config = config
        self._commands = commands
        self._firmware = firmware
        self._safety = session.safety
        _, _, self._start_alt_m = wgs84_from_enu(config.origin, order.position_enu_m)
        wait_s, delay_s = config.effect_timeout_s, config.retry_delay_s
        self._mode = _Step(
            f"setting {firmware.commanded_mode_name}",
            RepeatedCommand("mode", commands, config.mode_tries, wait_s, delay_s),
        )
        self._arm = _Step(
            "arming", RepeatedCommand("arm", commands, config.arm_tries, wait_s, delay_s)
        )
        # ArduCopter spools up for 3 to 4 s before it leaves the ground.
        self._takeoff = _Step(
            "takeoff",
            RepeatedCommand("takeoff", commands, config.takeoff_tries, 2.0 * wait_s, delay_s),
        )
        self._highest_m = -math.inf
        self._climbed_at_s = math.inf
        self._climbing = False
        self._saw_takeoff = False
        self._flew = False
        self._flown_by_pilot = False
        self._armed_by_others = False
        self._uploads = 0
        self._upload_at_s = -math.inf
        self._mission_begun = False
        self._consent = PilotConsent(firmware, ours=ours or order.resume)
        self._leg: RepositionLeg | None = None
        self._speed = CruiseSpeedSetting(order.speed_m_s, firmware, config)
        self._failsafes = FailsafeCheck(firmware, config)
        self.waiting_for = "waiting for the autopilot"
        """What is missing, for people."""
        self.done = False
        """The vehicle is where it should be, with its cruise speed set."""
        self.failure: str | None = None
        """Why it will not get there; None while it may."""

    @property
    def caution(self) -> str | None:
        """What people should know of a vehicle that is armed all the same."""
        return self._failsafes.caution

    @property
    def engaged(self) -> bool:
        """Whether the motors run, or may run, because of us."""
        return self._arm.command.given > 0 or self._flew

    @property
    def took_off(self) -> bool:
        """Whether takeoff was asked for."""
        return self._takeoff.command.given > 0

    def on_ended(self, ended: CommandEnded, now_s: float) -> list[Outbound]:
        """Take a command's outcome."""
        for step in (self._mode, self._arm, self._takeoff):
            step.command.on_ended(ended, now_s)
        if self._leg is not None:
            self._leg.on_ended(ended)
        return self._speed.on_ended(ended, now_s)

    def on_message(self, message: Inbound, now_s: float) -> list[Outbound]:
        """Take what matters of a message beside the vehicle's state."""
        self._failsafes.on_message(message)
        leg, ignores = self._leg, self._firmware.ignores_target
        if leg is not None and isinstance(message, StatusText) and ignores(message.text):
            leg.ignored(message.text)
        return self._speed.on_message(message, now_s)

    def on_position(self, position: Position, place_enu_m: Point, now_s: float) -> list[Outbound]:
        """Take a fresh position: climb and arrival show in it."""
        if position.alt_m > self._highest_m + _CLIMB_PROGRESS_M:
            self._highest_m = position.alt_m
            self._climbed_at_s = now_s
        if self._leg is None:
            return []
        return [*self._leg.on_position(place_enu_m, position.velocity_enu_m_s, now_s)]

    def advance(self, vehicle: VehicleState, heartbeat: Heartbeat, now_s: float) -> list[Outbound]:
        """Do what the state seen asks for next."""
        firmware = self._firmware
        if self.done or self.failure is not None:
            return []
        if not firmware.has_booted(heartbeat):
            return self._wait(self._booting(vehicle, heartbeat, now_s))
        self._consent.on_heartbeat(heartbeat)
        if self._mission is not None and self._mission_begun:
            return self._follow_mission(self._mission, heartbeat)
        if heartbeat.armed and firmware.is_taking_off(heartbeat.custom_mode):
            return self._follow_takeoff(now_s)
        if not firmware.is_commanded(heartbeat.custom_mode):
            if self._may_fly_our_mission(vehicle, heartbeat):
                return self._take_on_mission(now_s)
            if heartbeat.armed:
                self._flown_by_pilot = True
                mode = firmware.mode_name(heartbeat.custom_mode)
                return self._wait(
                    f"armed in {mode} by its pilot: land it, "
                    f"or switch it to {firmware.commanded_mode_name}"
                )
            if reason := self._left_by_others():
                return self._fail(reason)
            return self._ask(self._mode, firmware.set_commanded_mode(), vehicle, now_s)
        if not heartbeat.armed:
            if reason := self._left_by_others():
                return self._fail(reason)
            started = self._start_motors(vehicle, now_s)
            return started if self.failure else [*self._failsafes.ask(now_s), *started]
        position = vehicle.position
        if position is None:
            return self._wait("waiting for a position")
        airborne = firmware.airborne(vehicle)
        if airborne is None:
            return self._wait("waiting to hear whether it flies (EXTENDED_SYS_STATE)")
        if objection := self._consent.objection(airborne=airborne):
            self._flown_by_pilot |= airborne
            self._armed_by_others = True
            return self._wait(objection)
        if not airborne:
            return self._take_off(position, vehicle, now_s)
        self._flew = True
        # Repeated now, it would interrupt what follows.
        out: list[Outbound] = [*self._takeoff.command.cancel(now_s)]
        if self._arm.command.given:  # what it does without us may not have been read to the end
            out += self._failsafes.ask(now_s)
        if self._climbing and not self._high_enough(position, now_s):
            return out
        self._climbing = False
        return out + self._settle(vehicle, now_s)

    def _booting(self, vehicle: VehicleState, heartbeat: Heartbeat, now_s: float) -> str:
        """Why it is not ready to be told anything.

        PX4 is "uninitialised" whenever its checks fail while it is disarmed, and they say why.
        """
        unready = self._firmware.unready(vehicle)
        if heartbeat.system_status != _STATE_UNINIT or not vehicle.prearm_heard or unready is None:
            return "the autopilot is booting"
        return self._with_warning(unready, vehicle, now_s)

    def _with_warning(self, reason: str, vehicle: VehicleState, now_s: float) -> str:
        text = vehicle.recent_warning(now_s, _PREARM_TEXT_AGE_S)
        return f"{reason} ({text})" if text else reason

    def _left_by_others(self) -> str | None:
        """Why it does not start by itself: somebody may be walking up to it."""
        if self._flown_by_pilot:
            return _FLOWN_BY_PILOT
        return _ARMED_BY_OTHERS if self._armed_by_others else None

    def _start_motors(self, vehicle: VehicleState, now_s: float) -> list[Outbound]:
        if self._flew:
            return self._fail("the vehicle disarmed after takeoff")
        if self._order.left_in_air and not self._arm.command.given:
            return self._fail(_CAME_DOWN)
        unready = self._firmware.unready(vehicle)
        if unready is None and (arming_objection := self._safety.arming_objection(vehicle, now_s)):
            return self._wait(arming_objection)
        if unready is not None:
            return self._wait(self._with_warning(unready, vehicle, now_s))
        if vehicle.position is not None and (fault := self._start_fault(vehicle.position)):
            return self._fail(fault)
        if objection := self._failsafes.objection:
            return self._wait(objection)
        if self._mission is not None and not self._mission.is_uploaded:
            return self._upload_way_home(self._mission, now_s)
        self._consent.arm()
        return self._ask(self._arm, self._firmware.arm(), vehicle, now_s)

    def _start_fault(self, position: Position) -> str | None:
        return start_fault(self._order, position, self._config)

    def _take_off(self, position: Position, vehicle: VehicleState, now_s: float) -> list[Outbound]:
        self._climbing = True
        self._climbed_at_s = now_s
        self._highest_m = position.alt_m
        # Also here, as a vehicle found armed on the ground comes straight to takeoff.
        if arming_objection := self._safety.arming_objection(vehicle, now_s):
            return self._wait(arming_objection)
        if fault := self._start_fault(position):
            return self._fail(fault)
        if self._mission is not None and not self._mission.is_uploaded and not self.took_off:
            return self._upload_way_home(self._mission, now_s)
        command = self._firmware.takeoff(self._start_alt_m, home_alt_m(position))
        return self._ask(self._takeoff, command, vehicle, now_s)

    def _follow_takeoff(self, now_s: float) -> list[Outbound]:
        """Wait for the end of a takeoff that the vehicle carries out in a mode of its own."""
        self._saw_takeoff = True
        if not self.took_off:
            # An earlier life's, or a pilot's.
            self._flown_by_pilot = self._consent.needed
            return self._wait("waiting for the takeoff under way to end")
        # The heartbeat that tells its end may come as late as any other.
        patience_s = self._config.climb_timeout_s + self._config.silence_timeout_s
        if now_s - self._climbed_at_s > patience_s:
            return self._fail(_CLIMB_STOPPED)
        return self._wait("climbing")

    def _may_fly_our_mission(self, vehicle: VehicleState, heartbeat: Heartbeat) -> bool:
        return (
            self._mission is not None
            and self._mission.is_ours is not False
            and self._order.resume
            and not self._flown_by_pilot
            and heartbeat.armed
            and self._firmware.is_mission(heartbeat.custom_mode)
            and self._firmware.airborne(vehicle) is not False
        )

    def _take_on_mission(self, now_s: float) -> list[Outbound]:
        """Find out whether the mission flown is one of ours; the vehicle flies on meanwhile."""
        if self._mission is None:
            return []
        if self._mission.is_ours:
            self._flew = self.done = True
            return []
        self._wait("reading the mission that the vehicle flies")
        return self._mission.look(now_s)

    def _high_enough(self, position: Position, now_s: float) -> bool:
        height_m = self._start_alt_m - home_alt_m(position)
        tolerance_m = max(
            self._config.acceptance_radius_m, _CLIMB_TOLERANCE_M, _CLIMB_TOLERANCE_FRAC * height_m
        )
        if position.alt_m >= self._start_alt_m - tolerance_m:
            return True
        if now_s - self._climbed_at_s > self._config.climb_timeout_s:
            self._fail(_CLIMB_STOPPED)
        else:
            self._wait(f"climbing to {height_m:.0f} m")
        return False

    def _settle(self, vehicle: VehicleState, now_s: float) -> list[Outbound]:
        """Fly to the start, unless the vehicle is resumed in the air, and set the speed."""
        out: list[Outbound] = []
        if self._leg is None and not self._resumes(vehicle):
            place = wgs84_from_enu(self._config.origin, self._order.position_enu_m)
            message = self._firmware.reposition(*place, self._order.speed_m_s)
            self._leg = RepositionLeg(
                self._order.position_enu_m,
                message,
                self._config,
                self._commands,
                lambda result: self._firmware.place_refusal(vehicle, result),
            )
            out += self._leg.start(now_s)
        leg = self._leg
        # ArduPilot forgets a speed set before the first target after takeoff.
        if (leg is None or leg.accepted) and not self._speed.begun:
            out += self._speed.start(self._commands, now_s)
        out += self._speed.on_time(now_s)
        failure = self._speed.failure if leg is None else leg.failure or self._speed.failure
        if failure is not None:
            return out + self._fail(failure)
        there = (leg is None or leg.arrived) and self._speed.done
        if there and leg is not None and self._mission is not None:
            return out + self._begin_mission(self._mission, now_s)
        self.done = there
        self._wait("setting the cruise speed" if leg is None else "flying to the start")
        return out

    def _upload_way_home(self, mission: OnboardMission, now_s: float) -> list[Outbound]:
        """Put a mission on the vehicle that waits at the start and then comes home."""
        reason = mission.failure
        self._wait(
            f"putting the way home on it failed ({reason}), trying again"
            if reason
            else "putting the way home on it"
        )
        if now_s < self._upload_at_s or mission.is_uploading:
            return []
        if self._uploads >= self._config.mode_tries:
            return self._fail(f"the way home cannot be put on it: {reason}")
        self._uploads += 1
        self._upload_at_s = now_s + self._config.retry_delay_s
        return mission.upload(self._order.position_enu_m, self._order.speed_m_s, now_s)

    def _begin_mission(self, mission: OnboardMission, now_s: float) -> list[Outbound]:
        """From now on the way home stands on the vehicle whatever becomes of us."""
        if not mission.is_uploaded:  # as it was found in the air
            return self._upload_way_home(mission, now_s)
        mission.begin(now_s)
        self._mission_begun = True
        return self._wait("starting the mission")

    def _follow_mission(self, mission: OnboardMission, heartbeat: Heartbeat) -> list[Outbound]:
        if not heartbeat.armed:
            return self._fail("the vehicle disarmed after takeoff")
        if mission.unverified or mission.failure is not None:
            return self._fail(mission.failure or "which mission it flies is not known")
        self.done = mission.is_flown
        return []

    def _resumes(self, vehicle: VehicleState) -> bool:
        """Whether it flies on orders of an earlier life, beyond its takeoff."""
        taking_off = self._saw_takeoff or vehicle.landed is Landed.TAKEOFF
        return self._order.resume and not self.took_off and not taking_off

    def _ask(
        self, step: _Step, command: VehicleCommand, vehicle: VehicleState, now_s: float
    ) -> list[Outbound]:
        refusal, repeated = "", step.command
        if repeated.refused:
            # Of modes and motors nothing depends on a place.
            of_place = step is self._takeoff
            words = self._firmware.place_refusal(vehicle, repeated.result) if of_place else None
            refusal = words or result_text(repeated.result)
            if text := vehicle.telling_warning(now_s):
                refusal = f"{refusal}: {text}"
        self._wait(f"{step.what} refused ({refusal}), trying again" if refusal else step.what)
        out = repeated.give(command, now_s)
        if out is None:
            why = f"last answer: {refusal}" if refusal else "its effect was never seen to stay"
            return self._fail(f"{step.what} failed {repeated.given} times; {why}")
        return [*out]

    def _wait(self, reason: str) -> list[Outbound]:
        self.waiting_for = reason
        return []

    def _fail(self, reason: str) -> list[Outbound]:
        self.failure = reason
        return []
