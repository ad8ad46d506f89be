"""From a mission that stands on the vehicle to one that it is seen to fly.

The current item is put right first, then the mode is set until it is *seen*: PX4
acknowledges the mission mode and does not enter it for up to 2 s after an upload, and
both firmwares go on where an earlier mission was left. A vehicle that flies missions
already takes a new one up at once, usually at the right item. What was heard before the
mission was verified counts for nothing.

A mission that gives way to targets is begun anew for each, and then the vehicle is told the
mission's own place by a target, and once it took that the speed, which it forgets with a first
target. A vehicle that does not take them is sent on to the place as an item, which it also
turns to by itself if nobody tells it anything. Leaves out: the upload (agent.mavlink.mission).

Protocol: https://mavlink.io/en/services/mission.html#current_mission_item
"""

from __future__ import annotations

import math

from agent.mavlink.commands import CommandEnded, Commands, Ending, result_text
from agent.mavlink.config import BridgeConfig
from agent.mavlink.flavours import Flavour
from agent.mavlink.messages import Heartbeat, Inbound, MissionCurrent, MissionSetCurrent, Outbound
from agent.mavlink.mission_plan import MissionPlan

__all__ = ["MissionStart"]

_TAG = "mission mode"
_PLACE_TAG = "mission target"
_SPEED_TAG = "mission speed"
_REFUSALS = 2
"""So often a target may be refused: the first time perhaps because it came too early."""
_LOOKS = 2.0
"""Wait that many effect timeouts for the vehicle to say which item it flies."""


class MissionStart:
    """Starts one verified mission, once.

    Args:
        config: patience.
        commands: carries the mode.
        flavour: the firmware.
        plan: the mission.
        now_s: when the mission was verified.
        again: begin the mission anew even if its target is what the vehicle flies to.
    """

    def __init__(
        self,
        config: BridgeConfig,
        commands: Commands,
        flavour: Flavour,
        plan: MissionPlan,
        now_s: float,
        *,
        again: bool = False,
    ) -> None:
        self._config = config
        self._commands = commands
        self._flavour = flavour
        self._plan = plan
        self._seqs = plan.seqs(flavour)
        self._first = self._seqs.speed
        """Item to begin with."""
        self._told: set[str] = set()
        """What the vehicle took while the mission gave way."""
        self._place_refusals = 0
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

    def cancel(self, now_s: float) -> list[Outbound]:
        """Tell the vehicle nothing more."""
        out: list[Outbound] = []
        for tag in (_PLACE_TAG, _SPEED_TAG):
            out += self._commands.cancel(tag, now_s)
        return out

    def on_ended(self, ended: CommandEnded, now_s: float) -> None:
        """Take the outcome of a command."""
        if ended.tag in (_PLACE_TAG, _SPEED_TAG):
            self._on_told(ended)
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
        seqs = self._seqs
        begun = self._current is not None and seqs.speed <= self._current <= seqs.target
        if not self._flavour.is_mission(heartbeat.custom_mode):
            return self._set_mode(now_s) if begun and self._sets else self._set_current(now_s)
        if self._again:
            return self._set_current(now_s)
        if self._is_guided and not self._told >= {_PLACE_TAG, _SPEED_TAG}:
            return self._guide(now_s)
        if self._is_on_its_way:
            self.done = heard_at_s > self._began_s
            return []
        if (begun or self._current is None) and now_s < self._look_until_s:
            return []
        return self._set_current(now_s)

    def _set_current(self, now_s: float) -> list[Outbound]:
        if now_s < self._next_set_s:
            return []
        if self._sets >= self._config.mode_tries:
            if self._current == self._seqs.target:
                self._first = self._seqs.target
                return []
            told = "nothing" if self._current is None else f"item {self._current}"
            self.failure = f"the vehicle does not take up the mission, but says it flies {told}"
            return []
        self._sets += 1
        self._next_set_s = now_s + self._config.commands.ack_timeout_s
        self._look_until_s = now_s + _LOOKS * self._config.effect_timeout_s
        self._again = False
        self._current = None
        self._told.clear()
        return [MissionSetCurrent(self._first)]

    @property
    def _is_guided(self) -> bool:
        """Whether the vehicle, told to begin anew, gives way to targets.

        ArduPilot answers with the number that it was told, and has begun by then.
        """
        guided, current = self._seqs.guided, self._current
        begins = self._sets > 0 and self._first == self._seqs.speed
        if not begins or guided is None or current is None:
            return False
        return self._seqs.speed <= current <= guided

    @property
    def _is_on_its_way(self) -> bool:
        """Whether it is seen to fly to the place, as a target or as the item."""
        if self._current == self._seqs.target:
            # Begun anew it gives way first: this was said before, or its time was over early.
            alone = self._seqs.guided is None or self._sets == 0 or bool(self._told)
            return alone or self._first == self._seqs.target
        begun_before = self._sets == 0 and self._current == self._seqs.guided
        return self._current is not None and (self._is_guided or begun_before)

    def _guide(self, now_s: float) -> list[Outbound]:
        """Tell the vehicle the mission's place as a target, and then the speed."""
        if self._commands.pending(_PLACE_TAG) or self._commands.pending(_SPEED_TAG):
            return []
        plan = self._plan
        if _PLACE_TAG in self._told:
            speed = self._flavour.change_speed(plan.speed_m_s)
            return [*self._commands.send(_SPEED_TAG, speed, now_s)]
        place = (plan.lat_deg, plan.lon_deg, plan.alt_m)
        target = self._flavour.reposition(*place, plan.speed_m_s)
        return [*self._commands.send(_PLACE_TAG, target, now_s)]

    def _on_told(self, ended: CommandEnded) -> None:
        if ended.ending is Ending.ACCEPTED:
            self._told.add(ended.tag)
            return
        self._current = None  # to be heard again, as it may not give way yet, or any more
        self._place_refusals += 1
        unanswered = ended.ending is Ending.UNANSWERED
        if unanswered or ended.tag == _SPEED_TAG or self._place_refusals >= _REFUSALS:
            self._first, self._sets = self._seqs.target, 0
            self._again = True

    def _set_mode(self, now_s: float) -> list[Outbound]:
        if self._commands.pending(_TAG) or now_s < self._next_mode_s:
            return []
        if self._mode_tries >= self._config.mode_tries:
            self.failure = f"the mission mode cannot be set ({self._refusal})"
            return []
        self._mode_tries += 1
        return [*self._commands.send(_TAG, self._flavour.set_mission_mode(), now_s)]
