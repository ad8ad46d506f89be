"""The tasks of one UAV where energy, bases, windows, lines and zones constrain them.

What `agent.core.tasking` does in a plain mission stays as it is; here is what is added: it decides
under the constraints, flies round zones, waits for a window, flies lines, gives up what can't be
done in time any more, visits bases, and heads home before its battery is used up.
"""

from __future__ import annotations

import math
from dataclasses import replace
from typing import TYPE_CHECKING

from agent.core.base_visits import BaseVisits
from agent.core.context import AgentContext
from agent.core.decision import DecisionTurn, RefusedTasks
from agent.core.energy import TOLERANCE_S
from agent.core.flights import HomeFlight
from agent.core.havens import Haven, Havens
from agent.core.states import AT_BASE, PAUSED_BY_OPERATOR, VISITS_BASE, AgentState, Trigger
from agent.core.tasking import Tasking
from agent.core.time_limits import WITHOUT_AIM, TimeLimits
from swarm.allocation import field
from swarm.protocol.board import RuleMaker, ranks, rule_of
from swarm.protocol.messages import PlanEpoch, TaskEntry
from swarm.protocol.timing import earliest
from swarm.protocol.uav_messages import BaseStage, Claim, ClaimPhase

if TYPE_CHECKING:
    from agent.core.field_decision import FieldRule, FieldTurnDecision


