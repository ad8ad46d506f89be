"""How the work under way with one vehicle goes on: by what it says, and by time.

Passes both to the machine at work, and ends or follows up what that has done. Leaves out:
what begins work (agent.mavlink.orders), what is heard (agent.mavlink.bridge), and how
targets stand on a vehicle (agent.mavlink.standing_mission).
"""

from __future__ import annotations

import math
from collections.abc import Sequence

from agent.mavlink.commands import CommandEnded
from agent.mavlink.cruise import CruiseWatch
from agent.mavlink.messages import Inbound, Landed, Position
from agent.mavlink.orders import OrderTaker
from agent.mavlink.preparation import Preparation
from agent.mavlink.search import Search
from agent.mavlink.seat import Seat
from agent.mavlink.work import Phase, Work
from agent.vehicle import (
    HandedOver,
    Held,
    Hold,
    Home,
    Refused,
    Return,
    ReturnAdvised,
    ReturnBegun,
    VehicleReady,
)
from swarm.deadline import earliest

__all__ = ["Duty"]

Point = tuple[float, float, float]

_POLL_S = 0.25
"""While something is waited for, look that often even if nothing is heard."""


class Duty:
    """Carries on the work with one vehicle.

    Args:
        seat: the vehicle.
        work: what is under way.
        orders: for what follows of itself.
    """

    def __init__(self, seat: Seat, work: Work, orders: OrderTaker) -> None:
        self._seat = seat
        self._work = work
        self._orders = orders
        self._cruise = CruiseWatch()
        self._raises_jerk = False

    # What the vehicle says.

    def on_message(self, message: Inbound) -> None:
        """Pass on what is no heartbeat, position or acknowledgement."""
        if self._work.preparation is not None:
            self._seat.say(*self._work.preparation.on_message(message, self._seat.now_s))
        if self._seat.mission is not None:
            self._seat.say(*self._seat.mission.on_message(message, self._seat.now_s))
        if self._seat.lent is not None:
            self._seat.lent.on_message(message)
        if self._work.target is not None:
            self._work.target.on_message(message)
            self._judge_target()

    def on_position(self, position: Position, place_enu_m: Point) -> None:
        """Take a fresh position."""
        now_s = self._seat.now_s
        if self._work.preparation is not None:
            self._seat.say(*self._work.preparation.on_position(position, now_s))
        if self._work.holding is not None:
            self._work.holding.on_position(position)
        elif self._work.returning is not None:
            self._work.returning.on_position(place_enu_m, position.velocity_enu_m_s, now_s)
        if self._seat.mission is not None:
            self._seat.mission.on_position(place_enu_m, now_s)
        if self._work.target is not None:
            velocity_enu_m_s, told_m_s = position.velocity_enu_m_s, self._work.speed_m_s
            if remark := self._cruise.judge(velocity_enu_m_s, told_m_s, now_s):
                self._work.tell_caution(remark)
            self._work.target.on_position(place_enu_m, velocity_enu_m_s)
            self._judge_target()

    def on_ended(self, ended: Sequence[CommandEnded]) -> None:
        """Take the outcomes of commands."""
        now_s = self._seat.now_s
        for one in ended:
            if self._work.preparation is not None:
                self._seat.say(*self._work.preparation.on_ended(one, now_s))
            if self._work.returning is not None:
                self._work.returning.on_ended(one, now_s)
            if self._work.holding is not None:
                self._work.holding.on_ended(one, now_s)
            if self._seat.mission is not None:
                self._seat.mission.on_ended(one, now_s)
            if self._work.target is not None:
                self._work.target.on_ended(one)
                self._judge_target()

    def on_reboot(self) -> None:
        """The autopilot began anew."""
        if self._work.in_our_hands():
            self._work.hand_over("the autopilot rebooted")
        self._work.preparation, self._work.prepares_ours = None, False

    # What time brings.

    def advance(self) -> None:
        """Do what time and state ask for."""
        if not self._seat.silent:
            self._advance_mission()
            self._advance_lent()
        match self._work.phase:
            case Phase.PREPARING:
                self._advance_preparation()
            case Phase.HOLDING:
                self._advance_holding()
            case Phase.RETURNING:
                self._advance_return()
            case _ if self._work.search is not None:
                self._advance_search(self._work.search)
            case _:
                pass

    def next_deadline_s(self) -> float:
        """When `advance` may have something to do."""
        seat, now_s, mission = self._seat, self._seat.now_s, self._seat.mission
        busy = self._work.phase in (Phase.PREPARING, Phase.HOLDING, Phase.RETURNING)
        starting = mission is not None and mission.is_starting
        if busy or self._work.search is not None or starting:
            return now_s + _POLL_S
        at_s = None if mission is None else mission.next_deadline_s()
        lent = None if seat.silent else seat.lent
        due_s = earliest(at_s, None if lent is None else lent.next_deadline_s())
        return math.inf if due_s is None else max(due_s, now_s)

    def _advance_preparation(self) -> None:
        heartbeat, order = self._seat.vehicle.heartbeat, self._work.prepare
        if order is None:
            return
        if (reason := self._seat.missing()) is not None:
            self._work.tell_not_ready(reason)
            return
        if heartbeat is None or self._seat.flavour is None:
            return
        if self._work.preparation is None:
            self._work.preparation = Preparation(
                order,
                self._seat.config,
                self._seat.commands,
                self._seat.flavour,
                self._seat.guards,
                self._seat.mission,
                ours=self._work.prepares_ours,
            )
        preparation = self._work.preparation
        self._seat.say(*preparation.advance(self._seat.vehicle, heartbeat, self._seat.now_s))
        if preparation.caution is not None:
            self._work.tell_caution(preparation.caution)
        if preparation.failure is not None:
            aloft = heartbeat.armed and self._seat.flavour.airborne(self._seat.vehicle)
            obeys = self._work.obeys(heartbeat.custom_mode)
            self._work.drop()
            if aloft and obeys:
                self._work.phase = Phase.HOVERING  # nobody else would bring it down
                self._seat.report(ReturnAdvised(preparation.failure))
            else:
                self._work.phase = Phase.IDLE
                if self._seat.mission is not None:
                    self._seat.mission.stand_down()  # an upload is still ended, never left half
                self._seat.report(Refused(order, preparation.failure))
        elif preparation.done:
            self._work.drop()
            self._work.phase = Phase.HOVERING
            if self._seat.mission is not None:
                self._seat.mission.wait_there()
            self._seat.report(VehicleReady())
        else:
            self._work.tell_not_ready(preparation.waiting_for)

    def _advance_search(self, search: Search) -> None:
        """Return or stop the vehicle once it is found; it has its time to be."""
        order, reason = search.order, search.advance()
        if reason is None:
            self._work.search = None
            if isinstance(order, Return):
                self._orders.return_home(order)
            else:
                self._orders.hold_found(order)
        elif not search.in_vain:
            self._work.tell_not_ready(reason)
        else:
            self._work.drop()
            if isinstance(order, Return):
                self._orders.refuse_return(order, reason)
            else:
                self._seat.report(Refused(order, reason))

    def _advance_mission(self) -> None:
        mission, flavour = self._seat.mission, self._seat.flavour
        heartbeat, heard_s = self._seat.vehicle.heartbeat, self._seat.vehicle.heartbeat_at_s
        if mission is None or flavour is None or heartbeat is None or heard_s is None:
            return
        self._seat.say(*mission.advance(heartbeat, heard_s, self._seat.now_s))
        self._judge_target()
        if self._work.phase not in (Phase.HOVERING, Phase.FLYING):
            return
        if mission.coming_home:
            reason = "nothing followed its last target in time, so it comes home by itself"
            self._work.drop()
            self._seat.say(*mission.call_off(self._seat.now_s))
            self._seat.report(ReturnAdvised(reason))
            self._orders.come_home(Return(reason), flavour)
        elif mission.unverified:
            self._orders.begin_holding(Hold("which mission it flies is not known"))

    def _advance_lent(self) -> None:
        """Raise the limit of jerk from its preparation on, until it is told to go home."""
        seat, work, returning = self._seat, self._work, self._work.returning
        flies_home = returning is not None and not returning.on_detour
        if work.phase is Phase.PREPARING:
            self._raises_jerk = True
        elif flies_home or not work.in_our_hands():
            self._raises_jerk = False
        if seat.lent is None:
            return
        seat.lent.want(self._raises_jerk and work.in_our_hands())
        seat.say(*seat.lent.advance(seat.now_s))
        if complaint := seat.lent.take_complaint():
            self._work.tell_caution(complaint)

    def _advance_holding(self) -> None:
        holding, heartbeat = self._work.holding, self._seat.vehicle.heartbeat
        if holding is None or heartbeat is None:
            return
        seat = self._seat
        seat.say(*holding.advance(seat.vehicle, heartbeat, seat.whereabouts, seat.now_s))
        if not holding.done and holding.failure is None:
            return
        prepare, returning, mission = (
            self._work.prepare_next,
            self._work.returning,
            self._seat.mission,
        )
        self._work.drop()
        self._work.phase = Phase.HOVERING if holding.aloft else Phase.IDLE
        if holding.failure is None and mission is not None:
            mission.stand_down()
        elif mission is not None and returning is None:
            mission.carry_on()
        if holding.failure is not None:
            failure = self._seat.in_its_words(holding.failure)
            self._seat.report(Refused(holding.order, failure))
            if prepare is not None:
                self._seat.report(Refused(prepare, failure))
            if returning is not None:
                self._work.returning, self._work.phase = returning, Phase.RETURNING
                self._seat.say(*returning.go_straight(self._seat.now_s))
        elif prepare is not None:
            self._orders.begin_preparation(prepare)
        elif returning is not None and not holding.aloft:
            self._seat.report(Home())  # it landed before it could be stopped
        else:
            self._seat.report(Held())

    def _advance_return(self) -> None:
        returning, heartbeat = self._work.returning, self._seat.vehicle.heartbeat
        if returning is None or heartbeat is None:
            return
        self._seat.say(*returning.advance(heartbeat, self._seat.now_s))
        if returning.has_begun():
            self._seat.report(ReturnBegun())
        on_ground = self._seat.vehicle.landed in (Landed.ON_GROUND, Landed.UNDEFINED)
        if not heartbeat.armed and (on_ground or returning.disarmed_long(self._seat.now_s)):
            self._work.drop()
            self._work.phase = Phase.IDLE
            self._seat.report(Home())
        elif returning.failure is not None:
            self._work.drop()
            self._work.phase = Phase.HOVERING
            failure = self._seat.in_its_words(returning.failure)
            self._seat.report(Refused(returning.order, failure))

    def _judge_target(self) -> None:
        outcome = None if self._work.target is None else self._work.target.outcome()
        if outcome is None:
            return
        if isinstance(outcome, HandedOver):
            self._work.hand_over(outcome.reason)
            return
        self._work.target = None
        self._work.phase = Phase.HOVERING
        if self._seat.mission is not None:
            self._seat.mission.wait_there()
        self._seat.report(outcome)
