"""One UAV's vehicle in the hands of its agent: prepared, stopped, brought home, or given up.

Says what follows for the vehicle and for the agent's state from each of the vehicle's reports and
from each reason to stop or to go home.
"""

from __future__ import annotations

from agent.core.context import AgentContext, AgentPart
from agent.core.field_tasking import FieldTasking
from agent.core.interface import (
    Arrived,
    AttemptFailed,
    Caution,
    FlightLimits,
    GoTo,
    HandedOver,
    HandOverExplained,
    HeardAgain,
    Held,
    Hold,
    Home,
    Landed,
    MotorsRun,
    NotReady,
    Prepare,
    Refused,
    Return,
    ReturnAdvised,
    ReturnBegun,
    Runway,
    Swap,
    Swapped,
    Telemetry,
    VehicleReady,
    VehicleReport,
)
from agent.core.states import (
    AT_BASE,
    HEADED_HOME,
    PAUSED_BY_OPERATOR,
    TAKES_TARGETS,
    AgentState,
    Trigger,
)
from agent.core.stop_conditions import EndCondition
from swarm.protocol.fields import Point
from swarm.protocol.messages import UavSpec
from swarm.protocol.operator_commands import BEING_STOPPED, CANNOT_HOLD
from swarm.protocol.uav_messages import Claim, ClaimPhase

_ALOFT = (ClaimPhase.IDLE, ClaimPhase.PROPOSED, ClaimPhase.HELD)
"""A UAV that claims so has its vehicle in the air."""


