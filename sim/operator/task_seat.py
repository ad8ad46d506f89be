"""An operator's seat that keeps the task board of a mission whose coordinator is lost.

It posts tasks when they appear and withdraws them when they are withdrawn, in the coordinator's
name: each entry of the board is a register of that seat, and its newest statement counts,
whoever sits there. It shows no token and plans nothing, so the fleet goes on without a
coordinator. What it says it repeats for a while, as nobody acknowledges anything. Leaves out:
agreeing with a coordinator that lives or comes back.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping
from dataclasses import replace

from coordinator.postings import Postings
from swarm.config import Timing
from swarm.events import Ask, BusFact, Finish, Heard, Learned, Publish, Wish
from swarm.model import Mission, TaskId
from swarm.model.ids import COORDINATOR
from swarm.state.registers import Replica
from swarm.state.voice import Voice
from swarm.wire.messages import Board, Epoch, EpochPhase, Message

__all__ = ["TaskSeat"]


class TaskSeat:
    """A core that posts and withdraws tasks when their time has come.

    Args:
        mission: the scenario, pop-ups included.
        withdrawn_at_s: tasks that are withdrawn, and when [s mission time].
        incarnation: greater than in any life of the coordinator.
        timing: timers, in the seconds of ``now_s``.
        patience_s: for how long to repeat what it says, and to wait for a mission that runs
            [s of ``now_s``].
    """

    def __init__(
        self,
        mission: Mission,
        withdrawn_at_s: Mapping[TaskId, float],
        *,
        incarnation: int,
        timing: Timing,
        patience_s: float,
    ) -> None:
        self._replica = Replica()
        self._postings = Postings(mission, self._replica)
        self._voice = Voice(mission.name, COORDINATOR, incarnation)
        self._to_withdraw: dict[str, float] = {str(t): at_s for t, at_s in withdrawn_at_s.items()}
        self._timing = timing
        self._patience_s = patience_s
        self._zero_s: float | None = None
        self._said: list[tuple[float, Message]] = []
        """What to repeat, and until when."""
        self._again_at_s = math.inf
        """When to ask again; once the mission is known, when to repeat."""
        self._leave_at_s = math.inf
        """When to give up on a mission that nobody tells of."""
        self._finished = False

    def start(self, now_s: float) -> list[Wish]:
        """Ask what there is to know."""
        self._leave_at_s = now_s + self._patience_s
        self._again_at_s = now_s + self._timing.ask_s
        return [Ask()]

    def step(self, fact: BusFact, now_s: float) -> list[Wish]:
        """Take note of one fact, and say what is due."""
        if self._finished:
            return []
        match fact:
            case Heard(message):
                self._take_in([message], now_s)
            case Learned(snapshots):
                for snapshot in snapshots:
                    if self._zero_s is None and snapshot.mission_s is not None:
                        self._zero_s = now_s - snapshot.mission_s
                    self._take_in(snapshot.messages, now_s)
            case _:
                pass
        wishes = self._repeat(now_s)
        if self._zero_s is not None:
            wishes += [Publish(message) for message in self._due(self._zero_s, now_s)]
        if self._is_done(now_s):
            self._finished = True
            wishes.append(Finish(0))
        return wishes

    def next_deadline_s(self) -> float | None:
        """When `step` wants a tick; None when it has finished."""
        if self._finished:
            return None
        if self._zero_s is None:
            at_s = min(self._again_at_s, self._leave_at_s)
            return None if at_s == math.inf else at_s
        times_s = [self._zero_s + at_s for at_s in self._to_withdraw.values()]
        if (posts_s := self._postings.next_deadline_s(self._zero_s)) is not None:
            times_s.append(posts_s)
        if self._said:
            times_s.append(self._again_at_s)
        return min(times_s, default=None)

    def _take_in(self, messages: Iterable[Message], now_s: float) -> None:
        for message in messages:
            if message.writer == COORDINATOR:
                self._voice.outdo(message.stamp)
            if self._replica.join(message) and self._zero_s is None:
                match message.body:
                    case Epoch(phase=EpochPhase.RUNNING, mission_s=mission_s):
                        self._zero_s = now_s - mission_s
                    case _:
                        pass

    def _due(self, zero_s: float, now_s: float) -> list[Message]:
        """Say what has come about by now."""
        entries = self._postings.due(zero_s, now_s)
        posted = {**self._replica.board, **{entry.task: entry for entry in entries}}
        # The same sum as the deadline's: another may round to just before it.
        late = [t for t, at_s in self._to_withdraw.items() if zero_s + at_s <= now_s]
        for task in late:
            del self._to_withdraw[task]
            entry = posted.get(task)
            if entry is not None and not entry.withdrawn:
                entries.append(replace(entry, withdrawn=True))
        said = [self._say(entry, now_s) for entry in entries]
        if said:
            self._again_at_s = now_s + self._timing.announce_s
        return said

    def _say(self, entry: Board, now_s: float) -> Message:
        message = self._voice.say(entry)
        self._replica.join(message)
        self._said.append((now_s + self._patience_s, message))
        return message

    def _repeat(self, now_s: float) -> list[Wish]:
        if self._again_at_s > now_s:
            return []
        self._again_at_s = now_s + (
            self._timing.ask_s if self._zero_s is None else self._timing.announce_s
        )
        if self._zero_s is None:
            return [Ask()]
        said, self._said = self._said, [each for each in self._said if each[0] > now_s]
        return [Publish(message) for _, message in said]

    def _is_done(self, now_s: float) -> bool:
        if self._zero_s is None:
            return self._leave_at_s <= now_s
        return not (self._said or self._to_withdraw or self._postings.more_to_come)
