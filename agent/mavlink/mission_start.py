"""From a mission that stands on the vehicle to one that it is seen to fly.

The current item is put right first, then the mode is set until it is *seen*: PX4
acknowledges the mission mode and does not enter it for up to 2 s after an upload, and
both firmwares go on where an earlier mission was left. A vehicle that flies missions
already takes a new one up at once, usually at the right item. What was heard before the
mission was verified counts for nothing. Leaves out: the upload (agent.mavlink.mission).

Protocol: https://mavlink.io/en/services/mission.html#current_mission_item
"""

from __future__ import annotations

import math

from agent.mavlink.commands import CommandEnded, Commands, Ending, result_text
from agent.mavlink.config import BridgeConfig
from agent.mavlink.flavours import Flavour
from agent.mavlink.messages import Heartbeat, Inbound, MissionCurrent, MissionSetCurrent, Outbound
from agent.mavlink.mission_plan import MissionSeqs

__all__ = ["MissionStart"]

_TAG = "mission mode"
_LOOKS = 2.0
"""Wait that many effect timeouts for the vehicle to say which item it flies."""


class MissionStart:
    """Starts one verified mission, once.

    Args:
        config: patience.
        commands: carries the mode.
        flavour: the firmware.
        now_s: when the mission was verified.
        again: begin the mission anew even if its target is what the vehicle flies to.
    """

    def __init__(
        self,
        config: BridgeConfig,
        commands: Commands,
        flavour: Flavour,
        now_s: float,
        *,
        again: bool = False,
    ) -> None:
        self._config = config
        self._commands = commands
        self._flavour = flavour
        self._seqs = MissionSeqs(flavour.mission_vehicle_items)
        self._began_s = now_s
        self._again = again
        self._current: int | None = None
        self._sets = 0
        self._next_set_s = -math.inf
        self._look_until_s = now_s + _LOOKS * config.effect_timeout_s
        self._next_mode_s = -math.inf
        self._mode_tries = 0
        self._refusal = "it is acknowledged, but never seen in the heartbeat"
        self.done = False
        """The vehicle is seen to fly to the target in the mission mode."""
        self.failure: str | None = None

    @property
    def mode_asked(self) -> bool:
        """Whether the vehicle was told to fly missions."""
        return self._mode_tries > 0

    def on_message(self, message: Inbound) -> None:
        """Note which item is current."""
        if isinstance(message, MissionCurrent):
            self._current = message.seq

    def on_ended(self, ended: CommandEnded, now_s: float) -> None:
        """Take the outcome of setting the mode."""
        if ended.tag != _TAG:
            return
        if ended.ending is Ending.ACCEPTED:
            self._next_mode_s = now_s + self._config.effect_timeout_s / 2.0
        else:
            self._refusal = result_text(ended.result)
            self._next_mode_s = now_s + self._config.retry_delay_s

    def advance(self, heartbeat: Heartbeat, heard_at_s: float, now_s: float) -> list[Outbound]:
        """Do what is still missing.

        Args:
            heartbeat: the last one.
            heard_at_s: when it was heard: an older one than the mission proves nothing.
            now_s: now.
        """
        if self.done or self.failure is not None:
            return []
        begun = self._current in (self._seqs.speed, self._seqs.target)
        if not self._flavour.is_mission(heartbeat.custom_mode):
            return self._set_mode(now_s) if begun and self._sets else self._set_current(now_s)
        if self._again:
            return self._set_current(now_s)
        if self._current == self._seqs.target:
            self.done = heard_at_s > self._began_s
            return []
        if (begun or self._current is None) and now_s < self._look_until_s:
            return []
        return self._set_current(now_s)

    def _set_current(self, now_s: float) -> list[Outbound]:
        if now_s < self._next_set_s:
            return []
        if self._sets >= self._config.mode_tries:
            told = "nothing" if self._current is None else f"item {self._current}"
            self.failure = f"the vehicle does not take up the mission, but says it flies {told}"
            return []
        self._sets += 1
        self._next_set_s = now_s + self._config.commands.ack_timeout_s
        self._look_until_s = now_s + _LOOKS * self._config.effect_timeout_s
        self._again = False
        self._current = None
        return [MissionSetCurrent(self._seqs.speed)]

    def _set_mode(self, now_s: float) -> list[Outbound]:
        if self._commands.pending(_TAG) or now_s < self._next_mode_s:
            return []
        if self._mode_tries >= self._config.mode_tries:
            self.failure = f"the mission mode cannot be set ({self._refusal})"
            return []
        self._mode_tries += 1
        return [*self._commands.send(_TAG, self._flavour.set_mission_mode(), now_s)]