class FieldTasking(Tasking):
    """What one UAV does about tasks and bases, and its claim."""

    def __init__(self, context: AgentContext, make_rule: RuleMaker = rule_of) -> None:
        super().__init__(context, make_rule)
        self._sortie = self._flights.meter.sortie
        context.airway.when_departed = self._depart_late
        self.visits = BaseVisits(context, self._flights, self._sortie, self._visit_over)
        """What it does at bases, and is told of them."""
        self._limits = TimeLimits(context, self._flights, self._sortie)
        self._refused_bases = RefusedTasks(context.timing.reconsider_s)
        known = self._flights, self._sortie, self.visits
        self._havens = Havens(context, *known, self._refused_bases)
        self._drained = False
        """Whether the battery was found to last otherwise, and nothing has followed yet."""
        self._home_at_s: float | None = None
        """When it has to fly home, if it finds nothing to do until then."""

    def _depart_late(self) -> None:
        self._flights.meter.depart_late()
        self._drained = True

    # -- from without ------------------------------------------------------------------

    def begin(self, now_s: float) -> None:
        """The vehicle takes targets: as in a plain mission, or on to an earlier life's base."""
        self._flights.meter.begin(now_s)
        me, claim = self._mission_view.me, self._replica.claims.get(self._uav)
        self.visits.leave_ground()
        if me is not None:
            self._sortie.begin(me, self._mission_view.mission_s(now_s))
        visits = claim is not None and claim.stage in (BaseStage.APPROACHING, BaseStage.WAITING)
        if not (visits and self._machine.state is AgentState.PREPARING and self._in_field):
            super().begin(now_s)
            return
        self._machine.take(Trigger.VEHICLE_READY)
        self._become_free(self._mission_view.mission_s(now_s))
        if claim is None or not self.visits.resume(claim, now_s):
            self._say_idle()

    def recall(self, claim: Claim) -> None:
        """An earlier life of this agent claimed so: what it says of the battery."""
        self._sortie.recall(claim.sortie_end_s, self._flights.meter.rates.drain_frac)

    def stand(self, now_s: float, *, found: bool = False) -> bool:
        """Whether it stands at a base, by its last claim or as it was found: stay there."""
        return self._flights.problem is not None and self.visits.stand(now_s, found=found)

    def zones_changed(self) -> bool:
        """Whether other zones are in force than when this was last asked."""
        return self._flights.zones_changed()

    def way_home(self) -> HomeFlight | None:
        """From where the UAV is to the nearest base or its own start; None in a plain mission."""
        name = self.visits.stands_at
        base = None if name is None else self._flights.base(name)
        if base is None:
            return self._flights.way_home()
        above_enu_m = self._mission_view.in_layer(self._flights.spot(base))
        return HomeFlight((), above_enu_m, base.id, 0.0)

    def arrive(self, leg: int, now_s: float) -> None:
        """The vehicle is where that leg ends."""
        self._drained |= self._flights.meter.arrive(leg, now_s)
        problem, state = self._flights.problem, self._machine.state
        if problem is None:
            super().arrive(leg, now_s)
            return
        if leg != self._flights.leg:
            return
        self.visits.flown()
        task = self._task()
        if state is AgentState.FLYING_TO_BASE:
            self.visits.arrive(now_s)
        elif state is AgentState.SERVING and task is not None:
            self._end_line(task, now_s)
        elif task is not None and self._machine.take(Trigger.ARRIVED):
            self._await_opening(task, now_s)

    def refuse(self, leg: int, reason: str, now_s: float, *, passes: bool = False) -> None:
        """The vehicle will not fly that leg, or not land: leave its aim alone for a while."""
        if leg != self._flights.leg:
            return
        claim, base = self.claim, self.visits.flown()
        visits = self._machine.state in VISITS_BASE
        if visits and claim is not None and claim.base is not None:
            self._refused_bases.add(claim.base, now_s)
        if base is not None:
            if claim is not None and claim.task is not None:
                self._refused.add(claim.task, now_s, passes=passes)
            self.visits.stay(base, now_s)
        elif visits:
            self.visits.break_off(f"vehicle refused: {reason}", now_s)
        else:
            super().refuse(leg, reason, now_s, passes=passes)

    def leaves_refused(self, now_s: float) -> bool:
        """Whether, being idle, it leaves a task or base alone that its vehicle has refused."""
        return super().leaves_refused(now_s) or bool(self._refused_bases.left_alone(now_s))

    def measure(self, now_s: float) -> bool:
        """The vehicle has told its charge: whether anything may follow from that."""
        if self._flights.problem is None or self._machine.state in AT_BASE:
            return False
        self._drained |= self._flights.meter.measure(now_s)
        return self._drained

    def advance_in_field(self, now_s: float) -> None:
        """What follows from constraints and the time, in a running mission, before `advance`."""
        if self._in_field:
            self.visits.advance(now_s)
            if (haven := self._havens.instead_of_waiting(now_s)) is not None:
                self.visits.break_off("another base is ready earlier", now_s)
                self._visit_base(haven, now_s)
            self._depart_if_due(now_s)
            self._begin_if_due(now_s)
            if self._airway.waits_on_ground:  # nothing of its battery is used up yet
                self._depart_late()
            if self._drained:
                self._drain(now_s)
            self._give_up_what_is_late(now_s)

    def next_deadline_s(self) -> float | None:
        """When `advance` or `spent` will next have something to do."""
        waits = self._machine.state in WITHOUT_AIM | {AgentState.ABOVE_BASE}
        home_at_s = self._home_at_s if waits else None
        return earliest(super().next_deadline_s(), home_at_s, self.visits.next_deadline_s())

    # -- deciding ------------------------------------------------------------------------

    def _decide_in_field(self, now_s: float) -> None:
        problem, epoch = self._flights.problem, self._replica.epoch
        turn = self._field_turn(self._free.since_s, now_s)
        if problem is None or epoch is None or turn is None:
            return
        rule = self._field_rule(epoch)
        decision = None if rule is None else rule.decide(problem, self._mission_view.board, turn)
        if decision is None or decision.base in self._refused_bases.left_alone(now_s):
            self._stay_idle(now_s)
        elif decision.task is not None:
            self._take_task(epoch, turn, decision, now_s)
        elif decision.base is not None:
            haven = self._havens.reach(decision.base, now_s)
            if haven is None:
                self._stay_idle(now_s)
            else:
                told = self._choices.made_in_field(turn, epoch, decision, self._rank)
                arrives_s, ready_s = decision.arrive_s, decision.end_s
                self._visit_base(replace(haven, arrives_s=arrives_s, ready_s=ready_s), now_s)
                self._actions.append(told)

    def _divert_in_field(self, now_s: float) -> None:
        problem, epoch, claim = self._flights.problem, self._replica.epoch, self.claim
        turn = self._field_turn(self._mission_view.mission_s(now_s), now_s)
        if problem is None or epoch is None or claim is None or turn is None:
            return
        rule = self._field_rule(epoch)
        if rule is None or turn.awaited:
            return
        decision = rule.divert(problem, self._mission_view.board, turn)
        if decision is not None and decision.task is not None:
            self._become_free(turn.now_s)
            self._take_task(epoch, turn, decision, now_s, left=claim.task)

    def _field_turn(self, free_since_s: float, now_s: float) -> DecisionTurn | None:
        turn = self._turn(free_since_s, now_s)
        if turn is None:
            return None
        return replace(
            turn,
            sortie_end_s=self._sortie.end_s,
            landed_at=self.visits.stands_at,
            parked=self.visits.stands_at is not None and self.visits.is_parked,
            blocking=self.visits.blocking(),
        )

    def _field_rule(self, epoch: PlanEpoch) -> FieldRule | None:
        """The rule in force; None, and told once, if it is not known."""
        rule = self._make_field_rule(epoch.rule, epoch.routes)
        if rule is None and self._rule_basis != epoch.rule:
            self._rule_basis = epoch.rule
            self._announcer.explain(f"cannot decide by rule {epoch.rule}")
            self._log("unknown rule", rule=epoch.rule)
        return rule

    def _take_task(
        self,
        epoch: PlanEpoch,
        turn: DecisionTurn,
        decision: FieldTurnDecision,
        now_s: float,
        left: str | None = None,
    ) -> None:
        task = self._replica.board[str(decision.task)]
        standing = self.visits.claim if self.visits.stands_at is not None else None
        self._begin_attempt(now_s, left)
        ends_s = decision.sortie_end_s
        claim = Claim(
            ClaimPhase.PROPOSED,
            task.task,
            self._free.since_s,
            self._rank,
            decision.end_s,
            sortie_end_s=None if math.isinf(ends_s) else ends_s,
            reversed=decision.reversed if task.path_enu_m else None,
        )
        told = self._choices.made_in_field(turn, epoch, decision, self._rank, left)
        if left is not None:
            self._note_turn(left, task.task)
        if standing is not None and standing.base is not None:
            self._attempt.departs_at_s = now_s + max(0.0, decision.depart_s - turn.now_s)
            claim = replace(claim, base=standing.base, stage=standing.stage)
            claim = replace(claim, departs_s=decision.depart_s)
        if standing is None or decision.depart_s <= turn.now_s + TOLERANCE_S:
            if not self._fly_to_task(task, claim, now_s, idled=self._free.found_nothing):
                return
        else:
            self._announcer.explain(f"takes off from base {standing.base} later")
            self._say(claim)
        scores = {"score": decision.score, "second_score": decision.second_score}
        self._note("decided", task.task, **scores, completion_s=decision.end_s)
        self._actions.append(told)

    def _visit_base(self, haven: Haven, now_s: float) -> None:
        """Fly there and claim a slot; being free, or having just become it."""
        since_s = self._free.since_s
        self._leave_ground(now_s)
        self._become_free(since_s)
        self._free.to_decide = False
        times_s = haven.arrives_s, haven.ready_s, now_s
        to = haven.way, haven.base.id
        self.visits.set_off(*to, since_s, self._rank, *times_s, beside=haven.beside)

    def _visit_over(self, since_s: float, adrift: bool) -> None:
        self._become_free(since_s, adrift=adrift)

    # -- with a task -----------------------------------------------------------------------

    def _order_to(self, task: TaskEntry, *, idled: bool = False) -> None:
        """Fly to the task of an earlier life's claim."""
        claim = self.claim
        if self._flights.problem is None or claim is None:
            super()._order_to(task, idled=idled)
            return
        way = self._flights.way_to_task(task.task, backwards=bool(claim.reversed))
        if way is not None:
            self._fly(way, task, claim, idled=idled)
        else:  # found at once by `advance`
            self._attempt.too_late_at_s = -math.inf

    def _fly_to_task(
        self, task: TaskEntry, claim: Claim, now_s: float, *, idled: bool = False
    ) -> bool:
        """Take off if need be, and fly there; say the claim as it is then. False: no way."""
        way = self._flights.way_to_task(task.task, backwards=bool(claim.reversed))
        if way is None:
            self._release("zones leave no way", now_s)
            return False
        if self.visits.stands_at is not None:
            self._machine.take(Trigger.DEPARTED)
            self._leave_ground(now_s)
            self._announcer.explain("")
        claim = replace(claim, base=None, stage=None, departs_s=None)
        claim = replace(claim, sortie_end_s=self._sortie.told_s)
        self._attempt.departs_at_s = None
        self._attempt.too_late_at_s = self._limits.too_late_at_s(task, claim, now_s)
        self._fly(way, task, claim, idled=idled)
        self._say(claim)
        return True

    def _fly(self, way: field.Way, task: TaskEntry, claim: Claim, *, idled: bool = False) -> None:
        line_s = self._flights.line_s(task.task, backwards=bool(claim.reversed))
        stay_s = task.service_s if line_s == 0.0 else 0.0
        attempt = self._attempt_at(task.task)
        self._flights.along(way, task, attempt, stay_s, idled=idled)

    def _leave_ground(self, now_s: float) -> None:
        me = self._mission_view.me
        if self.visits.leave_ground() and me is not None:
            self._flights.meter.take_off(now_s)
            self._sortie.depart(me, self._mission_view.mission_s(now_s))

    def _release(self, reason: str, now_s: float) -> None:
        """Give the task up; who waits for its way from a base stays on the ground there."""
        claim, base = self.claim, self.visits.stand_still()
        if claim is None or base is None:
            super()._release(reason, now_s)
            return
        self._note("released", str(claim.task), reason=reason)
        self.visits.stay(base, now_s)

    def _withdraw(self, phase: ClaimPhase, now_s: float, *, handed_over: bool) -> None:
        self.visits.stand_still()
        super()._withdraw(phase, now_s, handed_over=handed_over)

    def _depart_if_due(self, now_s: float) -> None:
        departs_at_s, task, claim = self._attempt.departs_at_s, self._task(), self.claim
        if departs_at_s is None or departs_at_s > now_s or task is None or claim is None:
            return
        early_s = (claim.departs_s or 0.0) - self._mission_view.mission_s(now_s)
        if early_s > TOLERANCE_S:  # the mission clock was put back
            self._attempt.departs_at_s = now_s + early_s
        elif self._lost() is None:
            self._fly_to_task(task, claim, now_s)

    def _await_opening(self, task: TaskEntry, now_s: float) -> None:
        """The UAV is where its work begins: wait until it may, unless it is too late."""
        claim, mission_s = self.claim, self._mission_view.mission_s(now_s)
        if claim is None:
            return
        begins_s = max(mission_s, task.opens_s)
        self._flights.reached(self._flights.points(task, backwards=bool(claim.reversed))[0], task)
        self._attempt.too_late_at_s = None
        if begins_s > self._limits.latest_begin_s(task, claim) + TOLERANCE_S:
            self._release("came too late", now_s)
            return
        self._attempt.begins_at_s = now_s + (begins_s - mission_s)
        self._begin_if_due(now_s)

    def _begin_if_due(self, now_s: float) -> None:
        begins_at_s, task, claim = self._attempt.begins_at_s, self._task(), self.claim
        if begins_at_s is None or begins_at_s > now_s or task is None or claim is None:
            return
        early_s = task.opens_s - self._mission_view.mission_s(now_s)
        if early_s > TOLERANCE_S:  # the mission clock was put back
            self._attempt.begins_at_s = now_s + early_s
            return
        self._attempt.begins_at_s = None
        if task.path_enu_m:
            attempt, backwards = self._attempt_at(task.task), bool(claim.reversed)
            self._flights.along_line(task, attempt, backwards=backwards)
            self._attempt.too_late_at_s = self._limits.too_late_at_s(task, claim, now_s)
        else:
            self._attempt.served_at_s = now_s + task.service_s

    def _end_line(self, task: TaskEntry, now_s: float) -> None:
        """The UAV has flown the line from end to end."""
        claim = self.claim
        if claim is None or not task.path_enu_m or self._attempt.served_at_s is not None:
            return
        self._flights.reached(self._flights.points(task, backwards=bool(claim.reversed))[-1], task)
        self._attempt.served_at_s = now_s + task.service_s

    def _give_up_what_is_late(self, now_s: float) -> None:
        late_s, serves = self._attempt.too_late_at_s, self._machine.state is AgentState.SERVING
        if late_s is None or late_s > now_s or self._task() is None:
            return
        self._attempt.too_late_at_s = None
        if self._airway.waits or not serves:
            why = "its line is not free in time" if serves else "too late to be there in time"
            self._release(why, now_s)

    def _drain(self, now_s: float) -> None:
        """The battery lasts otherwise than was known: give up what can't be done on it."""
        self._drained = False
        task, claim, state = self._task(), self.claim, self._machine.state
        works = state in (AgentState.FLYING, AgentState.SERVING)
        if claim is None or task is None or not (works and self._in_field):
            return
        if not self._limits.lasts(task, claim):
            # What is measured in flight may never show where it decides: not again at once.
            self._refused.add(task.task, now_s, passes=True)
            self._release("its battery does not last", now_s)
        elif state is AgentState.FLYING:
            self._attempt.too_late_at_s = self._limits.too_late_at_s(task, claim, now_s)

    # -- zones -------------------------------------------------------------------------------

    def reroute(self, now_s: float) -> None:
        """Zones have changed: new ways at once, and nothing that has none."""
        state, task, claim = self._machine.state, self._task(), self.claim
        if self._flights.problem is None or claim is None:
            return
        self._home_at_s = None
        if state in (AgentState.FLYING_TO_BASE, AgentState.ABOVE_BASE):
            self.visits.reroute(now_s)
        elif state in (AgentState.FLYING, AgentState.DEPARTING) and task is not None:
            self._reroute_to(task, claim, now_s)
        elif state is AgentState.SERVING and task is not None:
            line_s = self._flights.line_s(task.task, backwards=bool(claim.reversed))
            if math.isinf(line_s) or self._flights.way_out() is not None:
                self._release("a zone lies over it", now_s)
        if self._machine.state is AgentState.IDLE:
            self._free.adrift, self._free.to_decide = True, True
            self._free.strays |= state is not AgentState.IDLE
            self._free.strays |= self._flights.way_out() is not None

    def _reroute_to(self, task: TaskEntry, claim: Claim, now_s: float) -> None:
        way = self._flights.way_to_task(task.task, backwards=bool(claim.reversed))
        mission_s = self._mission_view.mission_s(now_s)
        waits = self._machine.state is AgentState.DEPARTING
        upset = self._limits.upset(task, claim, way, None if waits else mission_s)
        if way is None or upset is not None:
            self._release(upset or "zones leave no way", now_s)
        elif not waits:
            ends_s = self._limits.ends_s(task, claim, mission_s + way.duration_s)
            self._attempt.too_late_at_s = self._limits.too_late_at_s(task, claim, now_s)
            self._fly(way, task, claim)
            self._say(replace(claim, completion_s=ends_s))

    # -- without a task ------------------------------------------------------------------------

    def _situated(self, claim: Claim) -> Claim:
        return claim if self._flights.problem is None else self.visits.situated(claim)

    def _stay_idle(self, now_s: float, *, awaits_peers: bool = True) -> None:
        if self._machine.state is AgentState.READY_ON_GROUND:
            self._free.adrift = False
        super()._stay_idle(now_s, awaits_peers=awaits_peers)
        if self._flights.problem is None:
            return
        if not self._free.awaits_peers:
            self.visits.park()
        until_s = self._refused_bases.left_alone(now_s).values()
        self._free.retry_at_s = earliest(self._free.retry_at_s, *until_s)

    def head_home_in_time(self, now_s: float) -> None:
        """Who has found nothing to do flies to the nearest base before its battery is used up.

        Where lost UAVs block its slots and no other is in reach it comes down beside them.
        """
        if not self._in_field:
            return
        self._home_at_s = self._leaves_at_s(now_s)
        if self._home_at_s is None or self._home_at_s > now_s:
            return
        if self._machine.state is AgentState.ABOVE_BASE:
            self._home_at_s = None
            self.visits.come_down(now_s)
            return
        home = self._havens.home(now_s)
        idles = self._machine.state is AgentState.IDLE
        base = home.base if idles and home is not None else None
        haven = None if base is None else self._havens.refuge(base, now_s)
        if haven is not None:
            self._visit_base(haven, now_s)
            self._home_at_s = self._leaves_at_s(now_s)

    def _leaves_at_s(self, now_s: float) -> float | None:
        """When it has to head home from where it is, on the own clock; None: never."""
        stands = self.visits.stands_at is not None
        seeks = self._machine.state in WITHOUT_AIM and not stands
        return self._limits.leaves_at_s(self._havens.home(now_s) if seeks else None, stands, now_s)

    def spent(self, now_s: float) -> str | None:
        """Why the UAV has to fly home for good: its battery; None if it need not."""
        if self._flights.problem is None:
            return None
        if self.visits.is_hopeless(now_s):
            return "its battery is used up, and the slots of its base are blocked"
        if self._machine.state in PAUSED_BY_OPERATOR:  # nothing else looks at the time there
            self._home_at_s = self._leaves_at_s(now_s)
        due = self._home_at_s is not None and self._home_at_s <= now_s
        return "its battery is about to be used up" if due or self._limits.is_used_up else None

    # -- pieces ----------------------------------------------------------------------------------

    @property
    def _rank(self) -> int:
        """Its place in the sequence in force, from 0."""
        problem, epoch = self._flights.problem, self._replica.epoch
        sequence = () if epoch is None else epoch.sequence
        return 0 if problem is None else ranks(sequence, problem.uav_ids)[self._uav]

    @property
    def _in_field(self) -> bool:
        """Whether it decides under constraints, in a running mission."""
        return self._flights.problem is not None and self._mission_view.running
