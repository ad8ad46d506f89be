"""What an order begins, or why it is refused.

An order of a vehicle of which nothing is known yet waits for a search (agent.mavlink.search).
Leaves out: how what was begun goes on (agent.mavlink.duty).
"""

from __future__ import annotations

import math

from agent.mavlink.config import BridgeConfig
from agent.mavlink.flavours import Flavour
from agent.mavlink.holding import Holding, modes_left
from agent.mavlink.homeward import Homeward
from agent.mavlink.messages import Landed
from agent.mavlink.returning import Returning
from agent.mavlink.search import Search
from agent.mavlink.seat import Seat
from agent.mavlink.target import Target
from agent.mavlink.work import Phase, Work
from agent.vehicle import GoTo, Held, Hold, Home, Orders, Prepare, Refused, Return

__all__ = ["OrderTaker"]


class OrderTaker:
    """Takes the orders of one vehicle.

    Args:
        seat: the vehicle.
        work: what they begin.
    """

    def __init__(self, seat: Seat, work: Work) -> None:
        self._seat = seat
        self._work = work

    def obey(self, order: Orders) -> None:
        """Carry an order out, or refuse it."""
        match order:
            case Prepare():
                self.begin_preparation(order)
            case GoTo():
                self._go_to(order)
            case Hold():
                self._hold(order)
            case Return():
                self.return_home(order)

    def begin_preparation(self, order: Prepare) -> None:
        """Prepare a vehicle for flight; one that takes no targets is stopped first."""
        work = self._work
        if fault := _fault_of(order, self._seat.config):
            self._seat.report(Refused(order, fault))
            return
        if self._must_stop_first() and not self._seat.silent:
            self._hold(Hold("to be prepared anew"))
            work.prepare_next = order
            return
        ours = work.in_our_hands()
        work.drop()
        self._seat.forget_mission()
        self._seat.guards.begin()
        work.phase = Phase.PREPARING
        work.prepare, work.prepares_ours = order, ours
        work.speed_m_s = order.speed_m_s
        work.sent_to_enu_m.append(order.position_enu_m)
        work.tell_anew()

    def _must_stop_first(self) -> bool:
        """Whether the vehicle flies on our orders, but takes no targets."""
        flavour, heartbeat = self._seat.flavour, self._seat.vehicle.heartbeat
        return (
            self._work.phase in (Phase.RETURNING, Phase.HOLDING)
            and flavour is not None
            and heartbeat is not None
            and heartbeat.armed
            and not flavour.is_commanded(heartbeat.custom_mode)
            and self._seat.vehicle.landed is not Landed.ON_GROUND
        )

    def _go_to(self, order: GoTo) -> None:
        work = self._work
        by_mission = self._seat.mission is not None and work.returning is None
        takes_targets = work.phase in (Phase.HOVERING, Phase.FLYING) or (
            work.phase is Phase.HOLDING and (by_mission or not self._must_stop_first())
        )
        if not takes_targets or self._seat.flavour is None:
            self._seat.report(Refused(order, f"the vehicle is {work.phase.value}"))
            return
        if fault := _fault_of(order, self._seat.config):
            self._seat.report(Refused(order, fault))
            return
        if work.holding is not None:
            work.drop()
        work.target = Target(order, self._seat, self._seat.flavour, work.speed_m_s)
        work.phase = Phase.FLYING
        work.sent_to_enu_m.append(order.position_enu_m)
        work.target.start()

    def _hold(self, order: Hold) -> None:
        work = self._work
        if work.phase is Phase.HANDED_OVER:
            self._seat.report(Refused(order, f"the vehicle is {work.phase.value}"))
        elif not work.in_our_hands():
            # It may fly on the orders of an earlier life, or be somebody else's.
            work.drop()
            work.phase = Phase.IDLE
            self._look_first(order)
        elif self._seat.silent:
            self._seat.report(Refused(order, "the autopilot is silent"))
        elif work.returning is None or self._seat.vehicle.armed:
            self.begin_holding(order)

    def begin_holding(self, order: Hold) -> None:
        """Stop a vehicle that flies on our orders, or is about to."""
        work = self._work
        flavour, heartbeat = self._seat.flavour, self._seat.vehicle.heartbeat
        if flavour is None or heartbeat is None:
            return
        took_off, returning = work.took_off(), work.returning
        motors_asked = work.preparation is not None and work.preparation.engaged
        leaves = modes_left(
            flavour,
            heartbeat.custom_mode,
            took_off=took_off,
            on_missions=self._seat.mission is not None
            and (work.phase is not Phase.PREPARING or self._seat.mission.may_be_flown),
            returning=returning is not None,
        )
        work.drop()
        work.returning = returning  # goes on if the vehicle cannot be stopped
        if self._seat.mission is not None:
            self._seat.mission.suspend()
        work.holding = Holding(
            order,
            self._seat.config,
            self._seat.commands,
            flavour,
            work.speed_m_s,
            leaves,
            motors_asked=motors_asked,
        )
        work.phase = Phase.HOLDING

    def return_home(self, order: Return) -> None:
        """Bring a vehicle home, unless it is down, somebody else's, or not known well enough."""
        work = self._work
        if work.phase is Phase.RETURNING:
            if order.via_enu_m is None and work.returning is not None:
                self._seat.say(*work.returning.go_straight(self._seat.now_s))
            return
        in_air = (Phase.HOVERING, Phase.FLYING, Phase.HOLDING)
        took_off = work.phase in in_air or work.took_off()
        motors_asked_for = work.preparation is not None and work.preparation.engaged
        flavour, heartbeat, holding = (
            self._seat.flavour,
            self._seat.vehicle.heartbeat,
            work.holding,
        )
        work.drop()
        work.phase = Phase.IDLE
        if flavour is None or heartbeat is None:
            if order.resume:
                self._look_first(order)
            else:
                self._seat.report(Home())
            return
        mode = heartbeat.custom_mode
        if self._seat.flies_unknown_mission():
            self._look_first(order)
            return
        taking_off = flavour.is_taking_off(mode) and (took_off or order.resume)
        on_mission = self._seat.mission is not None and (
            self._seat.flies_for_us(mode) or (holding is not None and holding.expects(mode))
        )
        commanded = flavour.is_commanded(mode) or taking_off or on_mission
        if self._seat.mission is not None:
            self._seat.say(*self._seat.mission.call_off(self._seat.now_s))
        aloft = heartbeat.armed and (took_off or flavour.airborne(self._seat.vehicle) is not False)
        if not aloft:
            # That it was armed may not have been heard yet.
            if commanded and (heartbeat.armed or motors_asked_for):
                self._seat.say(
                    *self._seat.commands.send("disarm", flavour.disarm(), self._seat.now_s)
                )
            self._seat.report(Home())
            return
        if self._seat.silent:
            self.refuse_return(order, "the autopilot is silent")
        elif not (commanded or flavour.is_returning(mode)):
            work.hand_over(f"its pilot flies it in {flavour.mode_name(mode)}")
        else:
            self.come_home(order, flavour)

    def come_home(self, order: Return, flavour: Flavour) -> None:
        """Bring home a vehicle that flies and obeys, or returns already."""
        self._work.returning = Returning(
            order,
            self._seat.config,
            self._seat.commands,
            flavour,
            from_mission=self._seat.mission is not None,
            homeward=self._homeward(order, flavour),
        )
        self._work.phase = Phase.RETURNING

    def _homeward(self, order: Return, flavour: Flavour) -> Homeward | None:
        """The way to where the order says to fly first; None if there is none to be taken."""
        seat, via_enu_m = self._seat, order.via_enu_m
        heartbeat, config = seat.vehicle.heartbeat, seat.config
        place_enu_m = seat.whereabouts.place_m(seat.now_s - config.stream_timeout_s)
        if via_enu_m is None or heartbeat is None or place_enu_m is None:
            return None
        mode = heartbeat.custom_mode
        obeys = flavour.is_commanded(mode) or flavour.is_mission(mode)
        if not (obeys and flavour.airborne(seat.vehicle)) or config.out_of_bounds(via_enu_m):
            return None
        return Homeward(
            via_enu_m,
            place_enu_m,
            self._work.speed_m_s,
            config,
            seat.commands,
            flavour,
            seat.now_s,
        )

    def refuse_return(self, order: Return, reason: str) -> None:
        """Say that it cannot be brought home, and leave it alone."""
        self._work.phase = Phase.HANDED_OVER
        self._seat.report(Refused(order, reason))

    def _look_first(self, order: Return | Hold) -> None:
        """Carry the order out once it is known what the vehicle does."""
        self._work.search = Search(order, self._seat)
        self._work.tell_anew()

    def hold_found(self, order: Hold) -> None:
        """Stop a vehicle that an earlier life left in the air."""
        flavour, heartbeat = self._seat.flavour, self._seat.vehicle.heartbeat
        aloft = self._seat.vehicle.landed is not Landed.ON_GROUND
        if flavour is None or heartbeat is None or not (heartbeat.armed and aloft):
            self._seat.report(Held())
            return
        mode = heartbeat.custom_mode
        if self._seat.flies_for_us(mode) or flavour.is_taking_off(mode):
            self.begin_holding(order)
        else:
            name = flavour.mode_name(mode)
            self._seat.report(Refused(order, f"its pilot flies it in {name}"))


def _fault_of(order: Prepare | GoTo, config: BridgeConfig) -> str | None:
    """Why an order must not be carried out, in words; None if it may be."""
    if fault := config.out_of_bounds(order.position_enu_m):
        return fault
    match order:
        case Prepare(speed_m_s=speed_m_s) if not (math.isfinite(speed_m_s) and speed_m_s > 0.0):
            return f"speed {speed_m_s} m/s is not > 0"
        case GoTo(stay_s=stay_s) if not (math.isfinite(stay_s) and stay_s >= 0.0):
            return f"a stay of {stay_s} s is not >= 0"
        case _:
            return None
