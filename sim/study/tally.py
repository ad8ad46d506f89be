"""Counts what a fleet does in a virtual world: a `Flight` from what its processes say.

Leaves out: what any of it is worth (sim.study.flight).
"""

from __future__ import annotations

from collections.abc import Mapping

from agent.vehicle import GoTo
from sim.processes import Process
from sim.study.flight import Visit
from swarm.events import Note
from swarm.model import TaskId, UavId
from swarm.model.ids import COORDINATOR
from swarm.wire.messages import (
    Board,
    Choice,
    Claim,
    Epoch,
    EpochPhase,
    Message,
    Outcome,
    Result,
    TaskOrder,
)

__all__ = ["Tally"]


class Tally:
    """Watches a world and counts."""

    def __init__(self) -> None:
        self.visits: list[Visit] = []
        self.messages = 0
        self.released = 0
        self.epochs = 0
        self.moved = 0
        self._zero_s: float | None = None
        self._attempts: set[tuple[str, str, int]] = set()
        self._closed: set[str] = set()
        self._claimed: dict[str, tuple[Process, str | None]] = {}
        self._epoch: Epoch | None = None

    def said(self, process: Process, message: Message) -> None:
        """Count a message, unless it is for onlookers alone, and what it tells that is new."""
        self.messages += not isinstance(message.body, Choice)
        match message.body:
            case Claim(task=task):
                self._claimed[message.writer] = process, task
            case Outcome() as outcome:
                self._end_attempt(process, message.writer, outcome)
            case Epoch(phase=EpochPhase.RUNNING) as epoch:
                self._take_epoch(process, epoch)
            case Board(task=task, withdrawn=True) | TaskOrder(task=task, withdrawn=True):
                self._closed.add(task)
            case _:
                pass

    def stepped(self, process: Process) -> None:
        """Steps are not counted."""

    def raised(self, process: Process, fault: Exception) -> None:
        """A core has raised.

        Raises:
            RuntimeError: always; a flight with a broken process is none to count.
        """
        raise RuntimeError(f"{process.name} has broken down") from fault

    def refused(self, process: Process, order: GoTo) -> None:
        """No vehicle refuses anything here."""

    def noted(self, process: Process, note: Note) -> None:
        """Count a task that is given up on the way."""
        self.released += note.text in ("released", "turns aside") and process.name != COORDINATOR

    def _end_attempt(self, process: Process, uav: str, outcome: Outcome) -> None:
        attempt = uav, outcome.task, outcome.attempt
        if attempt in self._attempts or self._zero_s is None:
            return
        self._attempts.add(attempt)
        done = outcome.result is Result.DONE
        # By the world's clock, whatever the UAV's shows.
        completed_s = process.now_s() - self._zero_s
        self.visits.append(Visit(UavId(uav), TaskId(outcome.task), completed_s, done))
        if done:
            self._closed.add(outcome.task)

    def _take_epoch(self, process: Process, epoch: Epoch) -> None:
        if self._zero_s is None:
            self._zero_s = process.now_s()
        before, self._epoch = self._epoch, epoch
        if before is not None and before.number == epoch.number:
            return  # said again
        self.epochs += 1
        if before is not None:
            under_way = {task for by, task in self._claimed.values() if task and not by.over}
            settled = self._closed | under_way
            old, new = _whose(before.routes), _whose(epoch.routes)
            self.moved += sum(
                old.get(task, uav) != uav for task, uav in new.items() if task not in settled
            )


def _whose(routes: Mapping[str, tuple[str, ...]]) -> dict[str, str]:
    return {task: uav for uav, tasks in routes.items() for task in tasks}
