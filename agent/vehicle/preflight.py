"""What is read from a vehicle, set on it and judged before it flies.

Read: what it does when its agent falls silent and when its battery is low, from its parameters,
by all the names they have had. Simulated autopilots of ours say that they are, and are flown as
they are. Set: the cruise speed, by command, or by the parameter if the command is refused.
Judged: whether the start can be reached from where the vehicle stands.
"""

from __future__ import annotations

import math
from dataclasses import replace

from agent.core.interface import Prepare
from agent.vehicle.commands import CommandEnded, CommandOutcome
from agent.vehicle.config import BridgeConfig, CommandStyle
from agent.vehicle.firmware.arduplane import ArduPlane
from agent.vehicle.firmware.failsafes import Failsafes
from agent.vehicle.firmware.profile import Firmware
from agent.vehicle.messages import (
    Heartbeat,
    Inbound,
    ParameterRead,
    ParameterSet,
    ParameterValue,
    Position,
)
from agent.vehicle.parameter_reading import PAUSE_TIMEOUTS, TRIES, ParameterReading
from agent.vehicle.session import VehicleSession
from swarm.model.frames import enu_from_wgs84, wgs84_from_enu
from swarm.model.vehicles import TRAITS, VehicleKind
from swarm.protocol.fields import Point

_SIMULATED = "SWARM_SIMULATED"
"""Parameter of the autopilots that `swarm autopilot` simulates; no firmware has it."""
_STATE_UNINIT = 0
"""MAV_STATE."""
_PREARM_TEXT_AGE_S = 35.0
"""ArduPilot repeats what fails before arming every 30 s."""


class FailsafeReading:
    """The parameters of one vehicle that say what it does without its agent.

    Args:
        own_system_id: the agent's, to which the vehicle should listen.
        may_be_simulated: whether it matters that it is.
    """

    def __init__(
        self, firmware: Firmware, own_system_id: int, *, may_be_simulated: bool = True
    ) -> None:
        self._firmware = firmware
        self._own_system_id = own_system_id
        self._may_be_simulated = may_be_simulated
        names = (name for names in firmware.failsafe_names for name in names)
        self._parameters = ParameterReading(firmware, (*names, _SIMULATED))
        self.names = self._parameters.names
        """All that may be read."""

    @property
    def unread(self) -> tuple[str, ...]:
        """Names that have been neither told nor denied; none of a parameter that is told."""
        return () if self.simulated else self._parameters.unread(self._wanted)

    @property
    def failsafes(self) -> Failsafes:
        """What the vehicle does, as far as it has told."""
        return self._firmware.failsafes(self._parameters.values, self._own_system_id)

    @property
    def simulated(self) -> bool:
        """Whether it is one of our simulated autopilots."""
        return bool(self._parameters.values.get(_SIMULATED))

    def on_message(self, message: Inbound) -> None:
        """Take a parameter's value, or that there is none."""
        self._parameters.on_message(message)

    @property
    def _wanted(self) -> tuple[tuple[str, ...], ...]:
        """What is to be read; whether it is simulated only where something is amiss."""
        own, told = self._firmware.failsafe_names, self.failsafes
        fine = told.comes_home and told.battery is None
        return (*own, (_SIMULATED,)) if self._may_be_simulated and not fine else own


