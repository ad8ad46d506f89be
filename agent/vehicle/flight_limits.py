"""How fast a vehicle flies its legs, read from its parameters while it is prepared, and told.

Read once for each preparation, a departure from a base included; nobody waits for it. What the
mission says of the acceleration goes before it: then a vehicle that is set otherwise is named.
"""

from __future__ import annotations

from dataclasses import replace
from typing import Final

from agent.core.interface import FlightLimits
from agent.vehicle.firmware.kinematics import Kinematics, NamedLimit
from agent.vehicle.firmware.profile import Firmware
from agent.vehicle.messages import Inbound, ParameterRead
from agent.vehicle.parameter_override import OverrideSpec
from agent.vehicle.parameter_reading import PAUSE_TIMEOUTS, TRIES, ParameterReading
from agent.vehicle.session import VehicleSession
from swarm.model.vehicles import turn_radius_m

_TRIES_ARMED: Final = 4
"""A vehicle that is about to take off has that many until what is known is told."""
_WORTH_TELLING_FRAC: Final = 0.1
"""By so much a vehicle may be set otherwise than the mission says, before people are told."""


class LimitsReading:
    """The parameters of one vehicle that say how it flies its legs.

    Args:
        overridden: the limit of jerk that is another one in flight; None if none is.
    """

    def __init__(self, firmware: Firmware, overridden: OverrideSpec | None) -> None:
        self._firmware = firmware
        self._overridden = overridden
        parameters = firmware.limit_parameters
        self._parameters = ParameterReading(firmware, (each.name for each in parameters))
        limits = dict.fromkeys(each.limit for each in parameters)
        self._wanted = tuple(
            tuple(each.name for each in parameters if each.limit == limit) for limit in limits
        )

    @property
    def unread(self) -> tuple[str, ...]:
        """Names that have been neither told nor denied; none of a parameter that is told."""
        return self._parameters.unread(self._wanted)

    def on_message(self, message: Inbound) -> None:
        """Take a parameter's value, or that there is none."""
        self._parameters.on_message(message)

    @property
    def kinematics(self) -> Kinematics:
        """How it flies its legs, as far as it has told."""
        values, spec = dict(self._parameters.values), self._overridden
        if spec is not None:
            found = values.keys() & set(spec.names)
            values.update({name: spec.override(spec.own(values[name])) for name in found})
        return self._firmware.kinematics(values)


class LimitsCheck:
    """Reads them of the vehicle of a session, and says what comes of it.

    Args:
        speed_m_s: cruise speed that the vehicle is asked for.
    """

    def __init__(self, firmware: Firmware, session: VehicleSession, speed_m_s: float) -> None:
        self._session = session
        self._speed_m_s = speed_m_s
        overridden = firmware.override_spec if session.config.raises_jerk else None
        self._reading = LimitsReading(firmware, overridden)
        self._tries = 0
        self._next_s = 0.0
        self._told = False

    def on_message(self, message: Inbound) -> None:
        """Take a parameter's value, or that there is none."""
        self._reading.on_message(message)

    def ask(self, *, armed: bool) -> None:
        """Read what is due, and tell it once all is known that will be before it flies."""
        session, names = self._session, self._reading.unread
        if self._told:
            return
        if not names or self._tries >= (_TRIES_ARMED if armed else TRIES):
            self._told = True
            self._tell()
        elif session.now_s >= self._next_s:
            self._tries += 1
            self._next_s = session.now_s + PAUSE_TIMEOUTS * session.config.commands.ack_timeout_s
            session.say(*map(ParameterRead, names))

    @property
    def is_read(self) -> bool:
        """Whether all is known that will be before it flies."""
        return self._told

    @property
    def caution(self) -> str | None:
        """What people should know of the vehicle, once that is read; None if there is nothing."""
        told = self._reading.kinematics
        planned_m_s2 = self._session.planned_m_s2
        parts = [f"its {each.name} of {each.value:g} is not believed" for each in told.absurd]
        if told.circle is not None and planned_m_s2 is not None:
            planned_m = turn_radius_m(self._speed_m_s, planned_m_s2)
            parts += _otherwise(told.circle, planned_m, "m", "the plan counts on")
        if told.acceleration is not None and planned_m_s2 is not None:
            parts += _otherwise(told.acceleration, planned_m_s2, "m/s²", "the plan counts on")
        if told.speed is not None and told.speed.value < self._speed_m_s:
            parts += _otherwise(told.speed, self._speed_m_s, "m/s", "asked for")
        return "; ".join(parts) or None

    def _tell(self) -> None:
        session, told = self._session, self._reading.kinematics
        session.absurd_parameters.update(each.name for each in told.absurd)
        acceleration_m_s2 = None if told.acceleration is None else told.acceleration.value
        session.set_m_s2 = acceleration_m_s2
        session.told_circle_m = None if told.circle is None else told.circle.value
        limits = FlightLimits(told.leg_acceleration_m_s2(self._speed_m_s))
        if told.speed is not None:
            limits = replace(limits, speed_m_s=told.speed.value)
        if limits != session.told_limits:
            session.told_limits = limits
            session.report(limits)


def _otherwise(found: NamedLimit, counted: float, unit: str, by: str) -> list[str]:
    """What is said of a limit that differs from what is counted on; nothing if it hardly does."""
    if abs(found.value / counted - 1.0) <= _WORTH_TELLING_FRAC:
        return []
    return [f"its {found.name} is {found.value:.3g} {unit}, {by} {counted:g}"]
