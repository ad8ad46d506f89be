"""One UAV's visits to bases: flown to, waited for above, landed at, left with a full battery.

Slots of a base are held by claims, as tasks are (swarm.protocol.bases): a UAV lands when nobody
before it needs the slot, and says at each stage how far it is. Leaves out: who decides to fly to
a base, and what comes after it (agent.core.field_tasking).
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, replace

from agent.core.context import AgentContext, AgentPart
from agent.core.energy import SortieClock
from agent.core.flights import Flights
from agent.core.states import AT_BASE, VISITS_BASE, AgentState, Trigger
from swarm.allocation import field
from swarm.protocol import bases
from swarm.protocol.field_messages import BaseSpec
from swarm.protocol.messages import Stamp
from swarm.protocol.operator_commands import readiness
from swarm.protocol.timing import earliest
from swarm.protocol.uav_messages import BaseStage, Claim, ClaimPhase

_ON_GROUND = (BaseStage.LANDED, BaseStage.PARKED)
_PUNCTUAL = 0.25
"""Share of an objection window by which who is punctual may arrive earlier or later than it said.

Who has waited for a whole window was there before somebody who comes now, even if both are off."""


@dataclass(slots=True)
class BaseVisit:
    """What is going to happen of a visit to a base, and when; made anew for each."""

    held_at_s: float | None = None
    """When its claim turns from proposed to held."""
    waited_at_s: float | None = None
    """When it has waited for as long as others may object."""
    waited: bool = False
    """Whether it has."""
    known_at_s: float = math.inf
    """Since when everybody has known when it is going to arrive."""
    punctual: bool = False
    """Whether it has arrived then."""
    late_at_s: float | None = None
    """When it will have waited for longer than it said."""
    late: bool = False
    """Whether it has."""
    beside: bool = False
    """Whether it goes there though all slots are blocked, to come down beside them."""
    hopeless_at_s: float | None = None
    """When it has stood beside slots for long enough that are all blocked."""

    def next_deadline_s(self) -> float | None:
        """When any of that is due."""
        return earliest(self.held_at_s, self.waited_at_s, self.late_at_s, self.hopeless_at_s)


class BaseVisits(AgentPart):
    """What one UAV does at bases, and its claim meanwhile.

    Args:
        flights: sends the vehicle.
        sortie: how long it can stay in the air.
        become_free: told when a visit is over, and whether the vehicle flies on without aim.
    """

    def __init__(
        self,
        context: AgentContext,
        flights: Flights,
        sortie: SortieClock,
        become_free: Callable[[float, bool], None],
    ) -> None:
        super().__init__(context)
        self._flights = flights
        self._sortie = sortie
        self._become_free = become_free
        self._visit = BaseVisit()
        self._left_from = BaseStage.LANDED
        """Whether it left its last base from one of its slots, or from beside them."""
        self._departed_from: BaseSpec | None = None
        """The base that it has just been sent off from, until it has arrived anywhere."""
        self._on_ground: bool | None = None
        """Whether the vehicle stands at the base; None: as an earlier life has claimed."""
        self._vouched: dict[str, tuple[Stamp, Claim | None]] = {}
        """By UAV, the operator's last word that it is ready, and what it claimed at the time."""
        self._word: Stamp | None = None
        """The operator's last word about the own UAV that counts no more."""

    # -- what is known -------------------------------------------------------------------

    @property
    def claim(self) -> Claim | None:
        """The UAV's claim register, of this life or an earlier one."""
        return self._replica.claims.get(self._uav)

    @property
    def stands_at(self) -> str | None:
        """The base on whose ground the vehicle is; None if it is in the air."""
        claim = self.claim
        if claim is None or claim.stage not in _ON_GROUND or self._on_ground is False:
            return None
        return claim.base

    @property
    def is_parked(self) -> bool:
        """Whether it stands there beside the slots."""
        return self.claim is not None and self.claim.stage is BaseStage.PARKED

    def blocking(self) -> dict[str, str]:
        """Lost UAV -> base on whose slot it stands until it is heard, or said to be ready."""
        claims = self._replica.claims
        lost = claims.keys() - self._peers.credible - {self._uav}
        for uav, stamp in readiness(self._replica).items():
            if uav not in self._vouched or self._vouched[uav][0] != stamp:
                self._vouched[uav] = stamp, claims.get(uav)
        ready = {uav for uav in lost if self._vouched.get(uav, (None, None))[1] == claims.get(uav)}
        return bases.blocking(claims, lost, ready)

    def is_blocked(self, base: BaseSpec) -> bool:
        """Whether lost UAVs stand on all slots of a base, so that to wait there is in vain."""
        standing = sum(where == base.id for where in self.blocking().values())
        return base.slots is not None and standing >= base.slots

    @property
    def waits_long(self) -> bool:
        """Whether it has waited above its base for longer than it said it would."""
        return self._visit.late and self._visit.waited

    def situated(self, claim: Claim) -> Claim:
        """``claim`` with the base at which the vehicle stands, and until when it can fly."""
        base, before = self.stands_at, self.claim
        if base is None or before is None:
            return replace(claim, sortie_end_s=self._sortie.told_s)
        # Who is gone for good needs no slot, unless somebody else has the vehicle there.
        leaves = claim.phase is ClaimPhase.OUT and not claim.handed_over
        stage = BaseStage.PARKED if leaves else before.stage
        used_up_s = before.sortie_end_s if before.stage is BaseStage.PARKED else None
        return replace(claim, base=base, stage=stage, sortie_end_s=used_up_s)

    def is_hopeless(self, now_s: float) -> bool:
        """Whether it has waited beside blocked slots for as long as somebody takes to clear one."""
        hopeless_at_s = self._visit.hopeless_at_s
        beside = self._machine.state is AgentState.BESIDE_SLOTS
        return beside and hopeless_at_s is not None and hopeless_at_s <= now_s

    def next_deadline_s(self) -> float | None:
        """When `advance` will next have something to do."""
        visits = self._machine.state in VISITS_BASE
        return self._visit.next_deadline_s() if visits else None

    # -- on its way ----------------------------------------------------------------------

    def leave_ground(self) -> bool:
        """The vehicle takes off now, if it stands at a base; whether it does."""
        base, self._on_ground = self.stands_at, False
        self._departed_from = None if base is None else self._flights.base(base)
        self._left_from = BaseStage.PARKED if self.is_parked else BaseStage.LANDED
        self._mission_view.leave_ground()
        return base is not None

    def flown(self) -> BaseSpec | None:
        """It has arrived, or will not fly: gives the base that it was just sent off from."""
        base, self._departed_from = self._departed_from, None
        return base

    def stand_still(self) -> BaseSpec | None:
        """What it was sent off for is over: gives the base where it still waits for its way up."""
        base = self.flown() if self._airway.waits_on_ground else None
        if base is not None:
            self._stand(base)
        return base

    def set_off(
        self,
        way: field.Way,
        base: str,
        since_s: float,
        rank: int,
        arrives_s: float,
        ready_s: float,
        now_s: float,
        *,
        beside: bool = False,
    ) -> None:
        """Fly to ``base`` that way, and claim it: free since then, predicted to be ready then.

        To come down ``beside`` its slots it goes though all are blocked.
        """
        self._machine.take(Trigger.BASE_CHOSEN)
        known_s = now_s + self._timing.objection_window_s
        self._visit = BaseVisit(held_at_s=known_s, known_at_s=known_s, beside=beside)
        self._fly(way, base)
        self._say(
            Claim(
                ClaimPhase.PROPOSED,
                None,
                since_s,
                rank,
                ready_s,
                base=base,
                stage=BaseStage.APPROACHING,
                arrives_s=arrives_s,
                sortie_end_s=self._sortie.told_s,
            )
        )
        self._log("flies to base", base=base, arrives_s=arrives_s)

    def resume(self, claim: Claim, now_s: float) -> bool:
        """Go on with an earlier life's visit, as it claimed; whether that can be done."""
        way = None if claim.base is None else self._flights.way_to_base(claim.base)
        if way is None or claim.base is None:
            return False
        self._machine.take(Trigger.BASE_CHOSEN)
        held_s = now_s + self._timing.objection_window_s
        self._visit = BaseVisit(None if claim.phase is ClaimPhase.HELD else held_s)
        self._fly(way, claim.base)
        self._say(claim)
        self._log("resumes", base=claim.base)
        return True

    def reroute(self, now_s: float) -> None:
        """Zones have changed: fly on another way, or to something else."""
        claim = self.claim
        if claim is None or claim.base is None:
            return
        way = self._flights.way_to_base(claim.base)
        if way is None:
            self.break_off("zones leave no way", now_s)
        elif self._machine.state is AgentState.FLYING_TO_BASE:
            arrives_s = self._mission_view.mission_s(now_s) + way.duration_s
            later_s = max(0.0, arrives_s - (claim.arrives_s or arrives_s))
            self._fly(way, claim.base)
            ready_s = claim.completion_s + later_s
            self._visit.known_at_s = now_s + self._timing.objection_window_s
            self._say(replace(claim, completion_s=ready_s, arrives_s=arrives_s))

    def arrive(self, now_s: float) -> None:
        """The vehicle is above the base: land, if there is a slot."""
        claim, base = self.claim, self._base()
        if claim is None or base is None or not self._machine.take(Trigger.ARRIVED):
            return
        self._mission_view.arrive(base.position_enu_m)
        if claim.stage is not BaseStage.WAITING:  # an earlier life of it may have waited already
            mission_s = self._mission_view.mission_s(now_s)
            lands_s = mission_s + self._flights.land_s
            off_s = math.inf if claim.arrives_s is None else abs(lands_s - claim.arrives_s)
            self._visit.punctual = (
                self._visit.known_at_s <= now_s
                and off_s <= _PUNCTUAL * self._timing.objection_window_s
            )
            if not self._visit.punctual:  # its place in the order is not what others know it to be
                self._say(replace(claim, arrives_s=lands_s))
        else:
            self._visit.waited_at_s = now_s + self._timing.objection_window_s
        begins_s = claim.completion_s - base.swap_s - self._flights.land_s
        begins_s += self._timing.patience_s
        self._visit.late_at_s = now_s + begins_s - self._mission_view.mission_s(now_s)
        self._land_or_wait(base, now_s)

    def advance(self, now_s: float) -> None:
        """What follows from the registers and the time."""
        visit, claim = self._visit, self.claim
        if self._machine.state not in VISITS_BASE or claim is None:
            return
        if visit.held_at_s is not None and visit.held_at_s <= now_s:
            visit.held_at_s = None
            self._say(replace(claim, phase=ClaimPhase.HELD))
        if visit.waited_at_s is not None and visit.waited_at_s <= now_s:
            visit.waited_at_s, visit.waited = None, True
        if visit.late_at_s is not None and visit.late_at_s <= now_s:
            visit.late_at_s, visit.late = None, True
        base = self._base()
        if self._machine.state is AgentState.SWAPPING:
            self._let_start_if_told()
        if self._machine.state is AgentState.BESIDE_SLOTS and base is not None:
            self._wait_on_ground(base, now_s)
            return
        on_slot = self._machine.state is AgentState.SWAPPING
        in_vain = base is not None and self.is_blocked(base) and not (on_slot or visit.beside)
        if base is None or in_vain:
            self.break_off("the base is gone" if base is None else "its slots are blocked", now_s)
        elif self._machine.state is AgentState.ABOVE_BASE:
            self._land_or_wait(base, now_s)

    def break_off(self, reason: str, now_s: float) -> None:
        """Give the base up, in the air or before its way up is granted."""
        claim = self.claim
        if claim is None:
            return
        if (here := self.stand_still()) is not None:
            self._log("released", base=claim.base, reason=reason)
            self.stay(here, now_s)
            return
        if not self._machine.take(Trigger.CLAIM_LOST):
            return
        self._visit, self._on_ground = BaseVisit(), False
        self._mission_view.leave_ground()
        self._announcer.explain("")
        self._become_free(self._mission_view.mission_s(now_s), True)
        self._log("released", base=claim.base, reason=reason)

    def _fly(self, way: field.Way, base: str) -> None:
        self._flights.along(way, None, 1, 0.0)
        self._announcer.explain(f"flies to base {base}")

    def _base(self) -> BaseSpec | None:
        claim = self.claim
        return None if claim is None or claim.base is None else self._flights.base(claim.base)

    # -- there ---------------------------------------------------------------------------

    def _land_or_wait(self, base: BaseSpec, now_s: float) -> None:
        claim, visit = self.claim, self._visit
        if claim is None:
            return
        credible = self._peers.credible
        claims = {uav: each for uav, each in self._replica.claims.items() if uav in credible}
        claims[self._uav] = claim
        everybody = claims, self.blocking()
        may_land = bases.may_land(
            *(self._uav, base.id, base.slots, *everybody),
            waited=visit.waited,
            punctual=visit.punctual,
            swap_s=base.swap_s,
        )
        if may_land:
            self._land(base, claim, now_s)
        elif claim.stage is BaseStage.APPROACHING and claim.phase is ClaimPhase.HELD:
            visit.waited_at_s = now_s + self._timing.objection_window_s
            self._announcer.explain(f"waits for a slot of base {base.id}")
            self._say(replace(claim, stage=BaseStage.WAITING))
            self._log("waits for a slot", base=base.id)

    def _land(self, base: BaseSpec, claim: Claim, now_s: float) -> None:
        self._visit, self._on_ground = BaseVisit(), self._machine.state in AT_BASE
        self._machine.take(Trigger.SLOT_FREE)
        lands_s = 0.0 if self._on_ground else self._flights.land_s
        ready_s = self._mission_view.mission_s(now_s) + lands_s + base.swap_s
        self._announcer.explain(f"swaps its battery at base {base.id}")
        self._swap(base)
        if not self._on_ground:
            self._flights.meter.come_down(now_s)
        held = replace(claim, phase=ClaimPhase.HELD, completion_s=ready_s)
        self._say(replace(held, stage=BaseStage.LANDED))
        self._log("lands", base=base.id)

    def come_down(self, now_s: float) -> None:
        """The battery is used up: land beside the slots, and wait there for one."""
        claim, base = self.claim, self._base()
        if claim is not None and base is not None and self._machine.take(Trigger.COMES_DOWN):
            self._flights.land_beside(base)
            end_s = self._mission_view.mission_s(now_s)
            ends_s = claim.sortie_end_s
            self._wait_beside(base, replace(claim, sortie_end_s=ends_s or end_s), now_s)
            self._log("lands beside the slots", base=base.id)

    def _wait_beside(self, base: BaseSpec, claim: Claim, now_s: float) -> None:
        """Say that it stands there with a battery that is used up, which its sortie's end tells."""
        self._on_ground = True
        self._visit = BaseVisit(waited_at_s=now_s + self._timing.objection_window_s)
        self._sortie.land()
        self._mission_view.stand(base.position_enu_m)
        self._announcer.explain(f"waits beside the slots of base {base.id}")
        free_s = [
            each.completion_s
            for each in self._replica.claims.values()
            if each.base == base.id and bases.holds_slot(each)
        ]
        ready_s = max([self._mission_view.mission_s(now_s), *free_s]) + base.swap_s
        held = replace(claim, phase=ClaimPhase.HELD, completion_s=ready_s)
        self._say(replace(held, stage=BaseStage.PARKED))

    def _swap(self, base: BaseSpec) -> None:
        """Land, or stand there; what was said of the UAV before was of an earlier stay."""
        self._word = readiness(self._replica).get(self._uav)
        self._flights.swap(base)

    def _let_start_if_told(self) -> None:
        """Pass on the operator's word that it may start again."""
        word = readiness(self._replica).get(self._uav)
        if word is not None and word != self._word:
            self._word = word
            self.let_start()

    def let_start(self) -> bool:
        """Pass on that it may start again; whether it stands on a slot to do so."""
        if self._machine.state is not AgentState.SWAPPING:
            return False
        self._flights.let_start()
        self._log("may start again")
        return True

    def _wait_on_ground(self, base: BaseSpec, now_s: float) -> None:
        if not self.is_blocked(base):
            self._visit.hopeless_at_s = None
            self._land_or_wait(base, now_s)
        elif self._visit.hopeless_at_s is None:
            self._visit.hopeless_at_s = now_s + self._timing.clear_s

    def stand(self, now_s: float, *, found: bool = False) -> bool:
        """The vehicle stands at a base already: have its battery looked after from there.

        Whether it does, by its last claim, or at whatever base it was ``found``; its battery may be
        full, which is told at once then.
        """
        if found:
            return self._stand_where_found(now_s)
        claim, base = self.claim, self._base()
        if base is None or claim is None or claim.stage is None or claim.stage not in _ON_GROUND:
            return False
        if not self._machine.take(Trigger.STANDS_AT_BASE):
            return False
        if claim.stage is BaseStage.PARKED and claim.sortie_end_s is not None:
            self._machine.take(Trigger.COMES_DOWN)
            self._flights.land_beside(base, resume=True)  # it may have been on its way down
            self._wait_beside(base, claim, now_s)
        else:
            self._stay(base, claim.stage, now_s)
        return True

    def _stand_where_found(self, now_s: float) -> bool:
        """The vehicle was found on the ground: whether that is at a base.

        Others may have its slot by now: it waits for one.
        """
        base = self._flights.base_here()
        if base is None or not self._machine.take(Trigger.STANDS_AT_BASE):
            return False
        self._machine.take(Trigger.COMES_DOWN)
        self._become_free(self._mission_view.mission_s(now_s), False)
        mission_s = self._mission_view.mission_s(now_s)
        stands = Claim(
            *(ClaimPhase.HELD, None, mission_s, 0, mission_s),
            base=base.id,
            stage=BaseStage.PARKED,
            arrives_s=mission_s,
            sortie_end_s=mission_s,
        )
        self._wait_beside(base, stands, now_s)
        self._log("stands at base", base=base.id)
        return True

    def stay(self, base: BaseSpec, now_s: float) -> None:
        """The vehicle has not taken off from ``base``: it stands there still, as before."""
        if self._machine.take(Trigger.STANDS_AT_BASE):
            self._become_free(self._mission_view.mission_s(now_s), False)
            self._stay(base, self._left_from, now_s)

    def _stand(self, base: BaseSpec) -> None:
        self._visit, self._on_ground = BaseVisit(), True
        self._sortie.land()
        self._mission_view.stand(base.position_enu_m)

    def _stay(self, base: BaseSpec, stage: BaseStage, now_s: float) -> None:
        self._stand(base)
        self._announcer.explain(f"stands at base {base.id}")
        self._swap(base)
        mission_s = self._mission_view.mission_s(now_s)
        ready_s = mission_s + base.swap_s
        self._say(Claim(ClaimPhase.HELD, None, mission_s, 0, ready_s, base=base.id, stage=stage))
        self._log("stands at base", base=base.id)

    def touch_down(self, leg: int, now_s: float) -> None:
        """The vehicle is on the ground, its battery about to be changed."""
        claim, base = self.claim, self._base()
        swaps = self._machine.state is AgentState.SWAPPING and leg == self._flights.leg
        if not swaps or claim is None or base is None:
            return
        self._on_ground = True
        self._flights.meter.touch_down(now_s)
        self._sortie.land()
        self._mission_view.stand(base.position_enu_m)
        ready_s = self._mission_view.mission_s(now_s) + base.swap_s
        if claim.completion_s != ready_s or claim.sortie_end_s is not None:
            self._say(replace(claim, completion_s=ready_s, sortie_end_s=None))

    def swapped(self, leg: int, now_s: float) -> None:
        """The battery is full."""
        claim, base = self.claim, self._base()
        late = leg != self._flights.leg or claim is None or base is None
        if late or claim is None or base is None or not self._machine.take(Trigger.SWAPPED):
            return
        self._on_ground = True
        self._sortie.land()
        self._mission_view.stand(base.position_enu_m)
        self._announcer.explain(f"stands at base {claim.base}")
        self._become_free(self._mission_view.mission_s(now_s), False)
        self._log("battery swapped", base=claim.base)

    def park(self) -> None:
        """Nothing to do for now: leave the slot to others."""
        claim = self.claim
        at_base = self._machine.state in AT_BASE
        if at_base and claim is not None and claim.stage is BaseStage.LANDED:
            self._say(replace(claim, stage=BaseStage.PARKED))
