"""A parameter of the vehicle that is another one during a flight, and put back after it.

Firmwares limit by a parameter how fast the acceleration may change when they fly to a target by
themselves, and come with a limit so low that it costs seconds of every leg. No command and no
mission item says otherwise, so the parameter is overridden: set before the flight, put back when
the vehicle is on its way home or is somebody else's. The value that is set carries the vehicle's
own one in its decimals; so whoever finds it, such as an agent that was killed and started anew on
another computer, knows what to put back.

Protocol: https://mavlink.io/en/services/parameter.html
"""

from __future__ import annotations

import math
from dataclasses import dataclass

from agent.vehicle.commands import CommandPolicy
from agent.vehicle.messages import Inbound, Outbound, ParameterRead, ParameterSet, ParameterValue

_MARK = 1e-3
"""Of the vehicle's own value, added to what is set for the flight."""
_DECIMALS = 2
"""Of the vehicle's own value, as far as the mark of a 32-bit float carries them."""
_SELDOM = 10.0
"""Once that was complained of, it is tried that much more slowly, for as long as need be."""
_SAME = 1e-5
"""Two values that differ by this share are the same one, as 32-bit floats are told."""


@dataclass(frozen=True, slots=True)
class OverrideSpec:
    """Which parameter is overridden, and what it is for the flight."""

    names: tuple[str, ...]
    """Every name that the parameter has had; values mean the same under all."""
    value: float
    """At least this much during a flight; a vehicle that has more keeps it."""

    def override(self, own: float) -> float:
        """What is set for the flight of a vehicle whose own value is ``own``."""
        return self.value + _MARK * own if 0.0 < own < self.value else own

    def own(self, found: float) -> float:
        """The vehicle's own value behind one that was found on it, overridden or not."""
        excess = found - self.value
        if _SAME * self.value < excess <= _MARK * self.value * (1.0 + _SAME):
            return round(excess / _MARK, _DECIMALS)
        return found


class ParameterOverride:
    """One parameter of one vehicle, on its way to what it should be.

    Args:
        override_spec: which, and what it is for a flight.
        policy: how often and how long to ask.
    """

    def __init__(self, override_spec: OverrideSpec, policy: CommandPolicy) -> None:
        self._lending = override_spec
        self._policy = policy
        self._name: str | None = None
        self._own: float | None = None
        self._found = math.nan
        self._wanted = False
        self._tries = 0
        self._next_at_s = -math.inf
        self._complaint: str | None = None

    def want(self, wanted: bool) -> None:
        """Say whether it should be as for a flight, or the vehicle's own."""
        if wanted is not self._wanted:
            self._wanted, self._tries, self._next_at_s = wanted, 0, -math.inf
            self._complaint = None

    def on_message(self, message: Inbound) -> None:
        """A value that the vehicle tells."""
        if not isinstance(message, ParameterValue) or message.name not in self._lending.names:
            return
        self._name, self._found = message.name, message.value
        if self._own is None:
            self._own = self._lending.own(message.value)
            self._next_at_s = -math.inf

    def advance(self, now_s: float) -> list[Outbound]:
        """Ask, or set, as long as it is not as wanted."""
        if self._is_as_wanted or now_s < self._next_at_s:
            return []
        self._tries += 1
        if self._tries == self._policy.tries + 1:
            self._complain()
        pace = 1.0 if self._tries <= self._policy.tries else _SELDOM
        self._next_at_s = now_s + pace * self._policy.ack_timeout_s
        if self._name is None or self._own is None:
            return [ParameterRead(name) for name in self._lending.names]
        return [ParameterSet(self._name, self._target(self._own))]

    def next_deadline_s(self) -> float | None:
        """When `advance` has something to do; None if it has not."""
        return None if self._is_as_wanted else self._next_at_s

    @property
    def complaint(self) -> str | None:
        """What cannot be done, in words; None as long as it may be."""
        return None if self._is_as_wanted else self._complaint

    @property
    def _is_as_wanted(self) -> bool:
        if self._own is None:
            return not self._wanted
        target = self._target(self._own)
        return abs(self._found - target) <= _SAME * max(1.0, abs(target))

    def _target(self, own: float) -> float:
        return self._lending.override(own) if self._wanted else own

    def _complain(self) -> None:
        names = self._name or " or ".join(self._lending.names)
        if self._wanted:
            self._complaint = f"{names} cannot be set for the flight, so legs take longer"
        else:
            self._complaint = (
                f"{names} cannot be put back: it may be {self._found:g}, and was {self._own:g}"
            )
