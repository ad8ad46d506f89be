"""When the rest of a running mission is planned anew, and whether what comes of it is an epoch.

Reasons to plan anew are differences between the situation that the epoch in force answers to and
the situation of now, so a reason that comes at a bad moment is not forgotten.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import replace

import numpy as np

from coordinator.core.lifecycle import CoordinatorAction, Replan, Replanned, StopPlanning
from coordinator.mission_view.wording import listed
from coordinator.planner.online import (
    EpochPolicy,
    Situation,
    complete_lists,
    left_out_by,
    worth_to_go,
)
from swarm.model.plan import LeftOut
from swarm.protocol.calibration import noticeably_otherwise
from swarm.protocol.messages import PlanEpoch

MARGIN_FRAC = 0.005
"""Of the value still to be won; a new plan that promises less more is not worth an epoch."""
DRIFT_FRAC = 0.05
"""Of the time the plan still takes; UAVs that are later by more make a new plan worth a try."""


class ReplanPolicy:
    """The decision to plan anew, and to adopt or to discard what comes of it.

    One plan is made at a time. What happens to the fleet or its tasks meanwhile supersedes it: the
    one under way is given up for one that knows of it. For as long as an interval after the first
    of them was wanted; then one is awaited, so that a fleet to which something happens every second
    gets plans all the same.
    """

    def __init__(
        self,
        method: str,
        seed: int,
        interval_s: float,
        *,
        margin_frac: float = MARGIN_FRAC,
    ) -> None:
        self._method = method
        self._seed = seed
        self._interval_s = interval_s
        self._margin_frac = margin_frac
        self._answered: Situation | None = None
        """What the epoch in force answers to, and every plan that was no better."""
        self._expected_s: Mapping[str, float] = {}
        self._under_way: Replan | None = None
        self._superseded_until_s = 0.0
        """Until when something new makes the plan under way useless."""
        self._request = 0
        self._quiet_until_s: float | None = None

    def begin(
        self, situation: Situation | None, completion_s: Mapping[str, float], now_s: float
    ) -> None:
        """An epoch has come into force that was not made here; a plan under way is for nothing.

        It answers to ``situation``; that it is unknown is a reason to plan anew. Its tasks are
        expected to be done at ``completion_s`` [mission time].
        """
        self._answered, self._expected_s, self._under_way = situation, completion_s, None
        self._quiet_until_s = now_s + self._interval_s

    def is_quiet(self, now_s: float) -> bool:
        """Whether nothing can be wanted by now, whatever has happened."""
        if self._quiet_until_s is not None and self._quiet_until_s <= now_s:
            self._quiet_until_s = None
        if self._under_way is not None:
            return now_s >= self._superseded_until_s
        return self._quiet_until_s is not None

    def pursue(
        self, situation: Callable[[], Situation | None], epoch: PlanEpoch, now_s: float
    ) -> Replan | PlanEpoch | None:
        """What follows from the ``situation``, if anything; to tell it takes a while.

        A plan that is wanted; where nothing is left to plan, the epoch in force as it leaves
        out what nobody can do any more, if it does not say so already.
        """
        if self.is_quiet(now_s) or (found := situation()) is None:
            return None
        if not found.is_settled:
            return self._wanted(found, epoch, now_s)
        if found.field is None or not found.taking_part:  # who is lost may come back
            return None
        beyond = {LeftOut.NOBODY_CAN.value: found.open_tasks} if found.open_tasks else {}
        return _leaving_out(epoch, beyond, now_s=found.now_s)

    def _wanted(self, situation: Situation, epoch: PlanEpoch, now_s: float) -> Replan | None:
        """The plan that is wanted, if any; its answer goes to `judge`.

        One that is under way is superseded by it.
        """
        running = self._under_way
        if running is not None and not _happened(running.situation, situation):
            return None
        reasons = self._reasons(situation)
        if not reasons:
            return None
        if running is None:
            self._superseded_until_s = now_s + self._interval_s
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
        """The epoch to say; None if that plan is not wanted any more or nothing follows from it.

        The next one if the plan is better than going on; else the one in force, if it leaves out
        other tasks than it says. Both are valued from ``situation``, which is the one of now and
        not of when planning began.
        """
        wanted, plan = self._under_way, replanned.plan
        if wanted is None or replanned.request != wanted.request:
            return None
        new, old = plan.prediction, plan.going_on
        new_left, new_worth = worth_to_go(situation, new.lists)
        old_left, old_worth = worth_to_go(situation, old.lists)
        better = new_worth - old_worth > self._margin_frac * abs(old_worth)
        if new_left != old_left:
            better = new_left < old_left
        adopted = better and not situation.is_settled
        self._under_way, self._answered = None, wanted.situation
        self._expected_s = new.completion_s if adopted else old.completion_s
        if not adopted:
            left_out = left_out_by(wanted.situation, old.lists)
            return _leaving_out(epoch, left_out, now_s=situation.now_s)
        self._quiet_until_s = now_s + self._interval_s
        why = f": worth {new_worth:.4g} instead of {old_worth:.4g} value·s"
        if new_left != old_left:
            why = f": leaves out {new_left} tasks instead of {old_left}"
        return PlanEpoch(
            number=epoch.number + 1,
            phase=epoch.phase,
            rule=plan.rule,
            sequence=plan.sequence,
            mission_s=situation.now_s,
            reason=wanted.reason[: 200 - len(why)] + why,
            routes=complete_lists(situation, new.lists),
            left_out=left_out_by(wanted.situation, new.lists),
        )

    def next_deadline_s(self) -> float | None:
        """When something may be wanted though nothing happens."""
        return None if self._under_way is not None else self._quiet_until_s

    def _reasons(self, now: Situation) -> list[str]:
        before = self._answered
        if before is None:
            return ["the epoch's situation is unknown"]
        reasons = _happened(before, now)
        if otherwise := noticeably_otherwise(dict(before.rates), dict(now.rates)):
            reasons.append(f"{listed(otherwise, 3)} flies otherwise than was known")
        if self._lateness_frac(now) > DRIFT_FRAC:
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


def _leaving_out(
    epoch: PlanEpoch, left_out: Mapping[str, tuple[str, ...]], *, now_s: float
) -> PlanEpoch | None:
    """The same epoch as it leaves out these tasks; None if it says so already."""
    if _as_sets(left_out) == _as_sets(epoch.left_out):
        return None
    return replace(epoch, left_out=left_out, mission_s=now_s)


def _as_sets(left_out: Mapping[str, tuple[str, ...]]) -> dict[str, frozenset[str]]:
    return {why: frozenset(tasks) for why, tasks in left_out.items()}


def _happened(before: Situation, now: Situation) -> list[str]:
    """What has happened to fleet, tasks and zones, in words."""
    tasks, tasks_before = set[str](), set[str]()
    if now.problem is not before.problem:
        tasks, tasks_before = set(now.problem.task_ids), set(before.problem.task_ids)
    changes = {
        "lost": before.taking_part - now.taking_part,
        "back": now.taking_part - before.taking_part,
        "appeared": tasks - tasks_before,
        "withdrawn": now.withdrawn - before.withdrawn,
    }
    happened = [f"{listed(sorted(ids), 3)} {what}" for what, ids in changes.items() if ids]
    if now.zones != before.zones:
        happened.append("the operator has changed zones")
    if now.failures > before.failures:
        happened.append("an attempt failed")
    return happened
