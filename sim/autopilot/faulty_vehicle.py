"""A simulated vehicle to which faults happen, each at its own instant.

It takes the place of a `SimulatedAutopilot` and is driven in the same way.
"""

from __future__ import annotations

import math
from dataclasses import replace

from pymavlink.dialects.v20 import ardupilotmega as mavlink

from sim.autopilot.events import (
    MavlinkReceived,
    OutgoingMessage,
    Reboot,
    TimeAdvanced,
    VehicleEvent,
)
from sim.autopilot.faults import FaultKind, VehicleFault
from sim.autopilot.flight import FlightMode, MotionPhase
from sim.autopilot.pilot import Pilot
from sim.autopilot.vehicle import COMPONENT_ID, SimulatedAutopilot

_DEFECT = "Compass not healthy"
_SYSTEM_IDS = 254

_NAVIGATION = frozenset({MotionPhase.NAVIGATING})
_NEEDS_POSITION = frozenset({MotionPhase.NAVIGATING, MotionPhase.RETURNING})


class FaultyAutopilot:
    """A vehicle not yet used, powered up at ``start_s``, and its faults in any order."""

    def __init__(
        self, vehicle: SimulatedAutopilot, faults: tuple[VehicleFault, ...], start_s: float
    ) -> None:
        self._vehicle = vehicle
        self._unscheduled = [fault for fault in faults if fault.at_s > 0.0]
        """Faults that wait for the first arming."""
        self._ahead: list[tuple[float, bool, VehicleFault]] = []
        """When each fault begins (True) or ends (False), soonest first."""
        self._active: list[VehicleFault] = []
        self._pilot = vehicle.pilot
        """The one that has been told of the active faults."""
        self._mode_before: FlightMode | None = None
        """What the vehicle flew in when the pilot took over."""
        self._schedule([fault for fault in faults if fault.at_s == 0.0], start_s)

    @property
    def pilot(self) -> Pilot:
        """The autopilot inside, to look at."""
        return self._vehicle.pilot

    def next_deadline_s(self) -> float:
        """When `step` should be called at the latest [s]."""
        deadline_s = self._vehicle.next_deadline_s()
        return min(deadline_s, self._ahead[0][0]) if self._ahead else deadline_s

    def step(self, event: VehicleEvent, now_s: float) -> list[OutgoingMessage]:
        """Take an event at ``now_s``, after faults due by then; what is to be sent, in order."""
        said: list[OutgoingMessage] = []
        while self._ahead and self._ahead[0][0] <= now_s:
            at_s, begins, fault = self._ahead.pop(0)
            said += self._take(TimeAdvanced(), at_s)
            said += self._begin(fault, at_s) if begins else self._end(fault, at_s)
        if isinstance(event, MavlinkReceived) and self._active:
            said += self._receive(event, now_s)
        else:
            said += self._take(event, now_s)
        if self._unscheduled and self._vehicle.pilot.armed:
            faults, self._unscheduled = self._unscheduled, []
            self._schedule(faults, now_s)
        return said

    def _schedule(self, faults: list[VehicleFault], start_s: float) -> None:
        for fault in faults:
            begins_s = start_s + fault.at_s
            self._ahead.append((begins_s, True, fault))
            if fault.duration_s < math.inf:
                self._ahead.append((begins_s + fault.duration_s, False, fault))
        self._ahead.sort(key=lambda due: due[0])

    def _is(self, kind: FaultKind) -> bool:
        return any(fault.kind is kind for fault in self._active)

    def _begin(self, fault: VehicleFault, at_s: float) -> list[OutgoingMessage]:
        pilot = self._vehicle.pilot
        match fault.kind:
            case FaultKind.REBOOT:
                return self._take(Reboot(), at_s)
            case FaultKind.BATTERY_LOW:
                pilot.battery.drop_to(fault.charge_frac, at_s)
            case FaultKind.FAILSAFE_RTL:
                pilot.failsafes.lose_radio(at_s)
            case FaultKind.PILOT:
                self._mode_before = pilot.mode
                pilot.set_mode(pilot.flavour.modes.by_hand, at_s)
                self._active.append(fault)
            case _:
                self._active.append(fault)
                self._apply(at_s)
        return self._take(TimeAdvanced(), at_s)

    def _end(self, fault: VehicleFault, at_s: float) -> list[OutgoingMessage]:
        self._active.remove(fault)
        if fault.kind is FaultKind.PILOT and self._mode_before is not None:
            self._vehicle.pilot.set_mode(self._mode_before, at_s)
        self._apply(at_s)
        return self._take(TimeAdvanced(), at_s)

    def _apply(self, now_s: float) -> None:
        """Make the autopilot have the active faults, and no others."""
        pilot = self._pilot = self._vehicle.pilot
        pilot.readiness.defect = _DEFECT if self._is(FaultKind.REFUSE_ARMING) else None
        hindered: frozenset[MotionPhase] = frozenset()
        if self._is(FaultKind.STUCK):
            hindered |= _NAVIGATION
        if self._is(FaultKind.GPS_LOST):
            hindered |= _NEEDS_POSITION
            pilot.failsafes.lose_gps(now_s)
        else:
            pilot.failsafes.regain_gps(now_s)
        pilot.flight.hinder(hindered, now_s)

    def _receive(self, event: MavlinkReceived, now_s: float) -> list[OutgoingMessage]:
        """Hear a message the way a vehicle with faults does."""
        message = event.message
        target = getattr(message, "target_system", 0)
        own_id = self._vehicle.config.system_id
        if self._is(FaultKind.SILENT):
            return self._take(TimeAdvanced(), now_s)
        if self._is(FaultKind.WRONG_ID) and target == own_id:
            return self._take(TimeAdvanced(), now_s)
        if (
            self._is(FaultKind.REJECT_MISSION)
            and message.get_msgId() == mavlink.MAVLINK_MSG_ID_MISSION_COUNT
            and target in (0, own_id)
            and message.target_component in (0, COMPONENT_ID)
        ):
            refusal = mavlink.MAVLink_mission_ack_message(
                message.get_srcSystem(),
                message.get_srcComponent(),
                mavlink.MAV_MISSION_ERROR,
                message.mission_type,
            )
            return [
                *self._take(TimeAdvanced(), now_s),
                *self._altered([OutgoingMessage(refusal, event.channel)]),
            ]
        return self._take(event, now_s)

    def _take(self, event: VehicleEvent, now_s: float) -> list[OutgoingMessage]:
        said = self._vehicle.step(event, now_s)
        if self._vehicle.pilot is not self._pilot:  # it has begun anew, and knows of no faults
            self._apply(now_s)
        return self._altered(said) if self._active else said

    def _altered(self, said: list[OutgoingMessage]) -> list[OutgoingMessage]:
        """What others hear of it."""
        if self._is(FaultKind.SILENT):
            return []
        if self._is(FaultKind.WRONG_ID):
            other_id = self._vehicle.config.system_id % _SYSTEM_IDS + 1
            return [replace(send, system_id=other_id) for send in said]
        return said
