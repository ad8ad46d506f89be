"""The state of one mission as somebody who listens to the bus knows it, and its story.

Everything that is shown, recorded or measured of a running mission is read from here.
"""

from __future__ import annotations

from collections import Counter, deque
from collections.abc import Callable, Collection
from dataclasses import replace

import numpy as np

from coordinator.mission_view.presentation import StoryLine
from coordinator.mission_view.results import MissionResult
from swarm.allocation.objective import executed_objective
from swarm.allocation.problem import Problem
from swarm.model import Mission, Plan, Task, TaskId, UavId
from swarm.model.ids import COORDINATOR
from swarm.protocol.board import TaskBoard, TaskState, holders
from swarm.protocol.events import (
    Ask,
    CommonAction,
    CommonEvent,
    KeysReplaced,
    LinkChanged,
    MessageReceived,
    PeerGone,
    PeerSeen,
    SnapshotsReceived,
)
from swarm.protocol.membership import Membership
from swarm.protocol.messages import (
    REVOKED_INCARNATION,
    CommandKind,
    Message,
    MissionConfig,
    MissionPhase,
    OperatorCommand,
    PlanEpoch,
    Stamp,
    StartWithout,
    TaskEdit,
    TaskEntry,
)
from swarm.protocol.mission_clock import MissionClock
from swarm.protocol.operator_commands import dispensable, in_force
from swarm.protocol.registers import Replica
from swarm.protocol.sync import QuestionTimer
from swarm.protocol.timing import StallDetector, Timing, earliest
from swarm.protocol.uav_messages import (
    AttemptResult,
    Choice,
    Claim,
    ClaimPhase,
    Outcome,
    Status,
    StatusPhase,
)

__all__ = ["CHOICES_KEPT", "STORY_KEPT", "MissionState"]


_COMMANDED = {
    CommandKind.HOLD: "operator holds {}",
    CommandKind.RESUME: "operator lets {} go on",
    CommandKind.RETURN: "operator sends {} home",
    CommandKind.ABORT: "operator aborts the mission",
}


_LEAVING = {StatusPhase.OUT: "gave its vehicle up", StatusPhase.RETURNING: "goes home"}
"""Parts of an agent's life in which it takes no tasks any more, in words."""
_IN_FLIGHT = (StatusPhase.IDLE, StatusPhase.FLYING, StatusPhase.SERVING)
"""Parts in which a note is a remark about the vehicle."""


NAMES_TOLD = 5
"""Of those whose keys have changed."""
STORY_KEPT = 20_000
"""Lines of the story that an observer remembers; there are some for each task and each loss."""
EPOCHS_KEPT = 16
"""Epochs that an observer tells from new ones; one is restated soon after it was stated, or not."""
CHOICES_KEPT = 2000
"""What an observer remembers of why tasks were taken."""


