"""The tasks of one airborne UAV, one after the other: from the decision to the outcome.

Decides whenever the UAV is free, claims and flies at once, turns to something better that opens on
the way, gives way to stronger claims and waits idle while there is nothing for it. Leaves out:
which task is best (agent.core.decision), getting airborne and going home (agent.core.agent_core).
"""

from __future__ import annotations

from dataclasses import replace

from agent.core.announcer import Announcer
from agent.core.decision import (
    ChoiceReporter,
    DecisionTurn,
    RecordingRule,
    decide,
    decide_diversion,
)
from agent.core.interface import Action, GoTo, OrderVehicle
from agent.core.mission_view import MissionView, Peers
from swarm.allocation.lower_level import Decision, Rule
from swarm.allocation.problem import Problem
from swarm.allocation.rules import GuidedRule
from swarm.protocol.board import TaskState, ranks, rule_of
from swarm.protocol.events import LogLine
from swarm.protocol.messages import PlanEpoch, TaskEntry
from swarm.protocol.registers import Replica
from swarm.protocol.timing import Timing, earliest
from swarm.protocol.uav_messages import AttemptResult, Claim, ClaimPhase, Outcome, StatusPhase

__all__ = ["Tasking"]


class Tasking:
    """What one UAV does about tasks, and its claim.

    Args:
        uav: id of the UAV.
        replica: the shared registers.
        mission_view: the mission.
        peers: the others.
        announcer: says what this UAV claims and has done.
        timing: timers.
    """

    def __init__(
        self,
        uav: str,
        replica: Replica,
        mission_view: MissionView,
        peers: Peers,
        announcer: Announcer,
        timing: Timing,
    ) -> None:
        self.phase: StatusPhase | None = None
        """Idle, flying or serving; None while the UAV takes no tasks."""
        self.airborne = False
        """Whether the vehicle takes targets."""
        self._uav = uav
        self._replica = replica
        self._mission_view = mission_view
        self._peers = peers
        self._announcer = announcer
        self._timing = timing
        self._choices = ChoiceReporter(uav, replica, announcer)
        self._rule: Rule | None = None
        self._rule_basis: object = None
        self._free_since_s = 0.0
        self._leg = 0
        self._refusals: dict[str, tuple[int, float]] = {}
        """How often the vehicle refused a task, and until when it is left alone."""
        self._adrift = False
        self._diversion_due = False
        self._to_decide = False
        self._idled = False
        self._awaits_peers = False
        self._held_at_s: float | None = None
        self._served_at_s: float | None = None
        self._fails = False
        """Whether the attempt at the claimed task is known to fail."""
        self._retry_at_s: float | None = None
        self._ready_by_s: float | None = None

    # -- from without ---------------------------------------------------------------

    @property
    def claim(self) -> Claim | None:
        """The UAV's claim register; None while it takes no tasks."""
        return None if self.phase is None else self._replica.claims.get(self._uav)

    @property
    def undecided(self) -> bool:
        """Whether, being idle, it may yet find a task."""
        return self._to_decide or self._awaits_peers

    def leaves_refused(self, now_s: float) -> bool:
        """Whether, being idle, it leaves an open task alone that its vehicle has refused."""
        return self.phase is StatusPhase.IDLE and any(
            now_s < until_s and self._mission_view.is_open(task)
            for task, (_, until_s) in self._refusals.items()
        )

    def label(self, leg: int) -> dict[str, object]:
        """For the log: which choice that leg came of, if it is the one being flown."""
        return self._choices.label if leg == self._leg and self._task() is not None else {}

    def resume(self, claim: Claim, now_s: float) -> list[Action]:
        """An earlier life of this agent claimed so: stand by it, if it still counts.

        The vehicle may fly there, but takes no targets before `begin`.
        """
        if claim.task is None:
            return []
        self.phase = StatusPhase.FLYING
        if (lost := self._lost()) is not None:
            return self._release(lost, now_s)
        if claim.phase is ClaimPhase.PROPOSED:
            self._held_at_s = now_s + self._timing.objection_window_s
        # Others keep away from the task only for a vehicle that shows itself.
        self._ready_by_s = now_s + self._timing.silence_s
        return [self._announcer.say(claim), LogLine("resumes", {"task": claim.task})]

    def begin(self, now_s: float) -> list[Action]:
        """The vehicle takes targets: fly to the resumed task, or be free."""
        self.airborne, self._ready_by_s = True, None
        task = self._task()
        if task is not None:
            return [self._order_to(task)]
        self._become_free(self._mission_view.mission_s(now_s))
        return [self._say_idle()]

    def end(self, now_s: float, *, handed_over: bool) -> list[Action]:
        """The UAV takes no tasks any more.

        Args:
            now_s: now.
            handed_over: because somebody else has its vehicle.
        """
        return [self._withdraw(ClaimPhase.OUT, now_s, handed_over=handed_over)]

    def pause(self, now_s: float) -> list[Action]:
        """The UAV gives its task up, and takes none before it `begin`s anew."""
        task = self._task()
        said = self._withdraw(ClaimPhase.PAUSED, now_s, handed_over=False)
        if task is None:
            return [said]
        return [said, self._note("released", task.task, reason="the operator holds the UAV")]

    def wake(self, now_s: float) -> None:
        """Decide anew when free; who found nothing before takes no precedence from that."""
        self._retry_at_s = None
        if self.phase is StatusPhase.IDLE and not self._to_decide:
            self._to_decide = True
            if self._mission_view.running:
                self._free_since_s = self._mission_view.mission_s(now_s)

    def consider_diversion(self) -> None:
        """A task has appeared, or a lost UAV's has opened: it may be worth turning to in flight.

        Told once for each, so no plan and nobody's change of mind can keep a UAV from arriving.
        """
        self._diversion_due = True

    def peer_claimed(self, now_s: float) -> None:
        """Somebody has said what it claims; it may be whom this UAV waits for."""
        if self._awaits_peers:
            self.wake(now_s)

    def arrive(self, leg: int, now_s: float) -> None:
        """The vehicle is where that leg ends."""
        task = self._task()
        if leg != self._leg or task is None or self.phase is not StatusPhase.FLYING:
            return
        self.phase = StatusPhase.SERVING
        self._mission_view.place_enu_m = task.position_enu_m
        self._served_at_s = now_s + task.service_s

    def fail(self, leg: int) -> None:
        """The attempt at the task of that leg fails; its service takes its time all the same."""
        self._fails |= leg == self._leg and self._task() is not None

    def refuse(self, leg: int, reason: str, now_s: float) -> list[Action]:
        """The vehicle will not fly that leg: leave its task alone for a while."""
        task = self._task()
        if leg != self._leg or task is None:
            return []
        times = 1 + self._refusals.get(task.task, (0, 0.0))[0]
        # Each time for longer, so that a fleet may find that nobody takes what is left.
        pause_s = self._timing.reconsider_s * 2.0 ** (times - 1)
        self._refusals[task.task] = times, now_s + pause_s
        return self._release(f"vehicle refused: {reason}", now_s)

    def advance(self, now_s: float, *, informed: bool) -> list[Action]:
        """What follows from the registers and the time, in a running mission.

        Args:
            now_s: now.
            informed: whether the registers are up to date, so that a decision may rest on them.
        """
        actions = self._serve(now_s) + self._keep_or_lose_claim(now_s)
        if self._retry_at_s is not None and self._retry_at_s <= now_s:
            self.wake(now_s)
        if self._diversion_due and informed and self.airborne:
            actions += self._divert(now_s)
        if self.phase is StatusPhase.IDLE and self._to_decide:
            ready = informed and self.airborne
            actions += self._decide(now_s) if ready else self._give_up_claim()
        return actions

    def next_deadline_s(self) -> float | None:
        """When `advance` will next have something to do."""
        return earliest(self._held_at_s, self._served_at_s, self._retry_at_s, self._ready_by_s)

    # -- with a task ----------------------------------------------------------------

    def _serve(self, now_s: float) -> list[Action]:
        if self._served_at_s is None or self._served_at_s > now_s:
            return []
        task = self._task()
        if task is None:
            return []
        self._served_at_s = None
        mission_s = self._mission_view.mission_s(now_s)
        result = AttemptResult.FAILED if self._fails else AttemptResult.DONE
        outcome = Outcome(task.task, result, self._attempt_at(task.task), mission_s)
        # The next claim, made in this same step, replaces the old one on the bus.
        self._become_free(mission_s)
        return [
            self._announcer.say(outcome),
            self._note(f"task {result}", task.task, mission_s=mission_s),
        ]

    def _keep_or_lose_claim(self, now_s: float) -> list[Action]:
        claim = self.claim
        if claim is None or claim.task is None or self.phase is StatusPhase.IDLE:
            return []
        if (lost := self._lost()) is not None:
            return self._release(lost, now_s)
        if self._ready_by_s is not None and self._ready_by_s <= now_s:
            return self._release("the vehicle is not ready", now_s)
        if self._held_at_s is not None and self._held_at_s <= now_s:
            self._held_at_s = None
            return [self._announcer.say(replace(claim, phase=ClaimPhase.HELD))]
        return []

    def _divert(self, now_s: float) -> list[Action]:
        """Leave the task for a better one, unless somebody free is about to take that."""
        self._diversion_due = False
        claim, epoch = self.claim, self._replica.epoch
        if claim is None or epoch is None or self.phase is not StatusPhase.FLYING:
            return []
        rule, actions = self._rule_of(epoch)
        if not isinstance(rule, GuidedRule):
            return actions  # no other one values the whole team
        problem = self._mission_view.board.problem
        turn = self._turn(self._mission_view.mission_s(now_s), now_s)
        if problem is None or turn is None or turn.awaited:
            return actions
        decision = decide_diversion(problem, self._mission_view.board, rule, turn, claim)
        if decision is None:
            return actions
        self._become_free(turn.now_s)
        return actions + self._set_off(
            turn,
            problem,
            epoch,
            RecordingRule(rule, decision.uav),
            decision,
            now_s,
            left=claim.task,
        )

    def _lost(self) -> str | None:
        """Why the claimed task is not this UAV's to do; None if it is."""
        task = self._task()
        state = None if task is None else self._mission_view.board.states.get(task.task)
        if task is None or state is not TaskState.OPEN:
            return f"task is {state or 'unknown'}"
        rival = self._peers.winner(self._replica, task.task)
        return None if rival == self._uav else f"{rival} has the stronger claim"

    def _release(self, reason: str, now_s: float) -> list[Action]:
        """Give the task up; a claim lost while only proposed keeps its place in the order."""
        claim = self.claim
        if claim is None:
            return []
        proposed = claim.phase is ClaimPhase.PROPOSED
        self._become_free(claim.decided_s if proposed else self._mission_view.mission_s(now_s))
        self._adrift = True
        return [self._note("released", str(claim.task), reason=reason)]

    def _become_free(self, free_since_s: float) -> None:
        self.phase, self._to_decide, self._idled = StatusPhase.IDLE, True, False
        self._fails = False
        self._free_since_s = free_since_s
        self._held_at_s = self._served_at_s = self._retry_at_s = self._ready_by_s = None

    # -- without one ----------------------------------------------------------------

    def _decide(self, now_s: float) -> list[Action]:
        epoch, problem = self._replica.epoch, self._mission_view.board.problem
        turn = self._turn(self._free_since_s, now_s)
        if epoch is None or problem is None or turn is None:
            return []
        rule, actions = self._rule_of(epoch)
        if rule is None:
            return actions + self._stay_idle(now_s)
        recording_rule = RecordingRule(rule, problem.uav_ids.index(self._uav))
        decision = decide(problem, self._mission_view.board, recording_rule, turn)
        if decision is None:
            return self._stay_idle(now_s)
        return self._set_off(turn, problem, epoch, recording_rule, decision, now_s)

    def _turn(self, free_since_s: float, now_s: float) -> DecisionTurn | None:
        """The turn of this UAV, free since then; None as long as too little is known."""
        place, problem = self._mission_view.place_enu_m, self._mission_view.board.problem
        if place is None or problem is None or self._uav not in problem.uav_ids:
            return None
        return DecisionTurn(
            uav=self._uav,
            now_s=self._mission_view.mission_s(now_s),
            decided_s=free_since_s,
            place_enu_m=place,
            credible=self._peers.credible,
            awaited=self._peers.awaited(self._replica, now_s),
            patience_s=self._timing.patience_s,
            excluded={t for t, (_, until_s) in self._refusals.items() if now_s < until_s},
        )

    def _rule_of(self, epoch: PlanEpoch) -> tuple[Rule | None, list[Action]]:
        """The rule in force, and what to say about it when it is new."""
        basis = epoch.rule, epoch.routes  # numbers are no proof: two coordinators may count alike
        if self._rule_basis == basis:
            return self._rule, []
        self._rule, self._rule_basis = rule_of(*basis), basis
        if self._rule is not None:
            return self._rule, []
        self._announcer.note = f"cannot decide by rule {epoch.rule}"
        return None, [LogLine("unknown rule", {"rule": epoch.rule})]

    def _set_off(
        self,
        turn: DecisionTurn,
        problem: Problem,
        epoch: PlanEpoch,
        recording_rule: RecordingRule,
        decision: Decision,
        now_s: float,
        left: str | None = None,
    ) -> list[Action]:
        task = self._replica.board[problem.task_ids[decision.task]]
        rank = ranks(epoch.sequence, problem.uav_ids)[self._uav]
        self.phase = StatusPhase.FLYING
        self._retry_at_s, self._adrift, self._diversion_due = None, False, False
        self._held_at_s = now_s + self._timing.objection_window_s
        claim = Claim(
            ClaimPhase.PROPOSED, task.task, self._free_since_s, rank, decision.completion_s
        )
        told = self._choices.made(turn, problem, epoch, recording_rule, decision, claim, left)
        turns: dict[str, object] = {"task": left, "for": task.task, **self._choices.label}
        decided = self._note(
            "decided",
            task.task,
            score=decision.score,
            second_score=decision.second_score,
            certificate=decision.certificate,
            completion_s=decision.completion_s,
        )
        order = self._order_to(task, idled=self._idled)
        actions = [order, self._announcer.say(claim), decided, told]
        return actions if left is None else [LogLine("turns aside", turns), *actions]

    def _stay_idle(self, now_s: float) -> list[Action]:
        actions, telemetry = self._give_up_claim(), self._mission_view.telemetry
        if self._adrift and telemetry is not None:
            # Nothing to fly to any more: stop here rather than at a lost target.
            self._leg += 1
            actions.append(OrderVehicle(GoTo(self._leg, telemetry.position_enu_m)))
        self._adrift = self._to_decide = False
        self._idled = True
        patience_ends_s = self._peers.patience_ends_s(self._replica, now_s)
        self._awaits_peers = patience_ends_s is not None
        again_s = self._look_again_s(now_s) if self._mission_view.unfinished else None
        self._retry_at_s = patience_ends_s if patience_ends_s is not None else again_s
        return actions

    def _look_again_s(self, now_s: float) -> float:
        """By and by, lest a lost message strand a task; or when a refused one may be taken."""
        paused_s = (until_s for _, until_s in self._refusals.values() if until_s > now_s)
        return min([now_s + self._timing.announce_s, *paused_s])

    def _give_up_claim(self) -> list[Action]:
        """Say that the UAV is free, unless it has."""
        claim = self.claim
        return [] if claim is None or claim.phase is ClaimPhase.IDLE else [self._say_idle()]

    # -- pieces ---------------------------------------------------------------------

    def _note(self, text: str, task: str, **fields: object) -> LogLine:
        """A line about a task this UAV claims, and the choice it came of in this life."""
        return LogLine(text, {"task": task, **fields, **self._choices.label})

    def _withdraw(self, phase: ClaimPhase, now_s: float, *, handed_over: bool) -> Action:
        mission_s = self._mission_view.mission_s(now_s)
        self._become_free(mission_s)
        self.phase, self.airborne = None, False
        return self._announcer.say(Claim(phase, None, mission_s, 0, mission_s, handed_over))

    def _task(self) -> TaskEntry | None:
        claim = self.claim
        return None if claim is None or claim.task is None else self._replica.board.get(claim.task)

    def _attempt_at(self, task: str) -> int:
        """How many times this UAV will have tried that task after its next attempt."""
        earlier = self._replica.outcomes.get((self._uav, task))
        return 1 if earlier is None else earlier.attempt + 1

    def _order_to(self, task: TaskEntry, *, idled: bool = False) -> Action:
        self._leg += 1
        place_enu_m = self._mission_view.in_layer(task.position_enu_m)
        attempt = self._attempt_at(task.task)
        return OrderVehicle(GoTo(self._leg, place_enu_m, task.service_s, idled, task.task, attempt))

    def _say_idle(self) -> Action:
        since_s = self._free_since_s
        return self._announcer.say(Claim(ClaimPhase.IDLE, None, since_s, 0, since_s))
