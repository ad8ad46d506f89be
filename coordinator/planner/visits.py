"""Which tasks have been closed by whom, in order, sorted out when somebody asks."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from functools import cached_property

from swarm.protocol.board import TaskState
from swarm.protocol.uav_messages import Outcome


class Visits(Mapping[str, tuple[str, ...]]):
    """Closed tasks by who has ended them, in order; what two have ended is the first one's.

    A coordinator looks where the mission stands with every word it hears, and asks for this once a
    plan is made.

    Args:
        outcomes: by UAV and task.
        states: of the tasks on the board.
    """

    def __init__(
        self, outcomes: Mapping[tuple[str, str], Outcome], states: Mapping[str, TaskState]
    ) -> None:
        self._outcomes = dict(outcomes)
        self._states = dict(states)

    def __getitem__(self, uav: str) -> tuple[str, ...]:
        return self._lists[uav]

    def __iter__(self) -> Iterator[str]:
        return iter(self._lists)

    def __len__(self) -> int:
        return len(self._lists)

    @cached_property
    def _lists(self) -> dict[str, tuple[str, ...]]:
        visited: dict[str, list[str]] = {}
        seen: set[str] = set()
        ended = sorted(self._outcomes.items(), key=lambda item: (item[1].completed_s, item[0]))
        for (uav, task), _ in ended:
            if task not in seen and self._states.get(task, TaskState.OPEN) is not TaskState.OPEN:
                seen.add(task)
                visited.setdefault(uav, []).append(task)
        return {uav: tuple(tasks) for uav, tasks in visited.items()}
