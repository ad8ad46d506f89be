"""From a silent box to a vehicle that takes targets, at its start or where it flies already.

It is waited for first, then taken through the steps, which begin anew if it turns out to be another
kind of vehicle, or if its autopilot reboots before the motors were asked for.

No script: every time something is heard, the next step follows from the state *seen*,
so an overwritten mode, an automatic disarming on the ground or a vehicle that flies
already need no cases of their own. A vehicle that somebody else armed or flies is waited
for, and once it is disarmed it does not start by itself. Every step has a limit. A vehicle
that is resumed in the air keeps its old target meanwhile: only its speed is set, and not even that
if it flies a mission of ours. Commanded by missions, it gets one that ends at home while it stands
on the ground, and is not ready before it flies it. What counts as consent to fly a vehicle stands
in agent.vehicle.supervision, and what it is asked beforehand in agent.vehicle.preflight.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

from agent.core.interface import Prepare
from agent.vehicle.commands import CommandEnded, RepeatedCommand, VehicleCommand, result_text
from agent.vehicle.firmware.profile import Firmware
from agent.vehicle.flight_limits import LimitsCheck
from agent.vehicle.leg import RepositionLeg
from agent.vehicle.messages import Heartbeat, Inbound, LandedState, Outbound, Position
from agent.vehicle.onboard_mission import OnboardMission
from agent.vehicle.preflight import (
    CruiseSpeedSetting,
    FailsafeCheck,
    aim,
    boot_state,
    home_alt_m,
    start_fault,
    with_warning,
)
from agent.vehicle.runway_check import RunwayCheck
from agent.vehicle.session import PASSES_M, VehicleSession
from agent.vehicle.supervision import PilotConsent
from swarm.model.frames import wgs84_from_enu

_CLIMB_PROGRESS_M = 0.2
_CLIMB_TOLERANCE_FRAC = 0.05
_CLIMB_TOLERANCE_M = 1.0
"""Autopilots end a takeoff that much too low, and go on from there."""
_CAME_DOWN = (
    "it was left in the air and stands on the ground now: look after it, start it with --rejoin"
)
NO_PLACE = "waiting for a position"
_NOT_ITS_TURN = "waiting for its turn to take off"
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
        ours: the vehicle flies, or may fly, on our orders already.
    """

    def __init__(
        self, session: VehicleSession, firmware: Firmware, order: Prepare, *, ours: bool
    ) -> None:
        config = session.config
        self._order = order
        self._session = session
        self._mission = session.mission
        self._config = config
        self._firmware = firmware
        self._aims = order.left_in_air  # where it climbs is still to be found out
        self._mode = _Step(
            f"setting {firmware.commanded_mode_name}", session.repeated("mode", config.mode_tries)
        )
        self._arm = _Step("arming", session.repeated("arm", config.arm_tries))
        # ArduCopter spools up for 3 to 4 s before it leaves the ground.
        self._takeoff = _Step(
            "takeoff", session.repeated("takeoff", config.takeoff_tries, patience=2.0)
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
        self._consent = PilotConsent(firmware, ours=ours or order.resume, begun=order.begun)
        self._leg: RepositionLeg | None = None
        self._barred: bool | None = None
        self._speed = CruiseSpeedSetting(order.speed_m_s, firmware, session)
        self._failsafes = FailsafeCheck(firmware, session)
        self._limits = LimitsCheck(firmware, session, order.speed_m_s)
        self._runway = RunwayCheck(firmware, session, order.runway, order.position_enu_m[2])
        self.waiting_for = "waiting for the autopilot"
        """What is missing, for people."""
        self.done = False
        """The vehicle is where it should be, with its cruise speed set."""
        self.failure: str | None = None
        """Why it will not get there; None while it may."""

    def tell_cautions(self) -> None:
        """Tell what people should know of a vehicle that is armed all the same, once it is read."""
        if self._limits.is_read:
            self._session.tell_caution("limits", self._limits.caution)
        if self._failsafes.is_read:
            self._session.tell_caution("failsafes", self._failsafes.caution)

    @property
    def disturbed(self) -> bool:
        """Whether somebody else was seen to have armed or flown it."""
        return self._armed_by_others or self._flown_by_pilot

    @property
    def engaged(self) -> bool:
        """Whether the motors run, or may run, because of us."""
        return self._arm.command.given > 0 or self._flew

    @property
    def took_off(self) -> bool:
        """Whether takeoff was asked for."""
        return self._takeoff.command.given > 0

    def on_ended(self, ended: CommandEnded) -> None:
        """Take a command's outcome."""
        for step in (self._mode, self._arm, self._takeoff):
            step.command.on_ended(ended, self._session.now_s)
        if self._leg is not None:
            self._leg.on_ended(ended)
        self._speed.on_ended(ended)

    def on_message(self, message: Inbound) -> None:
        """Take what matters of a message beside the vehicle's state."""
        self._failsafes.on_message(message)
        self._limits.on_message(message)
        self._runway.on_message(message)
        if self._leg is not None:
            self._leg.on_message(message)
        self._speed.on_message(message)

    def on_position(self, position: Position) -> None:
        """Take a fresh position: climb and arrival show in it."""
        if position.alt_m > self._highest_m + _CLIMB_PROGRESS_M:
            self._highest_m = position.alt_m
            self._climbed_at_s = self._session.now_s
        if self._leg is not None:
            self._leg.on_position(position)

    def advance(self, heartbeat: Heartbeat) -> None:
        """Do what the state seen asks for next."""
        firmware, vehicle = self._firmware, self._session.vehicle
        if self.done or self.failure is not None:
            return
        if not firmware.has_booted(heartbeat):
            self.waiting_for = boot_state(self._session, self._firmware, heartbeat)
            return
        self._consent.on_heartbeat(heartbeat)
        if self._mission is not None and self._mission_begun:
            self._follow_mission(self._mission, heartbeat)
        elif heartbeat.armed and firmware.is_taking_off(heartbeat.custom_mode):
            self._follow_takeoff(heartbeat.custom_mode)
        elif self.took_off and self._awaits_motors(heartbeat):
            self._session.say(*self._start_motors())
        elif not firmware.is_commanded(heartbeat.custom_mode):
            self._get_commanded(heartbeat)
        elif not heartbeat.armed:
            self.failure = self._left_by_others()
            if self.failure is None:
                started = self._start_motors()
                if self.failure is None:
                    self._failsafes.ask()
                self._session.say(*started)
        elif vehicle.position is None:
            self.waiting_for = NO_PLACE
        elif (airborne := firmware.airborne(vehicle)) is None:
            self.waiting_for = "waiting to hear whether it flies (EXTENDED_SYS_STATE)"
        elif objection := self._consent.objection(airborne=airborne):
            self._flown_by_pilot |= airborne
            self._armed_by_others = True
            self.waiting_for = objection
        elif airborne:
            self._go_on_in_the_air(vehicle.position)
        else:
            self._session.say(*self._take_off(vehicle.position))
        self._session.tell_motors(ours=self.engaged or self._consent.covers(heartbeat))
        if not self.done and self.failure is None:
            self._limits.ask(armed=heartbeat.armed)

    def _get_commanded(self, heartbeat: Heartbeat) -> None:
        """It is in a mode that does not take our targets."""
        firmware, mission = self._firmware, self._mission
        if mission is not None and self._may_fly(mission, heartbeat):
            # Find out whether it is one of ours; the vehicle flies on meanwhile.
            if mission.is_ours:
                self._flew = self.done = True
            else:
                self.waiting_for = "reading the mission that the vehicle flies"
                mission.look()
        elif heartbeat.armed:
            self._flown_by_pilot = True
            mode = firmware.mode_name(heartbeat.custom_mode, self._session.vehicle.told_modes)
            self.waiting_for = (
                f"armed in {mode} by its pilot: land it, "
                f"or switch it to {firmware.commanded_mode_name}"
            )
        elif reason := self._left_by_others():
            self.failure = reason
        else:
            self._session.say(*self._ask(self._mode, firmware.set_commanded_mode()))

    def _may_fly(self, mission: OnboardMission, heartbeat: Heartbeat) -> bool:
        return (
            mission.is_ours is not False
            and self._order.resume
            and not self._flown_by_pilot
            and heartbeat.armed
            and self._firmware.is_mission(heartbeat.custom_mode)
            and self._firmware.airborne(self._session.vehicle) is not False
        )

    def _go_on_in_the_air(self, position: Position) -> None:
        self._flew = True
        self._saw_takeoff |= self._aims and position.rises
        # Repeated now, it would interrupt what follows.
        self._session.say(*self._takeoff.command.cancel(self._session.now_s))
        if self._arm.command.given:  # what it does without us may not have been read to the end
            self._failsafes.ask()
        if not self._climbing or self._high_enough(position):
            self._climbing = False
            self._settle(position)

    def _left_by_others(self) -> str | None:
        """Why it does not start by itself: somebody may be walking up to it."""
        if self._flown_by_pilot:
            return _FLOWN_BY_PILOT
        return _ARMED_BY_OTHERS if self._armed_by_others else None

    def _start_motors(self) -> list[Outbound]:
        vehicle = self._session.vehicle
        if self._flew:
            return self._fail("the vehicle disarmed after takeoff")
        if self._order.left_in_air and not self._arm.command.given:
            return self._wait(NO_PLACE) if vehicle.position is None else self._fail(_CAME_DOWN)
        if self._firmware.first_item is not None and (objection := self._runway.advance()):
            # Its checks fail as long as the landing is what it would begin with.
            return self._wait_for_runway(objection)
        if unready := self._firmware.unready(vehicle):
            return self._wait(with_warning(self._session, unready))
        if objection := self._session.arming_objection():
            return self._wait(objection)
        place = vehicle.position
        if place is not None and (fault := start_fault(self._order, place, self._config)):
            return self._fail(fault)
        if objection := self._failsafes.objection:
            return self._wait(objection)
        if objection := self._session.advance_fence():
            return self._wait(objection)
        if self._mission is not None and not self._mission.is_uploaded:
            return self._upload_way_home(self._mission)
        if objection := self._runway.advance():
            return self._wait_for_runway(objection)
        if self._session.awaits_turn:
            return self._wait(_NOT_ITS_TURN)
        self._session.launched_enu_m = self._session.known_place_m()
        heartbeat = vehicle.heartbeat
        if self._firmware.motors_begin_takeoff and place is not None and heartbeat is not None:
            self._expect_climb(place)
            if not self._awaits_motors(heartbeat):
                command = self._firmware.takeoff(self._start_alt_m(), home_alt_m(place))
                return self._ask(self._takeoff, command)
        self._consent.arm()
        return self._ask(self._arm, self._firmware.arm())

    def _awaits_motors(self, heartbeat: Heartbeat) -> bool:
        """Whether it takes off as soon as its motors run."""
        firmware, mode = self._firmware, heartbeat.custom_mode
        begins = firmware.motors_begin_takeoff and firmware.is_taking_off(mode)
        return begins and not heartbeat.armed

    def _expect_climb(self, position: Position) -> None:
        self._climbing = True
        self._climbed_at_s = self._session.now_s
        self._highest_m = position.alt_m

    def _start_alt_m(self) -> float:
        return wgs84_from_enu(self._config.origin, self._order.position_enu_m)[2]

    def _aims_at(self, position: Position) -> bool:
        """Whether it is known where it climbs."""
        place_enu_m = self._session.known_place_m()
        if self._aims and place_enu_m is not None:
            self._order, self._aims = aim(self._order, place_enu_m, position), False
        return not self._aims

    def _take_off(self, position: Position) -> list[Outbound]:
        if not self._aims_at(position):
            return self._wait(NO_PLACE)
        self._expect_climb(position)
        # Also here, as a vehicle found armed on the ground comes straight to takeoff.
        if objection := self._session.arming_objection():
            return self._wait(objection)
        if fault := start_fault(self._order, position, self._config):
            return self._fail(fault)
        if self._mission is not None and not self._mission.is_uploaded and not self.took_off:
            return self._upload_way_home(self._mission)
        if not self.took_off and (objection := self._runway.advance()):
            return self._wait_for_runway(objection)
        self._session.launched_enu_m = self._session.known_place_m()
        command = self._firmware.takeoff(self._start_alt_m(), home_alt_m(position))
        return self._ask(self._takeoff, command)

    def _follow_takeoff(self, custom_mode: int) -> None:
        """Wait for the end of a takeoff that the vehicle carries out in a mode of its own."""
        firmware = self._firmware
        self._saw_takeoff = True
        if (
            firmware.has_taken_off(custom_mode)
            and not self._flew
            and (self.took_off or not self._consent.needed)
        ):
            self._session.say(*self._takeoff.command.cancel(self._session.now_s))
            self._session.say(*self._ask(self._mode, firmware.set_commanded_mode()))
            return
        if not self.took_off:
            # An earlier life's, or a pilot's.
            self._flown_by_pilot = self._consent.needed
            self.waiting_for = "waiting for the takeoff under way to end"
            return
        self.waiting_for = "climbing"
        # The heartbeat that tells its end may come as late as any other.
        patience_s = self._config.climb_timeout_s + self._config.silence_timeout_s
        if self._session.now_s - self._climbed_at_s > patience_s:
            self.failure = _CLIMB_STOPPED

    def _high_enough(self, position: Position) -> bool:
        start_alt_m = self._start_alt_m()
        height_m = start_alt_m - home_alt_m(position)
        tolerance_m = max(
            self._config.acceptance_radius_m, _CLIMB_TOLERANCE_M, _CLIMB_TOLERANCE_FRAC * height_m
        )
        if self._firmware.traits.needs_runway:  # it has ended its take-off, and circles
            tolerance_m = max(tolerance_m, PASSES_M)
        if position.alt_m >= start_alt_m - tolerance_m:
            return True
        self.waiting_for = f"climbing to {height_m:.0f} m"
        if self._session.now_s - self._climbed_at_s > self._config.climb_timeout_s:
            self.failure = _CLIMB_STOPPED
        return False

    def _settle(self, position: Position) -> None:
        """Fly to the start, unless the vehicle is resumed in the air, and set the speed."""
        speed = self._speed
        if not (self._firmware.traits.stays or self._limits.is_read):
            self.waiting_for = "reading the radius of its circles"  # on which it has arrived
            return
        if self._leg is None and not self._resumes and not self._aims_at(position):
            self.waiting_for = NO_PLACE
            return
        if self._leg is None and not self._resumes and not self._is_barred:
            place = (self._order.position_enu_m, self._order.speed_m_s)
            self._leg = RepositionLeg(self._session, self._firmware, *place)
            self._leg.start()
        leg = self._leg
        # ArduPilot forgets a speed set before the first target after takeoff.
        if (leg is None or leg.accepted) and not speed.begun:
            speed.start()
        speed.on_time()
        self.failure = speed.failure if leg is None else leg.failure or speed.failure
        if self.failure is not None:
            return
        there = (leg is None or leg.arrived) and speed.done
        if there and leg is not None and self._mission is not None:
            self._begin_mission(self._mission)
            return
        self.done = there
        self.waiting_for = "setting the cruise speed" if leg is None else "flying to the start"

    @property
    def _is_barred(self) -> bool:
        """Whether zones lie between it and the start: it is ready where it is, then."""
        if self._barred is None:
            session = self._session
            self._barred = session.way_objection((self._order.position_enu_m,)) is not None
        return self._barred

    @property
    def _resumes(self) -> bool:
        """Whether it flies on orders of an earlier life, beyond its takeoff."""
        taking_off = self._saw_takeoff or self._session.vehicle.landed is LandedState.TAKEOFF
        return self._order.resume and not self.took_off and not taking_off

    def _wait_for_runway(self, objection: str) -> list[Outbound]:
        return self._fail(objection) if self._runway.failure else self._wait(objection)

    def _upload_way_home(self, mission: OnboardMission) -> list[Outbound]:
        """Put a mission on the vehicle that waits at the start and then comes home."""
        now_s, reason = self._session.now_s, mission.failure
        again = f" failed ({reason}), trying again" if reason else ""
        self.waiting_for = f"putting the way home on it{again}"
        if now_s < self._upload_at_s or mission.is_uploading:
            return []
        if self._uploads >= self._config.mode_tries:
            return self._fail(f"the way home cannot be put on it: {reason}")
        self._uploads += 1
        self._upload_at_s = now_s + self._config.retry_delay_s
        return mission.upload(self._order.position_enu_m, self._order.speed_m_s)

    def _begin_mission(self, mission: OnboardMission) -> None:
        """From now on the way home stands on the vehicle whatever becomes of us."""
        if not mission.is_uploaded:  # as it was found in the air
            self._session.say(*self._upload_way_home(mission))
            return
        mission.begin()
        self._mission_begun = True
        self.waiting_for = "starting the mission"

    def _follow_mission(self, mission: OnboardMission, heartbeat: Heartbeat) -> None:
        if not heartbeat.armed:
            self.failure = "the vehicle disarmed after takeoff"
        elif mission.unverified or mission.failure is not None:
            self.failure = mission.failure or "which mission it flies is not known"
        else:
            self.done = mission.is_flown

    def _ask(self, step: _Step, command: VehicleCommand) -> list[Outbound]:
        """What to tell the vehicle, if that step is to be asked for now."""
        session, repeated, refusal = self._session, step.command, ""
        if repeated.refused:
            # Of modes and motors nothing depends on a place.
            words = self._firmware.place_refusal(session.vehicle, repeated.result)
            refusal = words if step is self._takeoff else result_text(repeated.result)
            if text := session.vehicle.telling_warning(session.now_s):
                refusal = f"{refusal}: {text}"
        self._wait(f"{step.what} refused ({refusal}), trying again" if refusal else step.what)
        out = repeated.give(command, session.now_s)
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
