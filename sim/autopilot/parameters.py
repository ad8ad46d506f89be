"""The parameters of a vehicle: a table ground stations read and write.

A firmware names the parameters; the few that change behaviour carry a `ParameterRole`, through
which the rest of the vehicle reads them in SI units. Source of the protocol:
https://mavlink.io/en/services/parameter.html. Persistence and extended parameters are left out.
"""

from __future__ import annotations

import math
import struct
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from enum import Enum

from pymavlink.dialects.v20 import ardupilotmega as mavlink

from sim.autopilot.events import Outbox, Sender

_NO_INDEX = 65535
"""Index in a PARAM_VALUE that answers a request by name, as the autopilots send it."""


class ParameterRole(Enum):
    """What a parameter means to the vehicle, in SI units."""

    CRUISE_M_S = "cruise"
    CLIMB_M_S = "climb"
    TAKE_OFF_M_S = "take-off"
    LAND_M_S = "land"
    RETURN_HEIGHT_M = "return height"
    RETURN_WAIT_S = "return wait"
    DISARM_DELAY_S = "disarm delay"
    DISARM_LANDED_S = "disarm delay after landing"
    TAKE_OFF_HEIGHT_M = "take-off height"
    CORNER_RADIUS_M = "corner radius"
    ACCELERATION_M_S2 = "acceleration"
    JERK_M_S3 = "jerk"
    TOP_SPEED_M_S = "top speed"


_FOLLOWED = {ParameterRole.TAKE_OFF_M_S: ParameterRole.CLIMB_M_S}
"""Settings that go by another one where the firmware has no parameter for them."""
ENDLESS = 1e6
"""Value of a limit that there is not."""
_DEFAULTS_SI = {
    ParameterRole.DISARM_LANDED_S: 0.0,
    ParameterRole.TAKE_OFF_HEIGHT_M: 0.0,
    ParameterRole.TOP_SPEED_M_S: ENDLESS,
}
"""Values of settings where the firmware has no parameter for them."""


@dataclass(frozen=True, slots=True)
class ParameterBehaviour:
    """How a firmware speaks of its parameters."""

    reports_errors: bool = False
    """Whether an unknown parameter is answered by PARAM_ERROR; otherwise by nothing."""
    integers_bytewise: bool = False
    """Whether the bytes of an integer travel in the float field, instead of its value."""
    index_by_name: bool = False
    """Whether an answer to a request by name tells the index."""
    tells_changes: bool = False
    """Whether a value that was changed is told once more than the answer does."""
    unanswered: frozenset[str] = frozenset()
    """Unknown parameters that are answered by nothing all the same."""
    told_at_boot: tuple[str, ...] = ()
    """Parameters that are told to everybody when the vehicle has booted."""


@dataclass(frozen=True, slots=True)
class ParameterEntry:
    """One entry of the table."""

    name: str
    value: float
    type: int
    """MAV_PARAM_TYPE."""
    setting: ParameterRole | None = None
    unit_si: float = 1.0
    """SI units per unit of the parameter, such as 0.01 for cm."""
    least: float = -math.inf
    """Smallest value that is taken."""
    read_only: bool = False


class ParameterTable:
    """Parameters in their fixed order."""

    def __init__(self, parameters: Sequence[ParameterEntry]) -> None:
        self._table = {parameter.name: parameter for parameter in parameters}
        if len(self._table) != len(parameters):
            raise ValueError("parameter names must differ")
        self._by_setting = {each.setting: each.name for each in parameters if each.setting}

    def __len__(self) -> int:
        return len(self._table)

    def __iter__(self) -> Iterator[ParameterEntry]:
        return iter(self._table.values())

    def get(self, name: str) -> ParameterEntry | None:
        """The parameter of that name, if there is one."""
        return self._table.get(name)

    def at(self, index: int) -> ParameterEntry | None:
        """The parameter at that place of the list, if there is one."""
        names = list(self._table)
        return self._table[names[index]] if 0 <= index < len(names) else None

    def index(self, name: str) -> int:
        """Place of a parameter in the list."""
        return list(self._table).index(name)

    def value_si(self, setting: ParameterRole) -> float:
        """What the vehicle goes by, in SI units."""
        followed = _FOLLOWED.get(setting, setting)
        name = self._by_setting.get(setting) or self._by_setting.get(followed)
        if name is None:
            return _DEFAULTS_SI[setting]
        parameter = self._table[name]
        return parameter.value * parameter.unit_si

    def value(self, name: str) -> float:
        """The value of a parameter as ground stations see it; 0 if there is none."""
        parameter = self._table.get(name)
        return 0.0 if parameter is None else parameter.value

    def write(self, name: str, value: float) -> ParameterEntry:
        """Change a value; the parameter as it is then."""
        changed = replace(self._table[name], value=value)
        self._table[name] = changed
        return changed