class FailsafeCheck:
    """Reads one vehicle's failsafes while it stands on the ground."""

    def __init__(self, firmware: Firmware, session: VehicleSession) -> None:
        self._session = session
        self._config = config = session.config
        accepted = config.accept_no_failsafe
        self._reading = FailsafeReading(
            firmware, config.ground_system_id, may_be_simulated=not accepted
        )
        self._tries = 0
        self._next_s = 0.0
        self._settled = False

    def on_message(self, message: Inbound) -> None:
        """Take a parameter's value, or that there is none."""
        self._reading.on_message(message)

    def ask(self) -> None:
        """Read what is due."""
        names, now_s = self._reading.unread, self._session.now_s
        self._settled |= not names
        if now_s < self._next_s:
            return
        self._settled |= self._tries >= TRIES
        self._tries += 1
        pause_s = PAUSE_TIMEOUTS * self._config.commands.ack_timeout_s
        if self._settled:
            # What keeps the vehicle on the ground may still come, or be set meanwhile.
            pause_s = self._config.retry_delay_s
            names = self._reading.names if self.objection else ()
        self._next_s = now_s + pause_s
        self._session.say(*map(ParameterRead, names))

    @property
    def is_read(self) -> bool:
        """Whether all is known that will be before it flies."""
        return self._settled

    @property
    def objection(self) -> str | None:
        """Why the vehicle is not armed, in words; None if it may be."""
        if self._by_missions or self._config.accept_no_failsafe:
            return None
        if not self._settled:
            return "reading what it does if its agent dies"
        told = self._reading.failsafes
        if not self._matters(told):
            return None
        return (
            f"if its agent dies it {told.agent_lost}: {told.remedy}, "
            "fly it with --command mission, or accept it with --accept-no-failsafe"
        )

    @property
    def caution(self) -> str | None:
        """What people should know of a vehicle that is armed; None if there is nothing."""
        told = self._reading.failsafes
        if self._reading.simulated or not self._settled:
            return None
        lost = f"if its agent dies it {told.agent_lost}" if self._matters(told) else None
        return "; ".join(part for part in (lost, told.battery) if part is not None) or None

    def _matters(self, told: Failsafes) -> bool:
        """Whether nobody would bring the vehicle home."""
        return not (told.comes_home or self._by_missions or self._reading.simulated)

    @property
    def _by_missions(self) -> bool:
        """Whether every mission ends at home."""
        return self._config.command is CommandStyle.MISSION


_SPEED_TAG = "speed"

_TOLERANCE_FRAC = 0.01


class CruiseSpeedSetting:
    """One cruise speed on its way into one vehicle."""

    def __init__(self, speed_m_s: float, firmware: Firmware, session: VehicleSession) -> None:
        self._session = session
        self._command = firmware.change_speed(speed_m_s)
        self._values = {p.name: speed_m_s * p.units_per_m_s for p in firmware.speed_parameters}
        self._name: str | None = None
        self._asking_parameters = False
        self._tries = 0
        self._deadline_s = 0.0
        self.begun = False
        self.done = False
        """The vehicle took the speed."""
        self.failure: str | None = None

    def start(self) -> None:
        """Tell the vehicle."""
        self.begun = True
        self._session.send(_SPEED_TAG, self._command)

    def on_ended(self, ended: CommandEnded) -> None:
        """Take the outcome of the command; refused, turn to the parameter."""
        if ended.tag != _SPEED_TAG or self.done:
            return
        if ended.ending is CommandOutcome.ACCEPTED:
            self.done = True
        else:
            self._asking_parameters = True
            self._ask()

    def on_message(self, message: Inbound) -> None:
        """A parameter's value: set it, or see that it is set."""
        if not self._asking_parameters or self.done or not isinstance(message, ParameterValue):
            return
        wanted = self._values.get(message.name)
        if wanted is None:
            return
        if abs(message.value - wanted) <= _TOLERANCE_FRAC * wanted:
            self.done = True
        elif self._name is None:  # else asked to change it already: the repetition is timed
            self._name = message.name
            self._ask()

    def on_time(self) -> None:
        """Ask again, or give up."""
        asking = self._asking_parameters and not self.done and self.failure is None
        if not asking or self._session.now_s < self._deadline_s:
            return
        if self._tries < self._session.config.commands.tries:
            self._ask()
        else:
            names = f", neither by command nor by {' or '.join(self._values)}"
            self.failure = f"the cruise speed cannot be set{names if self._values else ''}"

    def _ask(self) -> None:
        session = self._session
        self._tries += 1
        self._deadline_s = session.now_s + session.config.commands.ack_timeout_s
        if self._name is None:
            session.say(*map(ParameterRead, self._values))
        else:
            session.say(ParameterSet(self._name, self._values[self._name]))