class VehicleCommander(AgentPart):
    """Commands one UAV's vehicle, all but its targets.

    Args:
        tasking: the UAV's tasks, which begin and end with the vehicle.
        ending: when the mission is over.
    """

    def __init__(self, context: AgentContext, tasking: FieldTasking, ending: EndCondition) -> None:
        super().__init__(context)
        self.exit_status = 0
        """Of the process, when it ends."""
        self._tasking = tasking
        self._ending = ending
        # What the state can't tell of the vehicle, as it stays true from state to state.
        self._flew_before = False
        """Whether it may be in the air though this life has not brought it there."""
        self._left_in_air = False
        """Whether an earlier life was last heard to have it in the air."""
        self.begun = False
        """Whether its motors run for a take-off of ours that has not ended, in this life or an
        earlier one: all that tells its vehicle from one that its pilot starts meanwhile."""
        self._flown = False
        """Whether it has been in the air in this life."""
        self._reason = ""
        """Why it flies home."""
        self._unready = ""
        """Why the vehicle was not ready, as its status told last."""

    # -- what it reports ------------------------------------------------------------

    def hear(self, report: VehicleReport, now_s: float) -> None:
        """The vehicle says so; what comes late means nothing."""
        match report:
            case VehicleReady():
                self.begun = False
                self._take_targets(now_s)
            case MotorsRun(ours):
                self.begun = ours and self._machine.state is AgentState.PREPARING
            case NotReady(reason):
                if self._machine.state not in PAUSED_BY_OPERATOR:  # why it holds is worth more
                    self._announcer.explain(reason)
                    self._unready = self._announcer.note
                self._log("vehicle not ready", reason=reason)
            case Caution(reason):
                self._announcer.caution(reason)
                self._log("caution" if reason else "no caution any more", reason=reason)
            case FlightLimits():
                self._tasking.introduce(report)
            case Arrived(leg):
                if self._announcer.note == self._unready:  # from a base it was ready on its way
                    self._announcer.explain("")
                self._tasking.arrive(leg, now_s)
            case Landed(leg):
                self._tasking.visits.touch_down(leg, now_s)
            case Swapped(leg):
                self._tasking.visits.swapped(leg, now_s)
            case AttemptFailed(leg):
                self._tasking.fail(leg)
            case Telemetry():
                self._mission_view.move(report)
                self._tasking.measure(now_s)
            case Refused(Prepare(), reason, stands=True) if self._stand_there(reason, now_s):
                pass
            case Refused() as refused:
                self._give_up_order(refused, now_s)
            case HandedOver(reason, silent):
                self.give_up(reason, now_s, handed_over=not silent)
            case HandOverExplained(reason):
                self._explain(reason, now_s)
            case HeardAgain(reason):
                self._turn_home(Trigger.HEARD_AGAIN, reason, None, now_s)
            case ReturnBegun():
                self._flown = True
            case ReturnAdvised(reason):
                self._flown = True
                if self._machine.state is not AgentState.OUT:
                    self.go_home(reason, now_s, hurry=True)
            case Held():
                if self._machine.state in PAUSED_BY_OPERATOR:
                    self._announcer.explain(self._announcer.note.removeprefix(BEING_STOPPED))
            case Home():
                if self._machine.take(Trigger.LANDED):
                    self._log(self._how_it_ended)

    def _take_targets(self, now_s: float) -> None:
        """It is in the air and under command."""
        if self._machine.allows(Trigger.VEHICLE_READY):
            self._flown = True
            self._announcer.explain("")
            self._mission_view.take_off()
            self._tasking.begin(now_s)
            self._log("airborne")

    def _stand_there(self, reason: str, now_s: float) -> bool:
        """Whether a vehicle that an earlier life had in the air stands at a base now.

        It had not taken off there yet, or has come down there meanwhile.
        """
        stands = self._left_in_air and self._tasking.stand(now_s, found=True)
        if stands:
            self._log("found on the ground at a base", reason=reason)
        return stands

    def _give_up_order(self, refused: Refused, now_s: float) -> None:
        order, reason = refused.order, refused.reason
        label = self._tasking.label(order.leg) if isinstance(order, GoTo) else {}
        self._log("vehicle refused", order=str(order), reason=reason, **label)
        if isinstance(order, GoTo | Swap):
            self._tasking.refuse(order.leg, reason, now_s, passes=refused.passes)
        elif isinstance(order, Return) and (order.path_enu_m or order.land):
            # Better home by the vehicle's own way than nowhere.
            self._order(Return(order.reason, order.resume))
        elif isinstance(order, Prepare) and self._flew_before:
            # It may be in the air.
            self.go_home(reason, now_s, status=1, hurry=True)
        elif isinstance(order, Hold) and self._machine.state in PAUSED_BY_OPERATOR:
            self._announcer.explain(f"{CANNOT_HOLD}{reason}")
        elif isinstance(order, Prepare | Return):
            self.give_up(reason, now_s, handed_over=False)

    # -- on its way up ----------------------------------------------------------------

    def recall(self, claim: Claim | None, *, rejoin: bool, begun: bool) -> None:
        """What the last claim of an earlier life, if there was one, tells of the vehicle.

        Or its memory, of one that had ``begun`` to take off and claimed nothing yet.
        """
        self.begun = begun and not rejoin
        self._flew_before = claim is not None
        self._left_in_air = claim is not None and claim.phase in _ALOFT and not rejoin
        if claim is not None:
            self._airway.recall(claim)

    def stay_out(self, claim: Claim, now_s: float) -> None:
        """An earlier life took no more part, as it claimed: neither does this one."""
        if claim.handed_over:
            self.give_up("handed over in an earlier life", now_s, handed_over=True)
        elif self._mission_view.said_to_run:
            self.go_home("left the mission in an earlier life", now_s)

    @property
    def may_fly(self) -> bool:
        """Whether its vehicle has been in the air, in this life or an earlier one, or takes off."""
        return self._flown or self._flew_before or self.begun

    def prepare(self, me: UavSpec, trigger: Trigger) -> None:
        """Get it ready for tasks, or take it in hand where it is."""
        if not self._machine.take(trigger):
            return
        self._announcer.explain("")
        self._tasking.introduce()
        order = Prepare(
            self._mission_view.in_layer(me.position_enu_m),
            me.speed_m_s,
            resume=self._mission_view.said_to_run or self._left_in_air,
            ground_up_m=me.position_enu_m[2],
            left_in_air=self._left_in_air,
            acceleration_m_s2=me.acceleration_m_s2,
            begun=self.begun,
            vehicle=me.vehicle,
            runway=_runway_of(me),
        )
        self._order(order)

    # -- stopped by the operator --------------------------------------------------------

    def hold(self, reason: str, now_s: float) -> None:
        """Stop it, or leave it on the ground where nobody has begun to prepare it."""
        if not self._machine.allows(Trigger.HOLD):
            return
        before = self._machine.state
        self._flew_before |= before in TAKES_TARGETS | AT_BASE
        untouched = before is AgentState.SYNCING and not self._flew_before
        if before not in HEADED_HOME:
            self._tasking.pause(now_s)
        self._machine.take(Trigger.HOLD)
        self._announcer.explain(reason if untouched else f"{BEING_STOPPED}{reason}")
        if not untouched:
            self._order(Hold(reason))

    def resume(self, reason: str, now_s: float) -> None:
        """Take part again, as far as there is anything to take part in."""
        me = self._mission_view.me
        if self._machine.allows(Trigger.RESUME) and me is not None:
            if not self._tasking.stand(now_s):
                self.prepare(me, Trigger.RESUME)
        else:
            self.go_home(reason, now_s)

    def stay_paused(self, now_s: float) -> None:
        """The mission has ended; the vehicle stays where the operator wants it."""
        if self._machine.take(Trigger.MISSION_OVER):
            self._take_no_further_part(now_s)

    # -- on its way home ----------------------------------------------------------------

    def go_home(self, reason: str, now_s: float, *, status: int = 0, hurry: bool = False) -> None:
        """Bring it home; where there is time, in its own layer as far as its start.

        One that is not ours to command any more is not waited for any longer. ``status`` is the
        process's exit status when the vehicle is home; in a ``hurry`` it returns from where it is.
        """
        if self._machine.state is AgentState.OUT:
            self.exit_status = 0
            self._machine.take(Trigger.DISMISSED)
            return
        me = None if hurry else self._mission_view.me
        via_enu_m = None if me is None else self._mission_view.in_layer(me.position_enu_m)
        trigger = Trigger.RETURN_AT_ONCE if via_enu_m is None else Trigger.RETURN
        if self._machine.allows(trigger):
            self.exit_status = max(self.exit_status, status)
        self._turn_home(trigger, reason, via_enu_m, now_s)

    def reroute(self) -> None:
        """Zones have changed while it flies home: go on by another way."""
        home = self._tasking.way_home()
        if home is not None and self._machine.state not in PAUSED_BY_OPERATOR:
            self._order(self._return(self._reason, None), takes_s=home.duration_s)

    def _turn_home(
        self, trigger: Trigger, reason: str, via_enu_m: Point | None, now_s: float
    ) -> None:
        """Order the return, from whatever the vehicle does now.

        On its way home it is told so again at every step, and works no way out for that.
        """
        if not self._machine.allows(trigger):
            return
        before, order, home = (
            self._machine.state,
            self._return(reason, via_enu_m),
            self._tasking.way_home(),
        )
        self._machine.take(trigger)
        if before not in HEADED_HOME:
            self._take_no_further_part(now_s)
        self._announcer.explain(reason)
        self._log("returning", reason=reason)
        self._order(order, takes_s=None if home is None else home.duration_s)

    def _return(self, reason: str, via_enu_m: Point | None) -> Return:
        """Home by the start, or at once; round zones to the nearest base where there are any."""
        self._reason = reason
        home = self._tasking.way_home()
        if home is None:
            return Return(reason, self._flew_before, via_enu_m)
        return Return(
            reason,
            self._flew_before,
            home.target_enu_m,
            path_enu_m=home.via_enu_m,
            land=home.lands,
        )

    def _take_no_further_part(self, now_s: float) -> None:
        self._ending.settle()
        self._tasking.end(now_s, handed_over=False)

    @property
    def _how_it_ended(self) -> str:
        """What is true of a vehicle that is said to be home."""
        if self._flown:
            return "landed at home"
        return "is on the ground" if self._flew_before else "ends without having taken off"

    # -- not to be commanded any more ---------------------------------------------------

    def give_up(self, reason: str, now_s: float, *, handed_over: bool) -> None:
        """Command it no more, because somebody else has it or it does not obey."""
        if not self._machine.take(Trigger.HANDED_OVER):
            return
        if self._machine.state is AgentState.LEFT:
            self.exit_status = 1
        self._announcer.explain(reason)
        self._log("vehicle given up", reason=reason)
        self._tasking.end(now_s, handed_over=handed_over)

    def _explain(self, reason: str, now_s: float) -> None:
        """More is known of the vehicle given up; one that was only silent is another's now."""
        if not self._machine.take(Trigger.EXPLAINED):
            return
        self._announcer.explain(reason)
        self._log("of the vehicle given up", reason=reason)
        if not self._tasking.is_handed_over:
            self._tasking.end(now_s, handed_over=True)


def _runway_of(me: UavSpec) -> Runway | None:
    """Where it lands, if that is not upright."""
    heading_rad = me.landing_heading_rad
    return None if heading_rad is None else Runway(me.position_enu_m, heading_rad)