class ParameterServer:
    """Answers what ground stations ask of the table."""

    def __init__(
        self, table: ParameterTable, outbox: Outbox, behaviour: ParameterBehaviour
    ) -> None:
        self._table = table
        self._outbox = outbox
        self._behaviour = behaviour

    def announce(self, name: str, value: float) -> None:
        """Change a value from inside and tell everybody; nothing where there is no such name."""
        if self._table.get(name) is not None:
            self._tell(self._table.write(name, value))

    def tell_at_boot(self) -> None:
        """Tell everybody what this firmware tells when it has booted."""
        for name in self._behaviour.told_at_boot:
            if (parameter := self._table.get(name)) is not None:
                self._tell(parameter)

    def read(self, message: mavlink.MAVLink_message, sender: Sender) -> None:
        """Answer PARAM_REQUEST_READ, by name or by index."""
        index = message.param_index
        parameter = self._table.get(message.param_id) if index < 0 else self._table.at(index)
        if parameter is None:
            self._refuse(message, mavlink.MAV_PARAM_ERROR_DOES_NOT_EXIST, sender)
            return
        told = self._index_told(parameter) if index < 0 else index
        self._outbox.reply(sender, self._value(parameter, told))

    def list_all(self, sender: Sender) -> None:
        """Answer PARAM_REQUEST_LIST."""
        for index, parameter in enumerate(self._table):
            self._outbox.reply(sender, self._value(parameter, index))

    def write(self, message: mavlink.MAVLink_message, sender: Sender) -> None:
        """Obey PARAM_SET; a value out of range or of a read-only parameter is refused."""
        parameter = self._table.get(message.param_id)
        if parameter is None:
            self._refuse(message, mavlink.MAV_PARAM_ERROR_DOES_NOT_EXIST, sender)
            return
        value = message.param_value
        if self._behaviour.integers_bytewise:
            if message.param_type != parameter.type:
                self._refuse(message, mavlink.MAV_PARAM_ERROR_VALUE_OUT_OF_RANGE, sender)
                return
            value = _from_wire(value, parameter.type)
        if not math.isfinite(value) or value < parameter.least:
            self._refuse(message, mavlink.MAV_PARAM_ERROR_VALUE_OUT_OF_RANGE, sender)
        elif parameter.read_only:
            self._refuse(message, mavlink.MAV_PARAM_ERROR_READ_ONLY, sender)
        else:
            changed = self._table.write(parameter.name, value)
            self._tell(changed)
            if self._behaviour.tells_changes and changed != parameter:
                self._tell(changed)

    def _refuse(self, message: mavlink.MAVLink_message, error: int, sender: Sender) -> None:
        if self._behaviour.reports_errors and message.param_id not in self._behaviour.unanswered:
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

    def _tell(self, parameter: ParameterEntry) -> None:
        self._outbox.broadcast(self._value(parameter, self._index_told(parameter)))

    def _index_told(self, parameter: ParameterEntry) -> int:
        return self._table.index(parameter.name) if self._behaviour.index_by_name else _NO_INDEX

    def _value(self, parameter: ParameterEntry, index: int) -> mavlink.MAVLink_message:
        value = parameter.value
        if self._behaviour.integers_bytewise:
            value = _on_wire(value, parameter.type)
        return mavlink.MAVLink_param_value_message(
            parameter.name.encode(), value, parameter.type, len(self._table), index
        )


def _on_wire(value: float, kind: int) -> float:
    """The float whose bytes are those of an integer; a REAL32 as it is."""
    if kind == mavlink.MAV_PARAM_TYPE_REAL32:
        return value
    whole = max(-(2**31), min(2**31 - 1, round(value)))
    return float(struct.unpack("<f", struct.pack("<i", whole))[0])


def _from_wire(value: float, kind: int) -> float:
    """The number in a float field; integers lie in its bytes."""
    if kind == mavlink.MAV_PARAM_TYPE_REAL32:
        return value
    return float(struct.unpack("<i", struct.pack("<f", value))[0])
