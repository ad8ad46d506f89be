"""When to plan a running mission anew, and when a new plan becomes the next epoch.

Reasons are differences between the situation that the epoch in force answers to and the situation
of now, so a reason that comes at a bad moment is not forgotten.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping

import numpy as np

from coordinator.core.events import CoordinatorAction, Replan, Replanned, StopPlanning
from coordinator.planner.online import EpochPolicy, Situation, complete_lists, objective_to_go
from swarm.protocol.events import LogLine
from swarm.protocol.messages import PlanEpoch

__all__ = ["DRIFT_FRAC", "MARGIN_FRAC", "ReplanPolicy"]


MARGIN_FRAC = 0.005
"""Of the value still to be won; a new plan that promises less more is not worth an epoch."""
DRIFT_FRAC = 0.05
"""Of the time the plan still takes; UAVs that are later by more make a new plan worth a try."""


class ReplanPolicy:
    """The decision to plan anew, and to adopt or to discard what comes of it.

    Args:
        method: planning method.
        seed: of the planner.
        interval_s: shortest time between two plans, in the seconds of ``now_s``.
        margin_frac: see `MARGIN_FRAC`.
        drift_frac: see `DRIFT_FRAC`.
    """

    def __init__(
        self,
        method: str,
        seed: int,
        interval_s: float,
        *,
        margin_frac: float = MARGIN_FRAC,
        drift_frac: float = DRIFT_FRAC,
    ) -> None:
        self._method = method
        self._seed = seed
        self._interval_s = interval_s
        self._margin_frac = margin_frac
        self._drift_frac = drift_frac
        self._answered: Situation | None = None
        """What the epoch in force answers to, and every plan that was no better."""
        self._expected_s: Mapping[str, float] = {}
        self._under_way: Replan | None = None
        self._request = 0
        self._quiet_until_s: float | None = None

    def begin(
        self, situation: Situation | None, completion_s: Mapping[str, float], now_s: float
    ) -> None:
        """An epoch has come into force that was not made here; a plan under way is for nothing.

        Args:
            situation: the one it answers to; None if unknown, which is a reason to plan anew.
            completion_s: when its tasks are expected to be done [s mission time].
            now_s: now.
        """
        self._answered, self._expected_s, self._under_way = situation, completion_s, None
        self._quiet_until_s = now_s + self._interval_s

    def is_quiet(self, now_s: float) -> bool:
        """Whether nothing can be wanted by now, whatever has happened."""
        if self._quiet_until_s is not None and self._quiet_until_s <= now_s:
            self._quiet_until_s = None
        return self._under_way is not None or self._quiet_until_s is not None

    def pursue(
        self, situation: Callable[[], Situation | None], epoch: PlanEpoch, now_s: float
    ) -> list[CoordinatorAction]:
        """Have a plan made if one is `wanted`.

        Args:
            situation: tells that of now, which takes a while; None if it cannot be told.
            epoch: in force.
            now_s: now.
        """
        if self.is_quiet(now_s) or (found := situation()) is None:
            return []
        wanted = self.wanted(found, epoch, now_s)
        return [wanted, LogLine("plans the rest", {"because": wanted.reason})] if wanted else []

    def wanted(self, situation: Situation, epoch: PlanEpoch, now_s: float) -> Replan | None:
        """The plan that is wanted, if any; its answer goes to `judge`.

        Args:
            situation: of now.
            epoch: in force.
            now_s: now.
        """
        if self.is_quiet(now_s) or situation.is_settled:
            return None
        reasons = self._reasons(situation)
        if not reasons:
            return None
        self._quiet_until_s = now_s + self._interval_s
        self._request += 1
        self._under_way = Replan(
            self._request,
            situation,
            EpochPolicy.of(epoch),
            self._method,
            self._seed + self._request,
            ", ".join(reasons),
        )
        return self._under_way

    def drop(self) -> None:
        """What is being planned comes at a bad moment; it will be wanted again."""
        self._under_way = None

    def stop(self) -> list[CoordinatorAction]:
        """What is being planned is for nothing, whatever it turns out to be."""
        if self._under_way is None:
            return []
        self._under_way = None
        return [StopPlanning()]

    def judge(
        self, replanned: Replanned, situation: Situation, epoch: PlanEpoch, now_s: float
    ) -> PlanEpoch | None:
        """The next epoch; None if that plan is not wanted any more or hardly better than going on.

        Both are valued from ``situation``, which is the one of now and not of when planning began.
        """
        wanted, plan = self._under_way, replanned.plan
        if wanted is None or replanned.request != wanted.request:
            return None
        new, old = plan.prediction, plan.going_on
        new_worth, old_worth = (
            objective_to_go(situation, new.lists),
            objective_to_go(situation, old.lists),
        )
        gain = new_worth - old_worth
        adopted = gain > self._margin_frac * abs(old_worth) and not situation.is_settled
        self._under_way, self._answered = None, wanted.situation
        self._expected_s = new.completion_s if adopted else old.completion_s
        if not adopted:
            return None
        self._quiet_until_s = now_s + self._interval_s
        why = f": worth {new_worth:.4g} instead of {old_worth:.4g} value·s"
        return PlanEpoch(
            number=epoch.number + 1,
            phase=epoch.phase,
            rule=plan.rule,
            sequence=plan.sequence,
            mission_s=situation.now_s,
            reason=wanted.reason[: 200 - len(why)] + why,
            routes=complete_lists(situation, new.lists),
        )

    def next_deadline_s(self) -> float | None:
        """When something may be wanted though nothing happens."""
        return None if self._under_way is not None else self._quiet_until_s

    def _reasons(self, now: Situation) -> list[str]:
        before = self._answered
        if before is None:
            return ["the epoch's situation is unknown"]
        tasks, tasks_before = set(now.problem.task_ids), set(before.problem.task_ids)
        changes = {
            "lost": before.taking_part - now.taking_part,
            "back": now.taking_part - before.taking_part,
            "appeared": tasks - tasks_before,
            "withdrawn": now.withdrawn - before.withdrawn,
        }
        reasons = [f"{_some(sorted(ids))} {what}" for what, ids in changes.items() if ids]
        if now.failures > before.failures:
            reasons.append("an attempt failed")
        if self._lateness_frac(now) > self._drift_frac:
            reasons.append("the fleet is late")
        return reasons

    def _lateness_frac(self, now: Situation) -> float:
        """Mean delay of what UAVs are doing, as a share of the time all was expected to take."""
        left_s = max(self._expected_s.values(), default=now.now_s) - now.now_s
        if left_s <= 0.0:
            return 0.0
        rows: dict[str, int] = {uav: index for index, uav in enumerate(now.problem.uav_ids)}
        late_s = [
            max(0.0, float(now.state.free_s[rows[uav]]) - self._expected_s[task])
            for uav, task in now.under_way.items()
            if task in self._expected_s
        ]
        return float(np.mean(late_s)) / left_s if late_s else 0.0


def _some(ids: list[str]) -> str:
    return ", ".join(ids) if len(ids) <= 3 else f"{', '.join(ids[:3])} and {len(ids) - 3} more"
