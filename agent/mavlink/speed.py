"""Sets the cruise speed: by command, or by the parameter if the command is refused.

The parameter has had several names, so every one is asked for and the one that exists
is set. Leaves out: when (agent.mavlink.preparation).
"""

from __future__ import annotations

from agent.mavlink.commands import CommandEnded, Commands, Ending
from agent.mavlink.config import BridgeConfig
from agent.mavlink.flavours import Flavour
from agent.mavlink.messages import Inbound, Outbound, Parameter, ParameterRead, ParameterSet

__all__ = ["SpeedSetting"]

_TAG = "speed"
_TOLERANCE_FRAC = 0.01


class SpeedSetting:
    """One cruise speed on its way into one vehicle."""

    def __init__(self, speed_m_s: float, flavour: Flavour, config: BridgeConfig) -> None:
        self._command = flavour.change_speed(speed_m_s)
        self._values = {p.name: speed_m_s * p.units_per_m_s for p in flavour.speed_parameters}
        self._config = config
        self._name: str | None = None
        self._asking_parameters = False
        self._tries = 0
        self._deadline_s = 0.0
        self.begun = False
        self.done = False
        """The vehicle took the speed."""
        self.failure: str | None = None

    def start(self, commands: Commands, now_s: float) -> list[Outbound]:
        """Tell the vehicle."""
        self.begun = True
        return [*commands.send(_TAG, self._command, now_s)]

    def on_ended(self, ended: CommandEnded, now_s: float) -> list[Outbound]:
        """Take the outcome of the command; refused, turn to the parameter."""
        if ended.tag != _TAG or self.done:
            return []
        if ended.ending is Ending.ACCEPTED:
            self.done = True
            return []
        self._asking_parameters = True
        return self._ask(now_s)

    def on_message(self, message: Inbound, now_s: float) -> list[Outbound]:
        """A parameter's value: set it, or see that it is set."""
        if not self._asking_parameters or self.done or not isinstance(message, Parameter):
            return []
        wanted = self._values.get(message.name)
        if wanted is None:
            return []
        if abs(message.value - wanted) <= _TOLERANCE_FRAC * wanted:
            self.done = True
            return []
        if self._name is not None:
            return []  # asked to change it already: the repetition is timed
        self._name = message.name
        return self._ask(now_s)

    def on_time(self, now_s: float) -> list[Outbound]:
        """Ask again, or give up."""
        if not self._asking_parameters or self.done or self.failure or now_s < self._deadline_s:
            return []
        if self._tries >= self._config.commands.tries:
            names = " or ".join(self._values)
            self.failure = f"the cruise speed cannot be set, neither by command nor by {names}"
            return []
        return self._ask(now_s)

    def _ask(self, now_s: float) -> list[Outbound]:
        self._tries += 1
        self._deadline_s = now_s + self._config.commands.ack_timeout_s
        if self._name is None:
            return [ParameterRead(name) for name in self._values]
        return [ParameterSet(self._name, self._values[self._name])]
