"""The task board as the coordinator keeps it: what of the scenario is on it and what will be.

What the operator has ordered counts before that: a task that they have withdrawn before it
appeared is not posted any more. Leaves out: saying it (coordinator.core), and what became of
the tasks (swarm.state.board).
"""

from __future__ import annotations

from collections.abc import Iterable

from coordinator.briefing import entry_of
from swarm.model import Mission, Task
from swarm.state.board import TaskBoard, TaskState
from swarm.state.registers import Replica
from swarm.wire.messages import Board, Message

__all__ = ["Postings", "exit_status", "unposted"]


class Postings:
    """The tasks of one scenario on the board of one mission.

    Args:
        mission: the scenario, pop-ups included.
        replica: holds the board.
    """

    def __init__(self, mission: Mission, replica: Replica) -> None:
        self._mission = mission
        self._replica = replica
        self._numbers = {task.id: number for number, task in enumerate(mission.tasks)}

    @property
    def more_to_come(self) -> bool:
        """Whether tasks have yet to appear."""
        return bool(unposted(self._replica, self._mission))

    def due(self, zero_s: float | None, now_s: float) -> list[Board]:
        """Entries to post by now; before the start, what has been there all along.

        Args:
            zero_s: when the mission began; None while it has not.
            now_s: now.
        """
        return [
            entry_of(task, self._numbers[task.id])
            for task in unposted(self._replica, self._mission)
            # The same sum as the deadline's: another may round to just before it.
            if task.appears_s == 0.0 or (zero_s is not None and zero_s + task.appears_s <= now_s)
        ]

    def merged(self, theirs: Iterable[Message]) -> list[Board]:
        """What another coordinator of the mission has posted or withdrawn, and this one has not."""
        entries = []
        for message in theirs:
            if isinstance(entry := message.body, Board):
                known = self._replica.posted.get(entry.task)
                if known is None or (entry.withdrawn and not known.withdrawn):
                    entries.append(entry)
        return entries

    def next_deadline_s(self, zero_s: float) -> float | None:
        """When the next task is due in a mission that began at ``zero_s``."""
        times_s = (zero_s + task.appears_s for task in unposted(self._replica, self._mission))
        return min(times_s, default=None)


def exit_status(board: TaskBoard, mission: Mission) -> int:
    """0 if every task of ``mission`` has appeared and was done or withdrawn, else 1."""
    done = all(s in (TaskState.DONE, TaskState.WITHDRAWN) for s in board.states.values())
    return 0 if done and not unposted(board.replica, mission) else 1


def unposted(replica: Replica, mission: Mission) -> list[Task]:
    """Tasks of ``mission`` that have not appeared yet."""
    return [task for task in mission.tasks if task.id not in replica.board]
