"""How to speak to one vehicle, and to report of it, within one step of its bridge."""

from __future__ import annotations

from dataclasses import dataclass

from agent.core.interface import Caution, MotorsRun, NotReady, VehicleReport
from agent.vehicle.codec import MavlinkCodec
from agent.vehicle.commands import CommandQueue, RepeatedCommand, VehicleCommand
from agent.vehicle.config import BridgeConfig
from agent.vehicle.messages import Outbound
from agent.vehicle.signing import Signing


@dataclass(frozen=True, slots=True)
class SendBytes:
    """Send these bytes."""

    data: bytes


BridgeAction = SendBytes | VehicleReport


class Conversation:
    """What is said to one vehicle, and reported of it, in the step under way."""

    def __init__(self, config: BridgeConfig, signing: Signing | None = None) -> None:
        self.config = config
        self.codec = MavlinkCodec(
            config.system_id,
            source_system_id=config.ground_system_id,
            source_component_id=config.ground_component_id,
            signing=signing,
            peer_silence_s=config.peer_silence_s,
        )
        self.commands = CommandQueue(config.commands)
        self.now_s = 0.0
        self._actions: list[BridgeAction] = []
        self._told_not_ready: str | None = None
        self._told_caution = ""
        self.told_motors = False
        """Whether they were last said to run for us; at first, what an earlier life said."""
        self._cautions: dict[str, str] = {}

    def send(self, tag: str, command: VehicleCommand) -> None:
        """See `CommandQueue.send`."""
        self.say(*self.commands.send(tag, command, self.now_s))

    def cancel(self, tag: str) -> None:
        """See `CommandQueue.cancel`."""
        self.say(*self.commands.cancel(tag, self.now_s))

    def repeated(self, tag: str, tries: int, *, patience: float = 1.0) -> RepeatedCommand:
        """A command that is given so often, and its effect awaited that many times as long."""
        effect_timeout_s = patience * self.config.effect_timeout_s
        waits_s = (effect_timeout_s, self.config.retry_delay_s)
        return RepeatedCommand(tag, self.commands, tries, *waits_s)

    def say(self, *messages: Outbound) -> None:
        """To the vehicle."""
        for message in messages:  # most often there is none
            self._actions.append(SendBytes(self.codec.encode(message)))

    def report(self, report: VehicleReport) -> None:
        """To whoever gave the orders."""
        self._actions.append(report)

    def tell_not_ready(self, reason: str) -> None:
        """Report what the vehicle is waited for, once."""
        if reason != self._told_not_ready:
            self._told_not_ready = reason
            self.report(NotReady(reason))

    def tell_caution(self, topic: str, reason: str | None) -> None:
        """Report what people should know of the vehicle, when it changes; None: that is over."""
        if reason is None:
            self._cautions.pop(topic, None)
        else:
            self._cautions[topic] = reason
        told = "; ".join(self._cautions.values())
        if told != self._told_caution:
            self._told_caution = told
            self.report(Caution(told))

    def tell_motors(self, *, ours: bool) -> None:
        """Say whether its motors run for us, when that changes."""
        if ours != self.told_motors:
            self.told_motors = ours
            self.report(MotorsRun(ours))

    def tell_anew(self) -> None:
        """Another wait begins: what was told may be told again."""
        self._told_not_ready = None

    def take_actions(self) -> list[BridgeAction]:
        """What was said and reported, in order, once."""
        actions, self._actions = self._actions, []
        return actions
