"""How long one UAV may stay in the air: its sortie, counted from take-off and measured in flight.

Energy is airborne time. A sortie begins at mission time 0, or when the UAV takes off from a base
with a full battery, and has ended when it has landed; the reserve is never planned with. Leaves
out: where it lands (agent.core.flights) and what follows if it must (agent.core.field_tasking).

Charge is told in steps, of 1 % in BATTERY_STATUS
(https://mavlink.io/en/messages/common.html#BATTERY_STATUS), and some time after it is so.
"""

from __future__ import annotations

import math
from typing import Final

from swarm.protocol.messages import UavSpec

TOLERANCE_S: Final = 1e-6
"""All limits are inclusive, by so much [s]."""
_MEASURED_EARLIER_S: Final = 1.0
"""What the battery says counts where it ends the sortie by more than that earlier: less is how
finely it is told."""
_SPAN_FRAC: Final = 0.04
_SPAN_S: Final = 20.0
"""A drain is measured over no less of the charge, and no less time: words come some time late."""
_SHORT_SPAN_FRAC: Final = 0.08
"""A shorter time tells something if so much is used in it: less may be a voltage that sags."""
_LATE_S: Final = 2.0
"""So much later than others a word of the charge may come [s]."""
_RISE_FRAC: Final = 0.005
"""Charge that goes up by more is another battery, or one that has recovered: a new span."""


class SortieClock:
    """The end of one UAV's sortie, in mission time; infinite while nothing ends it."""

    def __init__(self) -> None:
        self._counted_s: float | None = None
        """By the time since take-off [s]; None before the first one of this life."""
        self._measured_s = math.inf
        """By the charge that the vehicle told last [s]."""
        self._drain_frac = 1.0
        """Multiple of the charge that a second in the air should take."""

    @property
    def end_s(self) -> float:
        """Mission time by which the UAV must have landed, its reserve kept [s]."""
        if self._counted_s is None:
            return math.inf
        if self._measured_s < self._counted_s - _MEASURED_EARLIER_S:
            return self._measured_s
        return self._counted_s

    @property
    def told_s(self) -> float | None:
        """The same as claims tell it: None if nothing ends it."""
        return None if math.isinf(self.end_s) else self.end_s

    def begin(self, me: UavSpec, mission_s: float) -> None:
        """The vehicle is in the air for the first time: unless more is known, since just now.

        Who is in the air before the mission begins counts from mission time 0.
        """
        if self._counted_s is None:
            self._counted_s = mission_s + _budget_s(me, me.charge_frac) / self._drain_frac

    def recall(self, sortie_end_s: float | None, drain_frac: float = 1.0) -> None:
        """An earlier life of this agent said so; nothing of one that ended on the ground.

        Args:
            sortie_end_s: by when it must have landed [s mission time].
            drain_frac: what it had told of its battery, and reckoned with.
        """
        if sortie_end_s is not None:
            self._counted_s, self._drain_frac = sortie_end_s, drain_frac

    def depart(self, me: UavSpec, mission_s: float) -> None:
        """It takes off with a full battery."""
        budget_s = _budget_s(me, 1.0) / self._drain_frac
        self._counted_s, self._measured_s = mission_s + budget_s, math.inf

    def land(self) -> None:
        """It stands at a base: nothing is used up."""
        self._counted_s, self._measured_s = math.inf, math.inf

    def heed(self, drain_frac: float, mission_s: float) -> None:
        """Its battery is found to drain so many times as fast as it should.

        If the vehicle tells its charge, that says when the sortie ends sooner: an earlier life may
        have counted with a faster drain before it told so, and slow legs cost nothing in a hover.
        """
        before, self._drain_frac = self._drain_frac, drain_frac
        if drain_frac > before and self._measured_s < math.inf:
            return
        if before != drain_frac and self._counted_s is not None:
            left_s = self._counted_s - mission_s
            self._counted_s = mission_s + left_s * before / drain_frac

    def measure(self, me: UavSpec, battery_frac: float | None, mission_s: float) -> bool:
        """Its vehicle has told its charge; whether the sortie ends earlier than was known."""
        if me.endurance_s is None or battery_frac is None or self._counted_s == math.inf:
            return False
        before_s = self.end_s
        left_s = (battery_frac - me.reserve_frac) * me.endurance_s
        self._measured_s = mission_s + left_s / self._drain_frac
        return self.end_s < before_s - TOLERANCE_S


class DrainGauge:
    """Measures how fast one battery drains in flight, over spans of its charge."""

    def __init__(self) -> None:
        self._told_frac: float | None = None
        """What was told last; None before the first word of a flight."""
        self._since: tuple[float, float] | None = None
        """When the span began, and with what charge; None before the charge has fallen."""
        self.least_1_s: float | None = None
        """What is used per second at least, by a span under way that is yet too short [1/s]."""

    def begin(self) -> None:
        """A flight begins, or ends: what was told before is of no use."""
        self._told_frac = self._since = self.least_1_s = None

    def read(self, battery_frac: float, now_s: float) -> float | None:
        """Take what is told now [1, s]; gives the charge used per second, once that is known [1/s].

        A span begins and ends where the charge that is told falls: in between, up to a step of it
        may have been used already.
        """
        before_frac, self._told_frac = self._told_frac, battery_frac
        if before_frac is None or battery_frac > before_frac + _RISE_FRAC:
            self._since = self.least_1_s = None
            return None
        if battery_frac >= before_frac:
            return None
        if self._since is None:
            self._since = now_s, battery_frac
            return None
        used_frac, flown_s = self._since[1] - battery_frac, now_s - self._since[0]
        if used_frac < _SPAN_FRAC - 1e-9:
            return None
        if flown_s < _SPAN_S:
            if used_frac >= _SHORT_SPAN_FRAC - 1e-9:
                self.least_1_s = used_frac / (flown_s + _LATE_S)
            return None
        self._since, self.least_1_s = (now_s, battery_frac), None
        return used_frac / flown_s


def _budget_s(me: UavSpec, charge_frac: float) -> float:
    """Airborne time that may be planned with [s]; infinite if it is endless."""
    if me.endurance_s is None:
        return math.inf
    return charge_frac * me.endurance_s - me.reserve_frac * me.endurance_s
