"""An operator's seat on the bus: it learns, says one thing, and watches what comes of it.

What it says is stamped above all that an operator is known to have said, and repeated until
it was seen to take effect; whoever is out of reach learns it later from those who have heard
it. Leaves out: the commands a person types (coordinator.operator.cli), what comes of each
wish (coordinator.operator.errands), and obeying (agent.core, coordinator.core).
"""

from __future__ import annotations

import math

from coordinator.operator.commanding import Commanding
from coordinator.operator.errands import Errand, Errands, OperatorWish
from coordinator.operator.task_orders import Ordering
from coordinator.operator.verdict import Result, Verdict
from coordinator.status.onlooker import Onlooker
from swarm.config import Timing
from swarm.deadline import earliest
from swarm.events import Ask, BusFact, Finish, Learned, Wish

__all__ = ["OperatorSeat"]


class OperatorSeat:
    """A core that has one errand, and ends when it knows what came of it.

    Args:
        mission: mission name.
        wish: what the operator wants.
        incarnation: wall time in milliseconds.
        timing: timers, in the seconds of ``now_s``.
        patience_s: how long to wait for the mission, and then for the effect [s of ``now_s``].
    """

    def __init__(
        self,
        mission: str,
        wish: OperatorWish,
        *,
        incarnation: int,
        timing: Timing,
        patience_s: float,
    ) -> None:
        self.errand: Errand | None = None
        """What it was told to do; None as long as it knows too little to begin."""
        self._onlooker = Onlooker(mission, timing, None)
        self._wish = wish
        self._errands = Errands(
            self._onlooker.observer, incarnation=incarnation, timing=timing, patience_s=patience_s
        )
        self._ask_s = timing.ask_s
        self._patience_s = patience_s
        self._leave_at_s = math.inf
        self._ask_at_s = math.inf
        self._gave_up: Verdict | None = None

    @property
    def verdict(self) -> Verdict | None:
        """What has come of it; None as long as that is open."""
        return self._gave_up if self.errand is None else self.errand.verdict

    def start(self, now_s: float) -> list[Wish]:
        """Ask what there is to know."""
        self._leave_at_s, self._ask_at_s = now_s + self._patience_s, now_s + self._ask_s
        return self._onlooker.start(now_s)

    def step(self, fact: BusFact, now_s: float) -> list[Wish]:
        """Take note of one fact."""
        if self.verdict is not None:
            return []
        wishes = self._onlooker.step(fact, now_s)
        if self.errand is None:
            self._begin(fact, now_s)
        wishes += self._errands.step(fact, now_s)
        if self.errand is None and self._ask_at_s <= now_s:
            self._ask_at_s = now_s + self._ask_s
            wishes.append(Ask())
        if self.errand is None and self._leave_at_s <= now_s:
            self._gave_up = Verdict(Result.UNKNOWN_MISSION, self._onlooker.lack)
        if self.verdict is not None:
            wishes.append(Finish(0 if self.obeyed else 1))
        return wishes

    def next_deadline_s(self) -> float | None:
        """When `step` wants a tick; None when it has finished."""
        if self.verdict is not None:
            return None
        own_s = min(self._leave_at_s, self._ask_at_s) if self.errand is None else None
        looks_s = self._onlooker.next_deadline_s()
        return earliest(own_s, looks_s, self._errands.next_deadline_s())

    @property
    def obeyed(self) -> bool:
        """Whether it was seen to take effect."""
        return self.verdict is not None and self.verdict.result is Result.OBEYED

    @property
    def ordered(self) -> dict[str, object]:
        """What a task order says of its task, who has confirmed it, and who has taken it."""
        deed = None if self.errand is None else self.errand.deed
        if not isinstance(deed, Ordering):
            return {}
        entry = deed.entry
        told: dict[str, object] = {
            "task": deed.task,
            "uav": deed.uav,
            "known_to": sorted(deed.known_to),
        }
        if entry is None:
            return told
        return told | {
            "position": list(entry.position_enu_m),
            "value": entry.value,
            "service_s": entry.service_s,
            "kind": entry.kind,
        }

    @property
    def does(self) -> dict[str, str]:
        """What each UAV does that a command concerns: `StatusPhase`, or absent."""
        deed = None if self.errand is None else self.errand.deed
        observer = self._onlooker.observer
        statuses, present = observer.statuses, observer.present
        return {
            uav: statuses[uav].phase.value if uav in present and uav in statuses else "absent"
            for uav in (deed.concerned if isinstance(deed, Commanding) else ())
        }

    def _begin(self, fact: BusFact, now_s: float) -> None:
        """Once somebody has answered who knows the mission, the operator's other words too."""
        answered = isinstance(fact, Learned) and bool(fact.snapshots)
        if answered and self._onlooker.known:
            self.errand = self._errands.give(self._wish, now_s)
