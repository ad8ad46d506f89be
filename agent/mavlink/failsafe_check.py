"""Whether a vehicle comes home without its agent: asked of it on the ground.

What it does when its agent falls silent, and when its battery is low, is read from its
parameters, each by all the names it has had, again and again up to a limit. Simulated
autopilots of ours say that they are, and are flown as they are. Leaves out: what the
parameters mean (agent.mavlink.flavours.failsafes), and arming (agent.mavlink.preparation).
"""

from __future__ import annotations

from agent.mavlink.config import BridgeConfig, CommandStyle
from agent.mavlink.flavours import Flavour
from agent.mavlink.flavours.failsafes import Failsafes
from agent.mavlink.messages import Inbound, Outbound, Parameter, ParameterMissing, ParameterRead

__all__ = ["FailsafeCheck", "FailsafeReading"]

_SIMULATED = "SWARM_SIMULATED"
"""Parameter of the autopilots that `swarm autopilot` simulates; no firmware has it."""
_PAUSE_TIMEOUTS = 0.5
"""A parameter is asked for again after that many timeouts of a command: reading does no harm..."""
_TRIES = 20
"""...and so often before it counts as not known: one that a poor link loses keeps the vehicle on
the ground, and older firmware does not say that it has none of that name."""


class FailsafeReading:
    """The parameters of one vehicle that say what it does without its agent.

    Args:
        flavour: its firmware.
        own_system_id: the agent's, to which the vehicle should listen.
        may_be_simulated: whether it matters that it is.
    """

    def __init__(
        self, flavour: Flavour, own_system_id: int, *, may_be_simulated: bool = True
    ) -> None:
        self._flavour = flavour
        self._own_system_id = own_system_id
        self._may_be_simulated = may_be_simulated
        self._values: dict[str, float] = {}
        self._missing: set[str] = set()
        self.names = (*(name for names in flavour.failsafe_names for name in names), _SIMULATED)
        """All that may be read."""

    @property
    def unread(self) -> tuple[str, ...]:
        """Names that have been neither told nor denied; none of a parameter that is told."""
        if self.simulated:
            return ()
        return tuple(
            name
            for names in self._wanted
            if not any(each in self._values for each in names)
            for name in names
            if name not in self._missing
        )

    @property
    def failsafes(self) -> Failsafes:
        """What the vehicle does, as far as it has told."""
        return self._flavour.failsafes(self._values, self._own_system_id)

    @property
    def simulated(self) -> bool:
        """Whether it is one of our simulated autopilots."""
        return bool(self._values.get(_SIMULATED))

    def on_message(self, message: Inbound) -> None:
        """Take a parameter's value, or that there is none."""
        if isinstance(message, Parameter) and message.name in self.names:
            self._values[message.name] = self._flavour.value_of(message)
        elif isinstance(message, ParameterMissing) and message.name in self.names:
            self._missing.add(message.name)

    @property
    def _wanted(self) -> tuple[tuple[str, ...], ...]:
        """What is to be read; whether it is simulated only where something is amiss."""
        own = self._flavour.failsafe_names
        told = self._flavour.failsafes(self._values, self._own_system_id)
        fine = told.comes_home and told.battery is None
        return (*own, (_SIMULATED,)) if self._may_be_simulated and not fine else own


class FailsafeCheck:
    """Reads one vehicle's failsafes while it stands on the ground.

    Args:
        flavour: its firmware.
        config: patience, and whether it may be flown whatever they are.
    """

    def __init__(self, flavour: Flavour, config: BridgeConfig) -> None:
        accepted = config.accept_no_failsafe
        self._reading = FailsafeReading(
            flavour, config.ground_system_id, may_be_simulated=not accepted
        )
        self._config = config
        self._tries = 0
        self._next_s = 0.0
        self._settled = False

    def on_message(self, message: Inbound) -> None:
        """Take a parameter's value, or that there is none."""
        self._reading.on_message(message)

    def ask(self, now_s: float) -> list[Outbound]:
        """What to read now."""
        names = self._reading.unread
        self._settled |= not names
        if now_s < self._next_s:
            return []
        self._settled |= self._tries >= _TRIES
        self._tries += 1
        if not self._settled:
            self._next_s = now_s + _PAUSE_TIMEOUTS * self._config.commands.ack_timeout_s
            return [ParameterRead(name) for name in names]
        # What keeps the vehicle on the ground may still come, or be set meanwhile.
        self._next_s = now_s + self._config.retry_delay_s
        return [ParameterRead(name) for name in self._reading.names] if self.objection else []

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
