"""Some of one vehicle's parameters, read by every name that they have had.

Protocol: https://mavlink.io/en/services/parameter.html
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from types import MappingProxyType
from typing import Final

from agent.vehicle.firmware.profile import Firmware
from agent.vehicle.messages import Inbound, ParameterMissing, ParameterValue

PAUSE_TIMEOUTS: Final = 0.5
"""A parameter is asked for again after that many timeouts of a command: reading does no harm..."""

TRIES: Final = 20
"""...and so often before it counts as not known: one that a poor link loses keeps the vehicle on
the ground, and older firmware does not say that it has none of that name."""


class ParameterReading:
    """What a vehicle has told of its parameters of these ``names``."""

    def __init__(self, firmware: Firmware, names: Iterable[str]) -> None:
        self._firmware = firmware
        self._values: dict[str, float] = {}
        self._missing: set[str] = set()
        self.names = tuple(names)
        """All that may be read."""

    @property
    def values(self) -> Mapping[str, float]:
        """By name, as the firmware means them."""
        return MappingProxyType(self._values)

    def unread(self, wanted: Iterable[Sequence[str]]) -> tuple[str, ...]:
        """Of parameters, each by all its names, those that were neither told nor denied; none of
        a parameter that was told."""
        return tuple(
            name
            for names in wanted
            if not any(each in self._values for each in names)
            for name in names
            if name not in self._missing
        )

    def on_message(self, message: Inbound) -> None:
        """Take a parameter's value, or that there is none."""
        if isinstance(message, ParameterValue) and message.name in self.names:
            self._values[message.name] = self._firmware.value_of(message)
        elif isinstance(message, ParameterMissing) and message.name in self.names:
            self._missing.add(message.name)