class MissionState:
    """The state of one mission, as one observer knows it.

    Args:
        mission: the scenario being flown, pop-ups included.
        timing: timers, in the seconds of ``now_s``.
    """

    def __init__(self, mission: Mission, timing: Timing) -> None:
        self._mission = mission
        """The one being flown, with what the operator has added to it."""
        self._revision: Callable[[], Mission] | None = None
        """Gives the mission anew, as soon as somebody wants to know it."""
        self.plan: Plan | None = None
        """The offline plan; set by whoever knows it."""
        self.replica = Replica()
        self.board = TaskBoard(self.replica, mission.name)
        self._left: set[str] = set()
        self._remarks: dict[str, str] = {}
        """What was told last of each UAV's vehicle."""
        """UAVs of which has been told why they left, while there was something to do."""
        self.statuses: dict[str, Status] = {}
        """Newest status by UAV id, whatever order they arrived in."""
        self.heard_s: dict[str, float] = {}
        """When each writer last said something itself [s of ``now_s``]."""
        self.present: set[str] = set()
        """Writers believed to be there."""
        self.lost: list[UavId] = []
        """UAVs that disappeared while they took part, and are not back."""
        self.story: list[StoryLine] = []
        """The newest lines; where older ones are gone, the first tells how many."""
        self._forgotten = 0
        """Lines that were told before those."""
        self.choices: deque[tuple[str, Stamp, Choice]] = deque(maxlen=CHOICES_KEPT)
        """Why UAVs took tasks, in order of arrival; without `ChoiceBasis.heads`, which no
        observer needs."""
        self._chosen: set[tuple[str, Stamp]] = set()
        """Which those are."""
        self.cut_since_s: float | None = None
        """When the own link to the bus went down [s of ``now_s``]; None while it is up."""
        self.pace = 1.0
        """Mission seconds per second of ``now_s``; see `keep_time`."""
        self._membership = Membership(timing)
        self._clock = MissionClock()
        """Against ``now_s`` times the pace."""
        self._orphans: dict[str, str] = {}
        self._epochs: deque[tuple[object, ...]] = deque(maxlen=EPOCHS_KEPT)
        """The last ones in which the mission ran."""
        self._epochs_heard = 0
        self._stamps: dict[str, Stamp] = {}
        self._dropped_before: dict[str, Counter[str]] = {}
        self._repeated_visits = 0
        self._coordinator: int | None = None
        self._coordinator_missed = False
        self._missed: set[str] = set()
        self._stall_detector = StallDetector(timing.pause_s)
        self._known_at_start = {task.id for task in mission.known_at_start().tasks}
        self._ended_told = False
        self._joining = False
        """Whether it is just being told what happened before it came."""
        self._timing = timing
        self._asking = QuestionTimer(timing.ask_gap_s)
        self._ask_at_s = 0.0
        self._problem: Problem | None = None
        """Of the mission, as far as it has been wanted."""
        self._given = mission
        self._scenario = {task.id for task in mission.tasks}
        self._added_s: dict[str, float] = {}
        """By task that the operator has added: when that was heard [s mission time]."""

    def start(self, now_s: float) -> list[CommonAction]:
        """Ask what has happened so far."""
        self._asking.want(now_s)
        return self._ask(now_s)

    def step(self, fact: CommonEvent, now_s: float) -> list[CommonAction]:
        """Take note of one fact."""
        ask = self._stall_detector.late(now_s)
        if ask:
            self._membership.held_up(now_s)
        match fact:
            case MessageReceived(message):
                self.heard_s[message.writer] = now_s
                if self._membership.heard(message.writer, now_s):
                    ask |= self._welcome_back(message.writer, now_s)
                if message.writer == COORDINATOR:
                    self._hear_coordinator(message, now_s)
                self._hear(message, now_s)
            case SnapshotsReceived(snapshots):
                self._joining, told = self.replica.brief is None, self.told
                for snapshot in snapshots:
                    is_word = snapshot.writer == COORDINATOR or not self._clock.is_set
                    if is_word and snapshot.mission_s is not None:
                        self._clock.hear(snapshot.mission_s, now_s * self.pace)
                    for message in snapshot.messages:
                        self._hear(message, now_s)
                if self._joining:
                    news = self.told_since(told)
                    self.story[len(self.story) - len(news) :] = sorted(
                        news, key=lambda h: h.mission_s or 0.0
                    )
                    self._joining = False
                self._membership.expect(self.replica.claims, now_s)
            case PeerSeen(writer):
                # What it said while one of us had no link has not come here.
                ask |= self._membership.missing(writer)
                if self._membership.seen(writer, now_s):
                    ask |= self._welcome_back(writer, now_s) or self._is_newcomer(writer)
            case PeerGone(writer):
                self._membership.gone(writer, now_s)
            case KeysReplaced(names):
                self._disown(names, now_s)
            case LinkChanged(up):
                self._membership.link(up, now_s)
                if up or self.cut_since_s is None:
                    self.cut_since_s = None if up else now_s
                ask |= up
            case _:
                pass
        for writer in self._membership.lost(now_s):
            ask |= self._lose(writer, now_s)
        self.present = self._membership.present
        if ask or (self.replica.brief is None and self._ask_at_s <= now_s):
            self._asking.want(now_s)
        wishes = self._ask(now_s)
        self._stall_detector.expect_by(self.next_deadline_s())
        return wishes

    @property
    def mission(self) -> Mission:
        """What is being flown, as far as it is known."""
        if self._revision is not None:
            self._given, self._revision = self._revision(), None
            self._complete_mission()
        return self._mission

    def revise(self, mission: Callable[[], Mission]) -> None:
        """The mission was unknown, or the board has changed: take what ``mission`` gives.

        It is called when somebody next wants to know, as boards are told entry by entry.
        """
        self._revision = mission

    def take_note(self, message: Message, now_s: float) -> None:
        """Take in what is being said by this very process."""
        self._hear(message, now_s)

    def next_deadline_s(self) -> float | None:
        """When `step` wants a tick."""
        return earliest(
            self._membership.next_deadline_s(),
            self._asking.next_deadline_s(),
            self._ask_at_s if self.replica.brief is None else None,
        )

    def mission_s(self, now_s: float) -> float | None:
        """Mission time; None before the start."""
        return self._clock.mission_s(now_s * self.pace)

    def keep_time(self, now_s: float, mission_s: float, pace: float) -> None:
        """Follow a mission whose time runs otherwise than the own clock.

        Args:
            now_s: time of the own clock [s].
            mission_s: mission time then [s].
            pace: mission seconds per second of the own clock; > 0.
        """
        self.pace, self._clock = pace, MissionClock()
        self._clock.hear(mission_s, now_s * pace)

    def silent_s(self, uav: str, now_s: float) -> float | None:
        """How long one that is there has said nothing, once that is half of what gives it up [s].

        While the own link is down nothing is heard of anybody, which says nothing of them.
        """
        heard_s = self.heard_s.get(uav)
        if heard_s is None or uav not in self.present or self.cut_since_s is not None:
            return None
        silent_s = now_s - heard_s
        return silent_s if silent_s >= self._timing.silence_s / 2.0 else None

    @property
    def phase(self) -> MissionPhase:
        """How far the mission is."""
        epoch = self.replica.epoch
        return MissionPhase.PREPARING if epoch is None else epoch.phase

    @property
    def holders(self) -> dict[str, str]:
        """Task id -> UAV id that is on its way to it or serves it."""
        claims = {u: c for u, c in self.replica.claims.items() if u in self.present}
        states = self.board.states
        return {t: u for t, u in holders(claims).items() if states.get(t) is TaskState.OPEN}

    @property
    def dropped(self) -> dict[str, Counter[str]]:
        """What each UAV's agents have dropped in all their lives, by reason."""
        return {
            uav: self._dropped_before.get(uav, Counter()) + Counter(status.dropped)
            for uav, status in self.statuses.items()
        }

    def result(self) -> MissionResult:
        """What has been executed so far."""
        mission = self.mission
        if self._problem is None:
            self._problem = Problem.from_mission(mission)
        problem = self._problem
        index = {task: number for number, task in enumerate(problem.task_ids)}
        uav_index = {uav: number for number, uav in enumerate(problem.uav_ids)}
        visits = [
            (outcome.completed_s, UavId(uav), TaskId(task))
            for (uav, task), outcome in self.replica.outcomes.items()
            if outcome.result is AttemptResult.DONE and task in index and uav in uav_index
        ]
        # Tasks at one place may end at one instant: those stay in the order they were told in.
        visits.sort(key=lambda visit: visit[:2])
        lists: dict[UavId, list[TaskId]] = {uav: [] for uav in problem.uav_ids}
        times_s = np.full(problem.n_task, np.nan)
        by = np.full(problem.n_task, -1, dtype=np.int64)
        for completed_s, uav, task in visits:
            lists[uav].append(task)
            if by[index[task]] < 0:
                times_s[index[task]], by[index[task]] = completed_s, uav_index[uav]
        completion_s = {
            task: float(time_s)
            for task, time_s, who in zip(problem.task_ids, times_s, by, strict=True)
            if who >= 0
        }
        indices = [[index[task] for task in route] for route in lists.values()]
        states = self.board.states
        return MissionResult(
            executed_routes={uav: tuple(route) for uav, route in lists.items()},
            executed_completion_s=completion_s,
            executed_objective=executed_objective(problem, indices, times_s, by),
            done=tuple(completion_s),
            failed=tuple(t for t in problem.task_ids if states.get(t) is TaskState.FAILED),
            open=tuple(
                t
                for t in problem.task_ids
                if states.get(t, TaskState.OPEN) is TaskState.OPEN and t not in completion_s
            ),
            duplicate_visits=len(visits) - len(completion_s) + self._repeated_visits,
            makespan_s=max(completion_s.values(), default=0.0),
            lost_uavs=tuple(self.lost),
            epochs=self._epochs_heard,
            added=tuple(
                task.id
                for task in self.mission.tasks
                if task.id not in self._scenario and task.id not in self.replica.posted
            ),
        )

    @property
    def told(self) -> int:
        """How many lines the story has had so far."""
        return self._forgotten + len(self.story)

    def told_since(self, told: int) -> list[StoryLine]:
        """The lines after the first ``told`` ever, as far as they are remembered."""
        return self.story[max(0, told - self._forgotten) :]

    def tell(self, text: str, now_s: float) -> None:
        """Add to the story what happened now."""
        self._tell(text, now_s)

    def _ask(self, now_s: float) -> list[CommonAction]:
        if not self._asking.due(now_s):
            return []
        self._ask_at_s = now_s + self._timing.ask_s
        return [Ask()]

    # -- the story --------------------------------------------------------------------

    def _hear(self, message: Message, now_s: float) -> None:
        if isinstance(message.body, Status):
            self._hear_status(message.writer, message.stamp, message.body, now_s)
            return
        if isinstance(message.body, Choice):
            self._hear_choice(message.writer, message.stamp, message.body, now_s)
            return
        if self._clock.is_set and self.replica.is_premature(message):
            return
        before = self.replica.claims.get(message.writer)
        earlier, brief, epoch = self.replica.known(message), self.replica.brief, self.replica.epoch
        if not self.replica.join(message):
            return
        self._clock.heed(message.body, brief, epoch)
        match message.body:
            case PlanEpoch() as epoch:
                self._hear_epoch(epoch, now_s)
            case TaskEntry(task=task) as entry if self.replica.board.get(task) is not entry:
                pass  # the operator has said otherwise
            case TaskEntry(task=task, withdrawn=True):
                self._tell(f"task {task} withdrawn", now_s)
            case TaskEntry(task=task) if self._is_news(task):
                self._tell(f"task {task} appeared", now_s)
            case Claim() as claim:
                self._hear_claim(message.writer, claim, before, now_s)
            case Outcome() as outcome:
                self._hear_outcome(message.writer, outcome, earlier, now_s)
            case OperatorCommand() as command:
                self._hear_command(command, now_s)
            case TaskEdit() as order:
                self._hear_task_order(order, now_s)
            case StartWithout(uav=uav, reason=reason) if uav in dispensable(self.replica):
                why = f": {reason}" if reason else ""
                self._tell(f"operator does not wait for {uav} to start{why}", now_s)
            case MissionConfig() if self.replica.task_orders:
                self._complete_mission()
            case _:
                pass

    def _is_news(self, task: str) -> bool:
        """Whether the task is a pop-up, or one that the scenario does not know at all."""
        started = self._clock.is_set and not self._joining
        return started and task not in self._known_at_start

    def _hear_status(self, uav: str, stamp: Stamp, status: Status, now_s: float) -> None:
        known = self._stamps.get(uav)
        if known is not None and stamp <= known:
            return
        if known is not None and stamp.incarnation > known.incarnation:
            # A new process counts from nought.
            before = self._dropped_before.setdefault(uav, Counter())
            before.update(self.statuses[uav].dropped)
            self._left.discard(uav)
        self._stamps[uav], self.statuses[uav] = stamp, status
        unfinished = self.board.unfinished
        if status.phase in _LEAVING and status.note and unfinished and uav not in self._left:
            self._left.add(uav)
            self._tell(f"{uav} {_LEAVING[status.phase]}: {status.note}", now_s)
        elif status.phase in _IN_FLIGHT and status.note and status.note != self._remarks.get(uav):
            self._remarks[uav] = status.note
            self._tell(f"{uav}: {status.note}", now_s)

    def _disown(self, names: Collection[str], now_s: float) -> None:
        """What has been heard under those names is no measure of what is said from now on."""
        told = ", ".join(sorted(names)[:NAMES_TOLD]) + (", …" if len(names) > NAMES_TOLD else "")
        self._tell(f"keys revoked or replaced: {told}", now_s)
        self.replica.demote_revoked(names)
        for uav in self._stamps.keys() & names:
            self._stamps[uav] = Stamp(REVOKED_INCARNATION, 0)
        stamp = self.replica.epoch_stamp
        if stamp is not None and stamp.incarnation == REVOKED_INCARNATION:
            self._coordinator = None

    def _hear_choice(self, uav: str, stamp: Stamp, choice: Choice, now_s: float) -> None:
        if (uav, stamp) in self._chosen:
            return
        if len(self.choices) == CHOICES_KEPT:
            self._chosen.discard(self.choices[0][:2])
        self._chosen.add((uav, stamp))
        slim = replace(choice, basis=replace(choice.basis, heads={}))
        self.choices.append((uav, stamp, slim))
        if choice.left is not None:
            self._tell(f"{uav} turns aside from {choice.left} to {choice.task}", now_s)

    def _hear_outcome(
        self, uav: str, outcome: Outcome, earlier: Message | None, now_s: float
    ) -> None:
        done, by = outcome.result is AttemptResult.DONE, uav
        former = earlier.body if earlier is not None else None
        if isinstance(former, Outcome) and former.result is AttemptResult.DONE and done:
            # The very same outcome, restated by a new life of the agent, is no other visit.
            if former.completed_s == outcome.completed_s:
                return
            self._repeated_visits += 1
        outcomes = self.replica.outcomes.items()
        others = {
            u for (u, t), o in outcomes if t == outcome.task and o.result is AttemptResult.DONE
        }
        again = f", as {', '.join(sorted(others - {by}))} had" if done and others - {by} else ""
        text = f"{uav} ended {outcome.task}: {outcome.result}{again}"
        self._tell(text, now_s, outcome.completed_s if self._joining else None)

    def _hear_coordinator(self, message: Message, now_s: float) -> None:
        """Tell when the coordinator is back, or another one has taken its place."""
        life = message.stamp.incarnation
        if self._coordinator is not None and life < self._coordinator:
            return
        if self.phase is not MissionPhase.ENDED and COORDINATOR in self._membership.present:
            if self._coordinator is not None and life > self._coordinator:
                self._tell("a new coordinator has taken charge", now_s)
                self._coordinator_missed = False
            elif self._coordinator_missed:
                self._tell("coordinator is back", now_s)
                self._coordinator_missed = False
        self._coordinator = life

    def _welcome_back(self, writer: str, now_s: float) -> bool:
        """Whether ``writer``, present anew, had been missed."""
        missed = writer in self._missed
        self._missed.discard(writer)
        if writer in self.lost:
            self.lost.remove(UavId(writer))
            self._tell(f"{writer} is back", now_s)
        return missed

    def _is_newcomer(self, writer: str) -> bool:
        """Whether it is a UAV whose first words may have been said before they could be heard."""
        brief, claims = self.replica.brief, self.replica.claims
        return brief is not None and writer not in claims and writer in {u.id for u in brief.uavs}

    def _hear_epoch(self, epoch: PlanEpoch, now_s: float) -> None:
        lists = tuple((uav, tasks) for uav, tasks in sorted(epoch.routes.items()))
        course = epoch.number, epoch.rule, epoch.sequence, lists
        if epoch.phase is MissionPhase.RUNNING:
            self._clock.hear(epoch.mission_s, now_s * self.pace)
        if epoch.phase is MissionPhase.RUNNING and course not in self._epochs:
            self._epochs.append(course)
            self._epochs_heard += 1
            order = " > ".join(epoch.sequence)
            brief = self.replica.brief
            fleet = set() if brief is None else {uav.id for uav in brief.uavs}
            notable = epoch.number > 1 or not fleet.issubset(epoch.sequence)
            why = f" ({epoch.reason})" if notable and epoch.reason else ""
            # With the first one mission time began.
            at_s = 0.0 if self._joining and epoch.number == 1 else None
            self._tell(f"epoch {epoch.number}: {epoch.rule}, {order}{why}", now_s, at_s)
        elif epoch.phase is MissionPhase.ENDED and not self._ended_told:
            self._ended_told = True
            self._asking.want(now_s)  # soon nobody will be there to tell what was not heard
            self._tell(f"mission ends: {epoch.reason}", now_s)

    def _hear_claim(self, uav: str, claim: Claim, before: Claim | None, now_s: float) -> None:
        unfinished = self.board.unfinished
        if claim.phase is ClaimPhase.OUT and self.phase is MissionPhase.RUNNING and unfinished:
            self._tell(f"{uav} takes no further part", now_s)
        if claim.task is None or (before is not None and before.task == claim.task):
            return
        former = self._orphans.pop(claim.task, uav)
        if former != uav:
            self._tell(f"{uav} took over {claim.task} from {former}", now_s)

    def _hear_command(self, command: OperatorCommand, now_s: float) -> None:
        if in_force(self.replica).get(command.target) != command:
            return  # of an earlier flight
        why = f": {command.reason}" if command.reason else ""
        self._tell(_COMMANDED[command.kind].format(command.target) + why, now_s)

    def _hear_task_order(self, order: TaskEdit, now_s: float) -> None:
        if self.replica.ordered(order.task) is order:  # and not of an earlier flight
            what = f"withdraws {order.task}" if order.withdrawn else f"adds task {order.task}"
            self._tell(f"operator {what}" + (f": {order.reason}" if order.reason else ""), now_s)
            self._added_s.setdefault(order.task, max(0.0, self.mission_s(now_s) or 0.0))
        self._complete_mission()

    def _complete_mission(self) -> None:
        """The mission as it was given, with the tasks that the operator has ordered in it."""
        tasks = {task.id: task for task in self._given.tasks}
        for order in self.replica.task_orders.values():
            if self.replica.ordered(order.task) is not order:
                continue
            known = tasks.get(TaskId(order.task))
            if known is None or not order.withdrawn:
                tasks[TaskId(order.task)] = Task(
                    TaskId(order.task),
                    order.position_enu_m,
                    order.value,
                    order.service_s,
                    order.kind,
                    self._added_s.get(order.task, 0.0) if known is None else known.appears_s,
                )
        self._mission = replace(self._given, tasks=tuple(tasks.values()))
        self._problem = None

    def _lose(self, writer: str, now_s: float) -> bool:
        """Tell of a loss; whether others may have heard last words."""
        self._missed.add(writer)
        silent = ", silent though its link is up" if self._membership.mute(writer) else ""
        if writer == COORDINATOR:
            if self.phase is MissionPhase.RUNNING:
                text = f"coordinator lost{silent}; the fleet goes on with the last epoch"
                self._tell(text, now_s)
            elif self.phase is MissionPhase.PREPARING:
                self._tell(f"coordinator lost{silent} before the mission began", now_s)
            self._coordinator_missed = True
            return True
        claim = self.replica.claims.get(writer)
        if claim is None or claim.phase is ClaimPhase.OUT:
            return False
        if writer not in self.lost:
            self.lost.append(UavId(writer))
        opened = self.board.states.get(claim.task or "") is TaskState.OPEN
        if claim.task is not None and opened:
            self._orphans[claim.task] = writer
            self._tell(f"{writer} lost{silent}; task {claim.task} is open again", now_s)
        else:
            self._tell(f"{writer} lost{silent}", now_s)
        return True

    def _tell(self, text: str, now_s: float, at_s: float | None = None) -> None:
        """Add to the story what happened now, or at mission time ``at_s``."""
        self.story.append(StoryLine(self.mission_s(now_s) if at_s is None else at_s, text))
        if len(self.story) > STORY_KEPT:
            kept = self.story[-STORY_KEPT // 2 :]
            gone = self.told - len(kept)
            self.story = [StoryLine(None, f"{gone} earlier lines are no longer kept"), *kept]
            self._forgotten = gone - 1
