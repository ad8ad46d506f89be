"""An operator in virtual time who goes on with the scenario of a mission whose coordinator is lost.

Tasks are added when they appear and withdrawn when they are withdrawn, by the edits that
`swarm task add` and `swarm task withdraw` give. It plans nothing, so the fleet goes on without a
coordinator. What it says it repeats for a while, and asks nobody what came of it.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

from coordinator.core.publication import task_entry_of
from coordinator.operator.task_edits import task_edit_of
from swarm.model import Mission, TaskId
from swarm.model.ids import OPERATOR
from swarm.protocol.events import CommonAction, CommonEvent, Finish, Publish
from swarm.protocol.messages import Message, TaskEdit
from swarm.protocol.register_writer import RegisterWriter
from swarm.protocol.timing import Timing


class ScriptedOperator:
    """A core that posts and withdraws tasks when their time has come.

    Args:
        mission: the scenario, pop-ups included.
        withdrawn_at_s: tasks that are withdrawn, and when [s mission time].
        since_s: when the coordinator was lost; what came before it has told [s mission time].
        mission_s: when the operator sits down [s mission time].
        run: of the flight, as its brief has it.
        incarnation: greater than of any seat before.
        timing: timers, in the seconds of ``now_s``.
        patience_s: for how long to repeat what it says [s of ``now_s``]; 0 where nothing is lost.
    """

    def __init__(
        self,
        mission: Mission,
        withdrawn_at_s: Mapping[TaskId, float],
        *,
        since_s: float,
        mission_s: float,
        run: int,
        incarnation: int,
        timing: Timing,
        patience_s: float,
    ) -> None:
        entries = {
            task.id: task_edit_of(task_entry_of(task, place), run)
            for place, task in enumerate(mission.tasks)
        }
        appear = [(task.appears_s, entries[task.id]) for task in mission.tasks if task.appears_s]
        go = [
            (at_s, replace(entries[task], withdrawn=True))
            for task, at_s in withdrawn_at_s.items()
            if task in entries
        ]
        changes = [(at_s, entry) for at_s, entry in appear + go if at_s >= since_s]
        self._to_come: list[tuple[float, TaskEdit]] = sorted(changes, key=lambda each: each[0])
        self._register_writer = RegisterWriter(mission.name, OPERATOR, incarnation)
        self._announce_s = timing.announce_s
        self._patience_s = patience_s
        self._mission_s = mission_s
        self._zero_s = 0.0
        self._said: list[tuple[float, Message]] = []
        """What to repeat, and until when."""
        self._again_at_s = 0.0
        """When to repeat it."""
        self._seated = self._finished = False

    def start(self, now_s: float) -> list[CommonAction]:
        """Say what has come about since the coordinator was lost."""
        self._zero_s, self._seated = now_s - self._mission_s, True
        return self._advance(now_s)

    def step(self, fact: CommonEvent, now_s: float) -> list[CommonAction]:
        """Say what is due; nothing that is heard changes that."""
        del fact
        return self._advance(now_s) if self._seated and not self._finished else []

    def next_deadline_s(self) -> float | None:
        """When `step` wants a tick; None when it has finished."""
        if self._finished or not self._seated:
            return None
        times_s = [self._zero_s + at_s for at_s, _ in self._to_come[:1]]
        return min([*times_s, self._again_at_s] if self._said else times_s, default=None)

    def _advance(self, now_s: float) -> list[CommonAction]:
        messages = list[Message]()
        if self._said and self._again_at_s <= now_s:
            messages += [message for _, message in self._said]
            self._said = [each for each in self._said if each[0] > now_s]
            self._again_at_s = now_s + self._announce_s
        # The same sum as the deadline's: another may round to just before it.
        while self._to_come and self._zero_s + self._to_come[0][0] <= now_s:
            message = self._register_writer.say(self._to_come.pop(0)[1])
            if self._patience_s > 0.0:
                self._again_at_s = self._again_at_s if self._said else now_s + self._announce_s
                self._said.append((now_s + self._patience_s, message))
            messages.append(message)
        wishes: list[CommonAction] = [Publish(message) for message in messages]
        if not (self._said or self._to_come):
            self._finished = True
            wishes.append(Finish(0))
        return wishes
