"""The tasks of one UAV under command, one after the other: from the decision to the outcome.

Decides whenever the UAV is free, claims and flies at once, turns to something better that opens on
the way, gives way to stronger claims and waits idle while there is nothing for it. A claim's way:
`Tasking.advance`, which `AgentCore.step` calls, decides (`decide`), claims (`Announcer.say`) and
orders the vehicle to the task (`GoTo`), all in one step. What the field's constraints add is in
agent.core.field_tasking; a plain mission meets nothing of it.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from dataclasses import replace

from agent.core.context import AgentContext, AgentPart
from agent.core.decision import (
    ChoiceReporter,
    DecisionTurn,
    RecordingRule,
    RefusedTasks,
    decide,
    decide_diversion,
    nothing_left,
)
from agent.core.flights import Flights
from agent.core.interface import FlightLimits
from agent.core.states import (
    FREE,
    TAKES_TARGETS,
    AgentState,
    FreePeriod,
    TaskAttempt,
    Trigger,
)
from swarm.allocation.lower_level import Decision, Rule
from swarm.allocation.problem import Problem
from swarm.allocation.rules import GuidedRule
from swarm.protocol.board import RuleMaker, TaskState, ranks, rule_of
from swarm.protocol.messages import PlanEpoch, TaskEntry
from swarm.protocol.open_tasks import OpenTasks
from swarm.protocol.timing import earliest
from swarm.protocol.uav_messages import AttemptResult, Claim, ClaimPhase, Outcome

_MANY_TASKS = 500
"""Where more are open, only UAVs in whose reach something opens consider turning to it: that takes
tens of milliseconds at 200 × 5000."""
_REACH_TASKS = 56
"""Within reach are so many tasks that pay best; a guided decision reconsiders as many."""


class Tasking(AgentPart, ABC):
    """What one UAV does about tasks, and its claim.

    Args:
        make_rule: what a UAV decides by in an epoch of that rule and those routes.
    """

    def __init__(self, context: AgentContext, make_rule: RuleMaker = rule_of) -> None:
        super().__init__(context)
        self._choices = ChoiceReporter(context)
        self._flights = Flights(context)
        self._make_rule = make_rule
        self._rule: Rule | None = None
        self._rule_basis: object = None
        self._free = FreePeriod(0.0)
        self._attempt = TaskAttempt()
        self._refused = RefusedTasks(context.timing.reconsider_s)
        self._opened: set[str] = set()
        """Tasks that have opened, and may be worth turning to in flight."""
        self._open_tasks = OpenTasks(context.mission_view.board)

    # -- from without ---------------------------------------------------------------

    @property
    def claim(self) -> Claim | None:
        """The UAV's claim register; None while it takes no tasks."""
        return self._replica.claims.get(self._uav) if self._machine.takes_tasks else None

    @property
    def is_handed_over(self) -> bool:
        """Whether the last claim says that somebody else has the vehicle."""
        claim = self._replica.claims.get(self._uav)
        return claim is not None and claim.handed_over

    @property
    def undecided(self) -> bool:
        """Whether, being idle, it may yet find a task."""
        return self._free.to_decide or self._free.awaits_peers

    def leaves_refused(self, now_s: float) -> bool:
        """Whether, being idle, it leaves an open task alone that its vehicle has refused."""
        left_alone = self._refused.left_alone(now_s)
        return self._machine.state in FREE and any(map(self._mission_view.is_open, left_alone))

    def label(self, leg: int) -> dict[str, object]:
        """For the log: which choice that leg came of, if it is the one being flown."""
        return self._choices.label if leg == self._flights.leg and self._task() is not None else {}

    def resume(self, claim: Claim, now_s: float) -> None:
        """An earlier life of this agent claimed so: stand by it, if it still counts.

        The vehicle may fly there, but takes no targets before `begin`.
        """
        if claim.task is None or not self._machine.take(Trigger.CLAIM_RECOVERED):
            return
        if (lost := self._lost()) is not None:
            self._release(lost, now_s)
            return
        # Others keep away from the task only for a vehicle that shows itself.
        self._attempt = TaskAttempt(ready_by_s=now_s + self._timing.silence_s)
        if claim.phase is ClaimPhase.PROPOSED:
            self._attempt.held_at_s = now_s + self._timing.objection_window_s
        self._say(claim)
        self._log("resumes", task=claim.task)

    def introduce(self, limits: FlightLimits | None = None) -> None:
        """The mission is known, or the vehicle has said its limits: tell how it will fly."""
        self._flights.meter.introduce(limits)

    def disturbed(self) -> None:
        """The vehicle gives way, or nobody saw it arrive: the time of this leg tells nothing."""
        self._flights.meter.disturb()

    def begin(self, now_s: float) -> None:
        """The vehicle takes targets: fly to the resumed task, or be free."""
        task = self._task()
        if task is None and self._machine.state is AgentState.RESUMING:
            self._machine.take(Trigger.CLAIM_LOST)
        self._machine.take(Trigger.VEHICLE_READY)
        self._attempt.ready_by_s = None
        if task is not None:
            self._order_to(task)
        else:
            self._become_free(self._mission_view.mission_s(now_s), adrift=self._free.adrift)
            self._say_idle()

    def end(self, now_s: float, *, handed_over: bool) -> None:
        """The UAV takes no tasks any more, perhaps because somebody else has its vehicle."""
        self._withdraw(ClaimPhase.OUT, now_s, handed_over=handed_over)

    def pause(self, now_s: float) -> None:
        """The UAV gives its task up, and takes none before it `begin`s anew."""
        task = self._task()
        self._withdraw(ClaimPhase.PAUSED, now_s, handed_over=False)
        self._free.adrift = True  # where it is held is somewhere on its way
        if task is not None:
            self._note("released", task.task, reason="the UAV is held")

    def wake(self, now_s: float) -> None:
        """Decide anew when free; who found nothing before takes no precedence from that."""
        self._free.retry_at_s = None
        if self._machine.state in FREE and not self._free.to_decide:
            self._free.to_decide = True
            if self._mission_view.running:
                self._free.since_s = self._mission_view.mission_s(now_s)

    def consider_diversion(self, task: str) -> None:
        """It has appeared, or was a lost UAV's: it may be worth turning to in flight.

        Told once for each, so no plan and nobody's change of mind can keep a UAV from arriving.
        """
        self._opened.add(task)

    def peer_claimed(self, now_s: float) -> None:
        """Somebody has said what it claims; it may be whom this UAV waits for."""
        if self._free.awaits_peers:
            self.wake(now_s)

    def arrive(self, leg: int, now_s: float) -> None:
        """The vehicle is where that leg ends."""
        task = self._task()
        if leg != self._flights.leg or task is None or not self._machine.take(Trigger.ARRIVED):
            return
        self._mission_view.arrive(task.position_enu_m)
        self._attempt.served_at_s = now_s + task.service_s

    def fail(self, leg: int) -> None:
        """The attempt at the task of that leg fails; its service takes its time all the same."""
        self._attempt.fails |= leg == self._flights.leg and self._task() is not None

    def refuse(self, leg: int, reason: str, now_s: float, *, passes: bool = False) -> None:
        """The vehicle will not fly that leg: leave its task alone for a while.

        A short one where another UAV is in the way and goes on (``passes``).
        """
        task = self._task()
        current = leg == self._flights.leg and task is not None
        if current and task is not None and self._machine.allows(Trigger.CLAIM_LOST):
            self._refused.add(task.task, now_s, passes=passes)
            self._release(f"vehicle refused: {reason}", now_s)

    def advance(self, now_s: float, *, informed: bool) -> None:
        """What follows from the registers and the time, in a running mission.

        A decision may rest on the registers only while this UAV is ``informed``.
        """
        self._serve(now_s)
        self._keep_or_lose_claim(now_s)
        if self._free.retry_at_s is not None and self._free.retry_at_s <= now_s:
            self.wake(now_s)
        ready = informed and self._machine.state in TAKES_TARGETS
        if self._opened and ready:
            self._divert(now_s)
        if self._machine.state in FREE and self._free.to_decide:
            if not ready:
                self._give_up_claim()
                self._stop_straying()
            elif self._flights.problem is None:
                self._decide(now_s)
            else:
                self._decide_in_field(now_s)

    @property
    def is_contested(self) -> bool:
        """Whether what others claim matters at once: it has no task, or one that is new."""
        claim = self.claim
        return claim is not None and claim.phase is not ClaimPhase.HELD and not self.awaits_way

    @property
    def awaits_way(self) -> bool:
        """Whether nobody has objected to its claim in time, and it waits for its way alone."""
        return self._attempt.awaits_way

    def next_deadline_s(self) -> float | None:
        """When `advance` will next have something to do."""
        return earliest(self._attempt.next_deadline_s(), self._free.retry_at_s)

    # -- with a task ----------------------------------------------------------------

    def _serve(self, now_s: float) -> None:
        served_at_s, task = self._attempt.served_at_s, self._task()
        if served_at_s is None or served_at_s > now_s or task is None:
            return
        ended_s = self._mission_view.mission_s(served_at_s)  # before it hung, perhaps
        result = AttemptResult.FAILED if self._attempt.fails else AttemptResult.DONE
        way = None if self.claim is None else self.claim.reversed
        outcome = Outcome(task.task, result, self._attempt_at(task.task), ended_s, way)
        # The next claim, made in this same step, replaces the old one on the bus.
        self._machine.take(Trigger.SERVED)
        self._become_free(self._mission_view.mission_s(now_s))
        self._say(outcome)
        self._note(f"task {result}", task.task, mission_s=ended_s)

    def _keep_or_lose_claim(self, now_s: float) -> None:
        claim, attempt, waits = self.claim, self._attempt, self._airway.waits
        if claim is None or claim.task is None or self._machine.state in FREE:
            return
        if (lost := self._lost()) is not None:
            self._release(lost, now_s)
        elif attempt.ready_by_s is not None and attempt.ready_by_s <= now_s:
            self._release("the vehicle is not ready", now_s)
        elif attempt.held_at_s is not None and attempt.held_at_s <= now_s:
            # While it waits for its way, for seconds at most: with its departure it is one word.
            attempt.held_at_s = now_s + self._timing.objection_window_s if waits else None
            attempt.awaits_way = waits
            if not waits:
                self._say(replace(claim, phase=ClaimPhase.HELD))

    def _divert(self, now_s: float) -> None:
        """Leave the task for a better one, unless somebody free is about to take that."""
        opened, self._opened = self._opened, set()
        claim, epoch = self.claim, self._replica.epoch
        if claim is None or epoch is None or self._machine.state is not AgentState.FLYING:
            return
        if self._flights.problem is not None:
            self._divert_in_field(now_s)
            return
        rule = self._rule_of(epoch)
        if not isinstance(rule, GuidedRule):
            return  # no other one values the whole team
        if not any(map(self._is_within_reach, opened)):
            return
        problem = self._mission_view.board.problem
        turn = self._turn(self._mission_view.mission_s(now_s), now_s)
        if problem is None or turn is None or turn.awaited:
            return
        decision = decide_diversion(problem, self._mission_view.board, rule, turn, claim)
        if decision is not None:
            self._become_free(turn.now_s)
            chosen = (RecordingRule(rule, decision.uav), decision)
            self._set_off(turn, problem, epoch, *chosen, now_s, left=claim.task)

    def _is_within_reach(self, task: str) -> bool:
        """Whether ``task`` is among those that pay best from here, or few are open."""
        board, me = self._mission_view.board, self._mission_view.me
        place = self._mission_view.place_enu_m
        if len(board.open) <= _MANY_TASKS or place is None or me is None:
            return True
        if task not in board.states:
            return False
        return self._open_tasks.n_better(task, place, me.speed_m_s) < _REACH_TASKS

    def _lost(self) -> str | None:
        """Why the claimed task is not this UAV's to do; None if it is."""
        task = self._task()
        state = None if task is None else self._mission_view.board.states.get(task.task)
        if task is None or state is not TaskState.OPEN:
            return f"task is {state or 'unknown'}"
        rival = self._peers.winner(self._replica, task.task)
        return None if rival == self._uav else f"{rival} has the stronger claim"

    def _release(self, reason: str, now_s: float) -> None:
        """Give the task up; a claim lost while only proposed keeps its place in the order."""
        claim = self.claim
        if claim is None:
            return
        self._machine.take(Trigger.CLAIM_LOST)
        proposed = claim.phase is ClaimPhase.PROPOSED
        since_s = claim.decided_s if proposed else self._mission_view.mission_s(now_s)
        self._become_free(since_s, adrift=True)
        self._note("released", str(claim.task), reason=reason)

    def _become_free(self, since_s: float, *, adrift: bool = False) -> None:
        self._free, self._attempt = FreePeriod(since_s, adrift), TaskAttempt()

    # -- without one ----------------------------------------------------------------

    def _decide(self, now_s: float) -> None:
        epoch, board, since_s = self._replica.epoch, self._mission_view.board, self._free.since_s
        problem = board.problem
        if epoch is None or problem is None:
            return
        rule, excluded = self._rule_of(epoch), self._refused.left_alone(now_s)
        if rule is None:
            self._stay_idle(now_s)
            return
        if nothing_left(board, since_s, excluded, self._peers.counts):
            self._stay_idle(now_s, awaits_peers=False)
            return
        turn = self._turn(since_s, now_s)
        if turn is None:
            return
        recording_rule = RecordingRule(rule, problem.uav_ids.index(self._uav))
        decision = decide(problem, board, recording_rule, turn)
        if decision is None:
            self._stay_idle(now_s)
        else:
            self._set_off(turn, problem, epoch, recording_rule, decision, now_s)

    def _turn(self, free_since_s: float, now_s: float) -> DecisionTurn | None:
        """The turn of this UAV, free since then; None as long as too little is known."""
        place, problem = self._mission_view.place_enu_m, self._mission_view.board.problem
        if place is None or problem is None or self._uav not in problem.row_of:
            return None
        return DecisionTurn(
            uav=self._uav,
            now_s=self._mission_view.mission_s(now_s),
            decided_s=free_since_s,
            place_enu_m=place,
            credible=self._peers.credible,
            awaited=self._peers.awaited(self._replica, now_s),
            patience_s=self._timing.patience_s,
            excluded=self._refused.left_alone(now_s).keys(),
            flown_m=self._mission_view.flown_m,
        )

    def _rule_of(self, epoch: PlanEpoch) -> Rule | None:
        """The rule in force; None, and told once, if it is not known."""
        basis = epoch.rule, epoch.routes  # numbers are no proof: two coordinators may count alike
        if self._rule_basis != basis:
            self._rule, self._rule_basis = self._make_rule(*basis), basis
            if self._rule is None:
                self._announcer.explain(f"cannot decide by rule {epoch.rule}")
                self._log("unknown rule", rule=epoch.rule)
        return self._rule

    def _set_off(
        self,
        turn: DecisionTurn,
        problem: Problem,
        epoch: PlanEpoch,
        recording_rule: RecordingRule,
        decision: Decision,
        now_s: float,
        left: str | None = None,
    ) -> None:
        task = self._replica.board[problem.task_ids[decision.task]]
        rank = ranks(epoch.sequence, problem.uav_ids)[self._uav]
        self._begin_attempt(now_s, left)
        claim = Claim(
            ClaimPhase.PROPOSED, task.task, self._free.since_s, rank, decision.completion_s
        )
        told = self._choices.made(turn, problem, epoch, recording_rule, decision, claim, left)
        if left is not None:
            self._note_turn(left, task.task)
        self._order_to(task, idled=self._free.found_nothing)
        self._say(claim)
        self._note(
            "decided",
            task.task,
            score=decision.score,
            second_score=decision.second_score,
            certificate=decision.certificate,
            completion_s=decision.completion_s,
        )
        self._actions.append(told)

    def _begin_attempt(self, now_s: float, left: str | None) -> None:
        """It has decided on a task, instead of the one that it ``left``."""
        self._machine.take(Trigger.DECIDED if left is None else Trigger.DIVERTED)
        self._free.retry_at_s, self._free.adrift = None, False
        self._opened.clear()
        self._attempt = TaskAttempt(held_at_s=now_s + self._timing.objection_window_s)

    def _note_turn(self, left: str, task: str) -> None:
        """Log that it leaves one task for another."""
        turns: dict[str, object] = {"task": left, "for": task}
        self._log("turns aside", **turns, **self._choices.label)

    def _stay_idle(self, now_s: float, *, awaits_peers: bool = True) -> None:
        """Nothing is there for it, as long as nothing opens or, if it awaits them, peers decide."""
        self._give_up_claim()
        free = self._free
        if free.adrift:
            # Nothing to fly to any more: stop here rather than at a lost target.
            self._flights.stop()
        free.adrift, free.to_decide, free.found_nothing = False, False, True
        patience_ends_s = None
        if awaits_peers:
            patience_ends_s = self._peers.patience_ends_s(self._replica, now_s)
        free.awaits_peers = patience_ends_s is not None
        free.retry_at_s = patience_ends_s
        if patience_ends_s is None and self._mission_view.unfinished:
            # By and by, lest a lost message strand a task; or when a refused one may be taken.
            until_s = self._refused.left_alone(now_s).values()
            free.retry_at_s = min([now_s + self._timing.announce_s, *until_s])

    def _stop_straying(self) -> None:
        """Hover, out of any zone: it knows too little to decide anything better yet."""
        if self._free.strays:
            self._free.strays = self._free.adrift = False
            self._flights.stop()

    def _give_up_claim(self) -> None:
        """Say that the UAV is free, unless it has."""
        if self.claim is not None and self.claim.phase is not ClaimPhase.IDLE:
            self._say_idle()

    # -- pieces ---------------------------------------------------------------------

    def _note(self, text: str, task: str, **fields: object) -> None:
        """Log a line about a task this UAV claims, and the choice it came of in this life."""
        self._log(text, task=task, **fields, **self._choices.label)

    def _withdraw(self, phase: ClaimPhase, now_s: float, *, handed_over: bool) -> None:
        mission_s = self._mission_view.mission_s(now_s)
        self._become_free(mission_s)
        self._say(self._situated(Claim(phase, None, mission_s, 0, mission_s, handed_over)))

    def _task(self) -> TaskEntry | None:
        claim = self.claim
        return None if claim is None or claim.task is None else self._replica.board.get(claim.task)

    def _attempt_at(self, task: str) -> int:
        """How many times this UAV will have tried that task after its next attempt."""
        earlier = self._replica.outcomes.get((self._uav, task))
        return 1 if earlier is None else earlier.attempt + 1

    def _order_to(self, task: TaskEntry, *, idled: bool = False) -> None:
        self._flights.to_task(task, self._attempt_at(task.task), idled=idled)

    def _say_idle(self) -> None:
        since_s = self._free.since_s
        self._say(self._situated(Claim(ClaimPhase.IDLE, None, since_s, 0, since_s)))

    # -- where constraints ask for more: nothing of it in a plain mission -----------------

    @abstractmethod
    def _decide_in_field(self, now_s: float) -> None:
        """Decide under constraints, being free."""

    @abstractmethod
    def _divert_in_field(self, now_s: float) -> None:
        """Leave the task for a better one under constraints."""

    @abstractmethod
    def _situated(self, claim: Claim) -> Claim:
        """``claim`` with where the UAV stands, and until when it can stay in the air."""
