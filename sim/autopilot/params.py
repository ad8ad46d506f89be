"""The parameters of a vehicle: a table ground stations read and write.

A flavour names the parameters; the few that change behaviour carry a `Setting`,
through which the rest of the vehicle reads them in SI units. Source of the
protocol: https://mavlink.io/en/services/parameter.html. Leaves out: persistence,
extended parameters.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from enum import Enum

from pymavlink.dialects.v20 import ardupilotmega as mavlink

from sim.autopilot.events import Outbox, Sender

__all__ = ["Parameter", "ParameterServer", "ParameterTable", "Setting"]

_NO_INDEX = 65535
"""Index in a PARAM_VALUE that answers a request by name, as the autopilots send it."""


class Setting(Enum):
    """What a parameter means to the vehicle, in SI units."""

    CRUISE_M_S = "cruise"
    CLIMB_M_S = "climb"
    LAND_M_S = "land"
    RETURN_HEIGHT_M = "return height"
    RETURN_WAIT_S = "return wait"
    DISARM_DELAY_S = "disarm delay"


@dataclass(frozen=True, slots=True)
class Parameter:
    """One entry of the table."""

    name: str
    value: float
    type: int
    """MAV_PARAM_TYPE."""
    setting: Setting | None = None
    unit_si: float = 1.0
    """SI units per unit of the parameter, such as 0.01 for cm."""
    least: float = -math.inf
    """Smallest value that is taken."""
    read_only: bool = False


class ParameterTable:
    """Parameters in their fixed order."""

    def __init__(self, parameters: Sequence[Parameter]) -> None:
        self._table = {parameter.name: parameter for parameter in parameters}
        if len(self._table) != len(parameters):
            raise ValueError("parameter names must differ")
        self._by_setting = {
            parameter.setting: parameter.name
            for parameter in parameters
            if parameter.setting is not None
        }

    def __len__(self) -> int:
        return len(self._table)

    def __iter__(self) -> Iterator[Parameter]:
        return iter(self._table.values())

    def get(self, name: str) -> Parameter | None:
        """The parameter of that name, if there is one."""
        return self._table.get(name)

    def at(self, index: int) -> Parameter | None:
        """The parameter at that place of the list, if there is one."""
        names = list(self._table)
        return self._table[names[index]] if 0 <= index < len(names) else None

    def value_si(self, setting: Setting) -> float:
        """What the vehicle goes by, in SI units."""
        parameter = self._table[self._by_setting[setting]]
        return parameter.value * parameter.unit_si

    def write(self, name: str, value: float) -> Parameter:
        """Change a value; the parameter as it is then."""
        changed = replace(self._table[name], value=value)
        self._table[name] = changed
        return changed


class ParameterServer:
    """Answers what ground stations ask of the table."""

    def __init__(
        self,
        table: ParameterTable,
        outbox: Outbox,
        *,
        reports_errors: bool,
        unanswered: frozenset[str],
    ) -> None:
        self._table = table
        self._outbox = outbox
        self._reports_errors = reports_errors
        """Whether the firmware knows PARAM_ERROR; otherwise it keeps silent."""
        self._unanswered = unanswered

    def announce(self, name: str, value: float) -> None:
        """Change a value from inside and tell everybody."""
        self._outbox.broadcast(self._value(self._table.write(name, value), _NO_INDEX))

    def read(self, message: mavlink.MAVLink_message, sender: Sender) -> None:
        """Answer PARAM_REQUEST_READ, by name or by index."""
        index = message.param_index
        parameter = self._table.get(message.param_id) if index < 0 else self._table.at(index)
        if parameter is None:
            self._refuse(message, mavlink.MAV_PARAM_ERROR_DOES_NOT_EXIST, sender)
            return
        self._outbox.reply(sender, self._value(parameter, _NO_INDEX if index < 0 else index))

    def list_all(self, sender: Sender) -> None:
        """Answer PARAM_REQUEST_LIST."""
        for index, parameter in enumerate(self._table):
            self._outbox.reply(sender, self._value(parameter, index))

    def write(self, message: mavlink.MAVLink_message, sender: Sender) -> None:
        """Obey PARAM_SET; a value out of range or of a read-only parameter is refused."""
        parameter = self._table.get(message.param_id)
        value = message.param_value
        if parameter is None:
            self._refuse(message, mavlink.MAV_PARAM_ERROR_DOES_NOT_EXIST, sender)
        elif not math.isfinite(value) or value < parameter.least:
            self._refuse(message, mavlink.MAV_PARAM_ERROR_VALUE_OUT_OF_RANGE, sender)
        elif parameter.read_only:
            self._refuse(message, mavlink.MAV_PARAM_ERROR_READ_ONLY, sender)
        else:
            self.announce(parameter.name, value)

    def _refuse(self, message: mavlink.MAVLink_message, error: int, sender: Sender) -> None:
        if self._reports_errors and message.param_id not in self._unanswered:
            self._outbox.reply(
                sender,
                mavlink.MAVLink_param_error_message(
                    sender.system,
                    sender.component,
                    message.param_id.encode(errors="replace")[:16],
                    getattr(message, "param_index", -1),
                    error,
                ),
            )

    def _value(self, parameter: Parameter, index: int) -> mavlink.MAVLink_message:
        return mavlink.MAVLink_param_value_message(
            parameter.name.encode(), parameter.value, parameter.type, len(self._table), index
        )