_NULL_ISLAND = ", near 0° N 0° E: a PX4 before 1.16 starts its own simulator there"


def home_alt_m(position: Position) -> float:
    """Home's height above mean sea level, of which the vehicle's two heights differ [m]."""
    return position.alt_m - position.relative_alt_m


def aim(order: Prepare, place_enu_m: Point, position: Position) -> Prepare:
    """That order for a vehicle that an earlier life had take off from where it is.

    That may be far from its start, at a base: it climbs there, as high above its home as it would
    at its start.

    Args:
        order: of a start.
        place_enu_m: where it is [m; mission origin].
        position: where that is by its own word, and how high above its home.
    """
    up_m = order.position_enu_m[2]
    if order.ground_up_m is not None:
        home_up_m = place_enu_m[2] - position.relative_alt_m
        up_m = home_up_m + up_m - order.ground_up_m
    return replace(order, position_enu_m=(*place_enu_m[:2], up_m), ground_up_m=None)


def start_fault(order: Prepare, position: Position, config: BridgeConfig) -> str | None:
    """Why the start cannot be reached from where the vehicle stands; None if it can."""
    east_m, north_m, _ = enu_from_wgs84(
        config.origin, position.lat_deg, position.lon_deg, position.alt_m
    )
    distance_m = math.hypot(east_m, north_m)
    if distance_m > config.fence_radius_m:
        cause = _NULL_ISLAND if max(abs(position.lat_deg), abs(position.lon_deg)) < 1.0 else ""
        return f"the vehicle stands {distance_m / 1e3:.1f} km from the mission's origin{cause}"
    home_m = home_alt_m(position)
    east_m, north_m, _ = order.position_enu_m
    if order.ground_up_m is not None:
        _, _, ground_alt_m = wgs84_from_enu(config.origin, (east_m, north_m, order.ground_up_m))
        if not abs(home_m - ground_alt_m) <= config.home_tolerance_m:
            return (
                f"home is at {home_m:.0f} m above sea level, the scenario says "
                f"{ground_alt_m:.0f} m there: correct [origin] alt_m, or position_m"
            )
    if TRAITS[order.vehicle].drives:
        return None
    _, _, start_alt_m = wgs84_from_enu(config.origin, order.position_enu_m)
    height_m = start_alt_m - home_m
    if height_m < config.takeoff_min_m:
        return (
            f"the start lies {height_m:.1f} m above the vehicle's home, "
            f"at least {config.takeoff_min_m:g} m are needed"
        )
    # Start and home both lie within the fence, or one of the two heights told is wrong.
    if height_m > 2.0 * config.fence_height_m:
        return f"the start lies {height_m:.0f} m above the vehicle's home"
    return None


def wrong_kind(order: Prepare, firmware: Firmware | None) -> str | None:
    """Why the vehicle is not the one that the scenario has; None if it may be."""
    if firmware is None or firmware.kind is order.vehicle:
        return None
    told = f"the vehicle is a {firmware.kind}, the scenario has a {order.vehicle}"
    mistaken = isinstance(firmware, ArduPlane) and order.vehicle is VehicleKind.QUADPLANE
    return f"{told} (if it has rotors, set Q_MAV_TYPE 22)" if mistaken else told


def boot_state(session: VehicleSession, firmware: Firmware, heartbeat: Heartbeat) -> str:
    """Why a vehicle that has just booted is not ready to be told anything.

    PX4 is "uninitialised" whenever its checks fail while it is disarmed, and they say why.
    """
    unready = firmware.unready(session.vehicle)
    if heartbeat.system_status == _STATE_UNINIT and session.vehicle.prearm_heard and unready:
        return with_warning(session, unready)
    return "the autopilot is booting"


def with_warning(session: VehicleSession, reason: str) -> str:
    """The reason, and what the vehicle has said lately of what it lacks."""
    text = session.vehicle.recent_warning(session.now_s, _PREARM_TEXT_AGE_S)
    return f"{reason} ({text})" if text else reason
