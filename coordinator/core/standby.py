"""The coordinator that stands by: watches the one at work, and takes its place when it is lost.

It watches without a token and says nothing. When the coordinator has been missed for a while and
does not answer either, it becomes the coordinator itself: a `CoordinatorCore` that remembers all
that was heard meanwhile.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence

from coordinator.core.active import CoordinatorCore
from coordinator.core.leadership import StateQuery
from coordinator.core.lifecycle import CoordinatorAction, CoordinatorEvent, TakeSeat
from coordinator.core.publication import exit_status
from swarm.model import Mission
from swarm.model.ids import COORDINATOR
from swarm.protocol.board import TaskBoard
from swarm.protocol.events import (
    Ask,
    Finish,
    KeysReplaced,
    LinkChanged,
    LogLine,
    MessageReceived,
    MessagesReceived,
    PeerGone,
    PeerSeen,
    SnapshotsReceived,
    Stop,
)
from swarm.protocol.membership import Membership
from swarm.protocol.messages import Message, MissionPhase, PlanEpoch, Snapshot
from swarm.protocol.mission_clock import MissionClock
from swarm.protocol.registers import Replica, snapshot_without
from swarm.protocol.timing import StallDetector, Timing, earliest

MakeCoordinator = Callable[[Snapshot | None, float], CoordinatorCore]
"""Makes the coordinator with that memory, of that age [s]."""


class StandbyCore:
    """One process that stands by for the coordinator of one mission.

    Args:
        memory: of an earlier life as coordinator, for when nothing newer is heard.
        memory_age_s: how old that is [s].
    """

    def __init__(
        self,
        mission: Mission,
        make_coordinator: MakeCoordinator,
        timing: Timing,
        memory: Snapshot | None = None,
        memory_age_s: float = 0.0,
    ) -> None:
        self._replica = Replica()
        self.coordinator: CoordinatorCore | None = None
        """Itself at work; None as long as it watches."""
        self._mission = mission
        self._make_coordinator = make_coordinator
        self._timing = timing
        self._memory = memory
        self._memory_age_s = memory_age_s
        self._membership = Membership(timing)
        self._board = TaskBoard(self._replica, mission.name)
        self._state_query = StateQuery(timing.ask_gap_s)
        self._stall_detector = StallDetector(timing.pause_s)
        self._actions: list[CoordinatorAction] = []
        self._linked = True
        self._clock = MissionClock()
        self._due_at_s: float | None = None
        """When it takes the place of the coordinator, which is missing; None while it is there."""
        self._last_question = False
        """Whether it asks, before it takes over, if the coordinator does not answer either."""
        self._saw_coordinator = False
        self._finished = False

    # -- the one entry point ----------------------------------------------------------

    def start(self, now_s: float) -> Sequence[CoordinatorAction]:
        """Ask what there is to know, and look who is there."""
        self._state_query.want(now_s)
        self._wait_for_links(now_s)
        return self._conclude(now_s)

    def step(self, event: CoordinatorEvent, now_s: float) -> Sequence[CoordinatorAction]:
        """React to one event; once it has taken over, as the coordinator."""
        if self.coordinator is not None:
            return self.coordinator.step(event, now_s)
        if self._finished:
            return []
        if self._stall_detector.late(now_s):
            self._membership.held_up(now_s)
            self._state_query.want(now_s, before_deciding=True)
        self._handle(event, now_s)
        if not self._finished:
            self._advance(now_s)
        return self._conclude(now_s)

    def next_deadline_s(self) -> float | None:
        """When `step` wants a `Tick` at the latest; None when it has finished."""
        if self.coordinator is not None:
            return self.coordinator.next_deadline_s()
        if self._finished:
            return None
        deadlines = [self._state_query.next_deadline_s(), self._membership.next_deadline_s()]
        if self._linked and not self._state_query.unsure:
            deadlines.append(self._due_at_s)
        return earliest(*deadlines)

    def snapshot(self, now_s: float) -> Snapshot:
        """What this process answers, once it has taken the seat."""
        if self.coordinator is None:
            return self._known(now_s, ())
        return self.coordinator.snapshot(now_s)

    def whole(self, now_s: float) -> Snapshot:
        """All it knows, once it has taken the seat."""
        return self.snapshot(now_s) if self.coordinator is None else self.coordinator.whole(now_s)

    def memory(self, now_s: float) -> Snapshot:
        """All it knows."""
        if self.coordinator is None:
            return self._known(now_s, tuple(self._replica.messages()))
        return self.coordinator.memory(now_s)

    @property
    def replica(self) -> Replica:
        """All registers it knows."""
        return self._replica if self.coordinator is None else self.coordinator.replica

    @property
    def stood_down(self) -> str | None:
        """Why it has left the seat to another one again; None as long as it has not."""
        return None if self.coordinator is None else self.coordinator.stood_down

    def _known(self, now_s: float, messages: tuple[Message, ...]) -> Snapshot:
        mission_s = self._clock.mission_s(now_s)
        return Snapshot(self._mission.name, COORDINATOR, 0, mission_s, messages)

    # -- watching -----------------------------------------------------------------------

    def _handle(self, event: CoordinatorEvent, now_s: float) -> None:
        match event:
            case MessageReceived() | MessagesReceived():
                for message in event.messages:
                    self._membership.heard(message.writer, now_s)
                    self._take_in(message, now_s if event.arrived_s is None else event.arrived_s)
            case SnapshotsReceived(snapshots):
                self._state_query.answered()
                for snapshot in snapshots:
                    is_word = snapshot.writer == COORDINATOR or not self._clock.is_set
                    if is_word and snapshot.mission_s is not None:
                        self._clock.hear(snapshot.mission_s, now_s)
                    for message in snapshot.messages:
                        self._take_in(message, now_s)
                if any(snapshot.writer == COORDINATOR for snapshot in snapshots):
                    self._wait(now_s)
            case PeerSeen(writer):
                self._membership.seen(writer, now_s)
            case PeerGone(writer):
                self._membership.gone(writer, now_s)
            case KeysReplaced(names):
                self._replica.demote_revoked(names)
                if self._memory is not None:
                    self._memory = snapshot_without(names, self._memory)
            case LinkChanged(up):
                self._membership.link(up, now_s)
                self._linked = up
                self._last_question = False
                if up and self._state_query.ever:
                    self._state_query.want(now_s, before_deciding=True)
                    self._wait_for_links(now_s)
            case Stop(reason):
                self._finished = True
                self._actions += [LogLine("stands by no longer", {"reason": reason}), Finish(0)]
            case _:
                pass

    def _take_in(self, message: Message, arrived_s: float) -> None:
        brief, epoch, body = self._replica.brief, self._replica.epoch, message.body
        if not self._replica.join(message):
            return
        self._clock.heed(body, brief, epoch)
        if isinstance(body, PlanEpoch) and body.phase is MissionPhase.RUNNING:
            self._clock.hear(body.mission_s, arrived_s)

    def _wait(self, since_s: float) -> None:
        """Give the coordinator the time that it has from ``since_s`` on."""
        self._due_at_s, self._last_question = since_s + self._timing.takeover_s, False

    def _wait_for_links(self, now_s: float) -> None:
        """Tokens are only seen when links are up, and those take their time."""
        self._wait(now_s + self._timing.relink_grace_s)

    def _advance(self, now_s: float) -> None:
        if COORDINATOR in self._membership.lost(now_s):
            self._actions.append(LogLine("coordinator lost"))
            self._wait(now_s)
        if COORDINATOR in self._membership.present:
            self._due_at_s, self._last_question = None, False
            if not self._saw_coordinator:
                self._saw_coordinator = True
                self._actions.append(LogLine("stands by for the coordinator"))
            return
        if not self._linked or self._state_query.unsure:  # what it misses may be its own link
            return
        if self._due_at_s is None or self._due_at_s > now_s:
            return
        if self._last_question:
            self._take_over(now_s)
        else:
            self._state_query.want(now_s, before_deciding=True)
            self._last_question = True

    def _take_over(self, now_s: float) -> None:
        others = self._membership.present
        epoch = self._replica.epoch
        if epoch is not None and epoch.phase is MissionPhase.ENDED and not others:
            self._finished = True
            status = exit_status(self._board, self._mission)
            self._actions += [
                LogLine("the mission has ended and everyone has left"),
                Finish(status),
            ]
            return
        memory, age_s = self._memory, self._memory_age_s
        if self._replica.brief is not None:
            memory, age_s = self.memory(now_s), 0.0
        coordinator = self._make_coordinator(memory, age_s)
        self._actions += [LogLine("takes the coordinator's place"), TakeSeat()]
        self._actions += coordinator.start(now_s)
        for writer in sorted(others):
            self._actions += coordinator.step(PeerSeen(writer), now_s)
        self.coordinator = coordinator

    def _conclude(self, now_s: float) -> list[CoordinatorAction]:
        if self.coordinator is None:
            present = len(self._membership.present)
            if not self._finished and self._state_query.due(now_s, present):
                self._actions.append(Ask())
            self._stall_detector.expect_by(self.next_deadline_s())
        actions, self._actions = self._actions, []
        return actions
