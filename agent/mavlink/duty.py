"""What one vehicle is ordered to do, and how far that is.

One thing is done at a time, each by a machine of its own: prepared, flown by legs, stopped,
brought home. Leaves out: those machines, what is heard (agent.mavlink.bridge), and how
targets stand on a vehicle (agent.mavlink.standing_mission).
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from enum import Enum

from agent.mavlink.commands import CommandEnded
from agent.mavlink.config import CommandStyle
from agent.mavlink.flavours import Flavour
from agent.mavlink.holding import Holding
from agent.mavlink.leg import Leg, RepositionLeg
from agent.mavlink.messages import Heartbeat, Inbound, Landed, Position
from agent.mavlink.mission_leg import MissionLeg
from agent.mavlink.preparation import Preparation
from agent.mavlink.returning import Returning
from agent.mavlink.seat import Seat
from agent.mavlink.standing_mission import StandingMission
from agent.vehicle import (
    Arrived,
    GoTo,
    HandedOver,
    Hold,
    Home,
    NotReady,
    Orders,
    Prepare,
    Refused,
    Return,
    ReturnAdvised,
    VehicleReady,
)
from swarm.model.frames import wgs84_from_enu

__all__ = ["Duty", "Phase"]

Point = tuple[float, float, float]

_POLL_S = 0.25
"""While something is waited for, look that often even if nothing is heard."""
_UNHEARD_TIMEOUTS = 3.0
"""A vehicle that may be in the air has that many silence timeouts to be heard at all."""


class Phase(Enum):
    """What is being done."""

    IDLE = "idle"
    PREPARING = "preparing"
    HOVERING = "hovering"
    FLYING = "flying"
    HOLDING = "being stopped"
    RETURNING = "returning"
    HANDED_OVER = "handed over"


class Duty:
    """The orders of one vehicle.

    Args:
        seat: the vehicle.
    """

    def __init__(self, seat: Seat) -> None:
        self.phase = Phase.IDLE
        self._seat = seat
        self._prepare: Prepare | None = None
        self._preparation: Preparation | None = None
        self._returning: Returning | None = None
        self._holding: Holding | None = None
        self._mission: StandingMission | None = None
        """What stands on the vehicle; None if missions are not our way to command it."""
        self._awaited: Return | Hold | None = None
        """Ordered before it was known what the vehicle does, which may be in the air."""
        self._awaited_until_s = 0.0
        self._prepare_next: Prepare | None = None
        """Ordered of a vehicle that has to be stopped first."""
        self._speed_m_s = 0.0
        """Cruise speed of the last preparation [m/s]."""
        self._order: GoTo | None = None
        self._leg: Leg | None = None
        self._told_not_ready: str | None = None

    # What the vehicle says.

    def on_message(self, message: Inbound) -> None:
        """Pass on what is no heartbeat, position or acknowledgement."""
        if self._preparation is not None:
            self._seat.say(*self._preparation.on_message(message, self._seat.now_s))
        if self._mission is not None:
            self._seat.say(*self._mission.on_message(message, self._seat.now_s))

    def on_position(self, position: Position, place_enu_m: Point) -> None:
        """Take a fresh position."""
        now_s, velocity = self._seat.now_s, position.velocity_enu_m_s
        if self._preparation is not None:
            self._seat.say(*self._preparation.on_position(position, now_s))
        if self._holding is not None:
            self._holding.on_position(position)
        if self._mission is not None:
            self._mission.on_position(place_enu_m, now_s)
        if self._leg is not None:
            self._seat.say(*self._leg.on_position(place_enu_m, velocity, now_s))
            self._judge_leg()

    def on_ended(self, ended: Sequence[CommandEnded]) -> None:
        """Take the outcomes of commands."""
        now_s = self._seat.now_s
        for one in ended:
            if self._preparation is not None:
                self._seat.say(*self._preparation.on_ended(one, now_s))
            if self._returning is not None:
                self._returning.on_ended(one, now_s)
            if self._holding is not None:
                self._holding.on_ended(one, now_s)
            if self._mission is not None:
                self._mission.on_ended(one, now_s)
            if self._leg is not None:
                self._leg.on_ended(one)
                self._judge_leg()

    def on_reboot(self) -> None:
        """The autopilot began anew."""
        if self.in_our_hands():
            self.hand_over("the autopilot rebooted")
        self._preparation = self._mission = None

    # Whose vehicle it is.

    def in_our_hands(self) -> bool:
        """Whether the vehicle is, or may be, in the air on our orders."""
        if self.phase is Phase.PREPARING:
            return self._preparation is not None and self._preparation.engaged
        return self.phase in (Phase.HOVERING, Phase.FLYING, Phase.HOLDING, Phase.RETURNING)

    def expects(self, heartbeat: Heartbeat) -> bool:
        """Whether our orders lead to that mode."""
        mode = heartbeat.custom_mode
        if self._holding is not None:
            return not heartbeat.armed or self._holding.expects(mode)
        if self._returning is not None:
            return not heartbeat.armed or self._returning.expects(mode)
        return self._obeys(mode)

    @property
    def may_disarm(self) -> bool:
        """Whether our orders may lead to stopped motors."""
        if self._holding is not None:
            return self._returning is not None or not self._holding.aloft
        return self.phase in (Phase.PREPARING, Phase.RETURNING)

    def hand_over(self, reason: str) -> None:
        """Command nothing any more."""
        self._drop_work()
        if self._mission is not None:
            self._mission.abort(reason)
        self.phase = Phase.HANDED_OVER
        self._seat.report(HandedOver(reason))

    def forget_mission(self) -> None:
        """Know nothing of what stands on the vehicle."""
        missions = self._seat.config.command is CommandStyle.MISSION
        flavour = self._seat.flavour
        self._mission = (
            StandingMission(self._seat.config, self._seat.commands, flavour)
            if missions and flavour is not None
            else None
        )

    # What is ordered.

    def obey(self, order: Orders) -> None:
        """Carry an order out, or refuse it."""
        match order:
            case Prepare():
                self._begin_preparation(order)
            case GoTo():
                self._go_to(order)
            case Hold():
                self._hold(order)
            case Return():
                self._return(order)

    def _begin_preparation(self, order: Prepare) -> None:
        if fault := self._seat.config.out_of_bounds(order.position_enu_m):
            self._seat.report(Refused(order, fault))
            return
        if not (math.isfinite(order.speed_m_s) and order.speed_m_s > 0.0):
            self._seat.report(Refused(order, f"speed {order.speed_m_s} m/s is not > 0"))
            return
        if self._must_stop_first() and not self._seat.silent:
            self._hold(Hold("to be prepared anew"))
            self._prepare_next = order
            return
        self._drop_work()
        self.forget_mission()
        self._seat.guards.begin()
        self.phase = Phase.PREPARING
        self._prepare = order
        self._speed_m_s = order.speed_m_s
        self._told_not_ready = None

    def _must_stop_first(self) -> bool:
        """Whether the vehicle flies on our orders, but takes no targets."""
        flavour, heartbeat = self._seat.flavour, self._seat.vehicle.heartbeat
        return (
            self.phase in (Phase.RETURNING, Phase.HOLDING)
            and flavour is not None
            and heartbeat is not None
            and heartbeat.armed
            and not flavour.is_commanded(heartbeat.custom_mode)
            and self._seat.vehicle.landed is not Landed.ON_GROUND
        )

    def _go_to(self, order: GoTo) -> None:
        by_mission = self._mission is not None and self._returning is None
        takes_targets = self.phase in (Phase.HOVERING, Phase.FLYING) or (
            self.phase is Phase.HOLDING and (by_mission or not self._must_stop_first())
        )
        if not takes_targets or self._seat.flavour is None:
            self._seat.report(Refused(order, f"the vehicle is {self.phase.value}"))
            return
        if fault := self._seat.config.out_of_bounds(order.position_enu_m):
            self._seat.report(Refused(order, fault))
            return
        if not (math.isfinite(order.stay_s) and order.stay_s >= 0.0):
            self._seat.report(Refused(order, f"a stay of {order.stay_s} s is not >= 0"))
            return
        if self._holding is not None:
            self._drop_work()
        self._order, self._leg = order, self._leg_to(order, self._seat.flavour)
        self.phase = Phase.FLYING
        self._seat.say(*self._leg.start(self._seat.now_s))

    def _leg_to(self, order: GoTo, flavour: Flavour) -> Leg:
        target_enu_m, config = order.position_enu_m, self._seat.config
        if self._mission is not None:
            return MissionLeg(target_enu_m, order.stay_s, self._speed_m_s, config, self._mission)
        place = wgs84_from_enu(config.origin, target_enu_m)
        message = flavour.reposition(*place, self._speed_m_s)
        return RepositionLeg(target_enu_m, message, config, self._seat.commands)

    def _hold(self, order: Hold) -> None:
        if self.phase is Phase.HANDED_OVER:
            self._seat.report(Refused(order, f"the vehicle is {self.phase.value}"))
        elif not self.in_our_hands():
            # It may fly on the orders of an earlier life, or be somebody else's.
            self._drop_work()
            self.phase = Phase.IDLE
            self._await(order)
        elif self._seat.silent:
            self._seat.report(Refused(order, "the autopilot is silent"))
        elif self._returning is None or self._seat.vehicle.armed:
            self._begin_holding(order)

    def _begin_holding(self, order: Hold) -> None:
        """Stop a vehicle that flies on our orders, or is about to."""
        flavour, heartbeat = self._seat.flavour, self._seat.vehicle.heartbeat
        if flavour is None or heartbeat is None:
            return
        took_off, returning = self._took_off(), self._returning
        on_missions = self._mission is not None and self.phase is not Phase.PREPARING
        motors_asked = self._preparation is not None and self._preparation.engaged

        def leaves(mode: int) -> bool:
            return (
                mode == heartbeat.custom_mode
                or (took_off and flavour.is_taking_off(mode))
                or (on_missions and flavour.is_mission(mode))
                or (returning is not None and flavour.is_returning(mode))
            )

        self._drop_work()
        self._returning = returning  # goes on if the vehicle cannot be stopped
        if self._mission is not None:
            self._mission.suspend()
        self._holding = Holding(
            order,
            self._seat.config,
            self._seat.commands,
            flavour,
            self._speed_m_s,
            leaves,
            motors_asked=motors_asked,
        )
        self.phase = Phase.HOLDING

    def _return(self, order: Return) -> None:
        if self.phase is Phase.RETURNING:
            return
        in_air = (Phase.HOVERING, Phase.FLYING, Phase.HOLDING)
        took_off = self.phase in in_air or self._took_off()
        motors_asked_for = self._preparation is not None and self._preparation.engaged
        flavour, heartbeat, holding = (
            self._seat.flavour,
            self._seat.vehicle.heartbeat,
            self._holding,
        )
        self._drop_work()
        self.phase = Phase.IDLE
        if flavour is None or heartbeat is None:
            if order.resume:
                self._await(order)
            else:
                self._seat.report(Home())
            return
        mode = heartbeat.custom_mode
        if self._reads_mission(heartbeat):
            self._await(order)
            return
        taking_off = flavour.is_taking_off(mode) and (took_off or order.resume)
        on_mission = self._mission is not None and (
            self._flies_for_us(mode) or (holding is not None and holding.expects(mode))
        )
        commanded = flavour.is_commanded(mode) or taking_off or on_mission
        if self._mission is not None:
            self._mission.stand_down()
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
            self._refuse_return(order, "the autopilot is silent")
        elif not (commanded or flavour.is_returning(mode)):
            self.hand_over(f"its pilot flies it in {flavour.mode_name(mode)}")
        else:
            self._come_home(order, flavour)

    def _come_home(self, order: Return, flavour: Flavour) -> None:
        self._returning = Returning(
            order,
            self._seat.config,
            self._seat.commands,
            flavour,
            from_mission=self._mission is not None,
        )
        self.phase = Phase.RETURNING

    def _refuse_return(self, order: Return, reason: str) -> None:
        self.phase = Phase.HANDED_OVER
        self._seat.report(Refused(order, reason))

    # What time brings.

    def advance(self) -> None:
        """Do what time and state ask for."""
        if not self._seat.silent:
            self._advance_mission()
        match self.phase:
            case Phase.PREPARING:
                self._advance_preparation()
            case Phase.HOLDING:
                self._advance_holding()
            case Phase.RETURNING:
                self._advance_return()
            case _ if self._awaited is not None:
                self._look_for_vehicle(self._awaited)
            case _:
                pass

    def next_deadline_s(self) -> float:
        """When `advance` may have something to do."""
        now_s, mission = self._seat.now_s, self._mission
        busy = self.phase in (Phase.PREPARING, Phase.HOLDING, Phase.RETURNING)
        starting = mission is not None and mission.is_starting
        if busy or self._awaited is not None or starting:
            return now_s + _POLL_S
        at_s = None if mission is None else mission.next_deadline_s()
        return math.inf if at_s is None else max(at_s, now_s)

    def _advance_preparation(self) -> None:
        heartbeat, order = self._seat.vehicle.heartbeat, self._prepare
        if order is None:
            return
        if (reason := self._seat.missing()) is not None:
            self._tell_not_ready(reason)
            return
        if heartbeat is None or self._seat.flavour is None:
            return
        if self._preparation is None:
            self._preparation = Preparation(
                order,
                self._seat.config,
                self._seat.commands,
                self._seat.flavour,
                self._seat.guards,
                self._mission,
            )
        preparation = self._preparation
        self._seat.say(*preparation.advance(self._seat.vehicle, heartbeat, self._seat.now_s))
        if preparation.failure is not None:
            aloft = heartbeat.armed and self._seat.flavour.airborne(self._seat.vehicle)
            obeys = self._obeys(heartbeat.custom_mode)
            self._drop_work()
            if aloft and obeys:
                self.phase = Phase.HOVERING  # nobody else would bring it down
                self._seat.report(ReturnAdvised(preparation.failure))
            else:
                self.phase = Phase.IDLE
                self._seat.report(Refused(order, preparation.failure))
        elif preparation.done:
            self._drop_work()
            self.phase = Phase.HOVERING
            self._seat.report(VehicleReady())
        else:
            self._tell_not_ready(preparation.waiting_for)

    def _tell_not_ready(self, reason: str) -> None:
        if reason != self._told_not_ready:
            self._told_not_ready = reason
            self._seat.report(NotReady(reason))

    def _await(self, order: Return | Hold) -> None:
        """Carry the order out once it is known what the vehicle does."""
        patience_s = _UNHEARD_TIMEOUTS * self._seat.config.silence_timeout_s
        self._awaited, self._awaited_until_s = order, self._seat.now_s + patience_s
        self._told_not_ready = None

    def _look_for_vehicle(self, order: Return | Hold) -> None:
        """Return or stop the vehicle once it is heard; it has this long to be."""
        reason = self._seat.missing() or self._unclear(order)
        if reason is None:
            self._awaited = None
            if isinstance(order, Return):
                self._return(order)
            else:
                self._hold_found(order)
        elif self._seat.now_s < self._awaited_until_s:
            self._tell_not_ready(reason)
        else:
            self._drop_work()
            if isinstance(order, Return):
                self._refuse_return(order, reason)
            else:
                self._seat.report(Refused(order, reason))

    def _unclear(self, order: Return | Hold) -> str | None:
        """What is still to be learned of a vehicle that is heard; None if it is enough."""
        flavour, heartbeat, mission = (
            self._seat.flavour,
            self._seat.vehicle.heartbeat,
            self._mission,
        )
        if flavour is None or heartbeat is None or not heartbeat.armed:
            return None
        if isinstance(order, Hold) and self._seat.vehicle.landed is Landed.UNDEFINED:
            return "waiting to hear whether it flies (EXTENDED_SYS_STATE)"
        if mission is not None and self._reads_mission(heartbeat):
            self._seat.say(*mission.look(self._seat.now_s))
            return "reading the mission that the vehicle flies"
        return None

    def _reads_mission(self, heartbeat: Heartbeat) -> bool:
        """Whether the vehicle flies a mission of which it is not known whose it is."""
        return (
            self._seat.flavour is not None
            and self._mission is not None
            and heartbeat.armed
            and self._seat.flavour.is_mission(heartbeat.custom_mode)
            and self._mission.is_ours is None
            and not self._flies_for_us(heartbeat.custom_mode)
        )

    def _hold_found(self, order: Hold) -> None:
        """Stop a vehicle that an earlier life left in the air."""
        flavour, heartbeat = self._seat.flavour, self._seat.vehicle.heartbeat
        aloft = self._seat.vehicle.landed is not Landed.ON_GROUND
        if flavour is None or heartbeat is None or not (heartbeat.armed and aloft):
            return
        mode = heartbeat.custom_mode
        if self._flies_for_us(mode) or flavour.is_taking_off(mode):
            self._begin_holding(order)
        else:
            name = flavour.mode_name(mode)
            self._seat.report(Refused(order, f"its pilot flies it in {name}"))

    def _advance_mission(self) -> None:
        mission, flavour = self._mission, self._seat.flavour
        heartbeat, heard_s = self._seat.vehicle.heartbeat, self._seat.vehicle.heartbeat_at_s
        if mission is None or flavour is None or heartbeat is None or heard_s is None:
            return
        self._seat.say(*mission.advance(heartbeat, heard_s, self._seat.now_s))
        self._judge_leg()
        if self.phase not in (Phase.HOVERING, Phase.FLYING):
            return
        if mission.coming_home:
            reason = "nothing followed its last target in time, so it comes home by itself"
            self._drop_work()
            mission.stand_down()
            self._seat.report(ReturnAdvised(reason))
            self._come_home(Return(reason), flavour)
        elif mission.unverified:
            self._begin_holding(Hold("which mission it flies is not known"))

    def _advance_holding(self) -> None:
        holding, heartbeat = self._holding, self._seat.vehicle.heartbeat
        if holding is None or heartbeat is None:
            return
        self._seat.say(*holding.advance(self._seat.vehicle, heartbeat, self._seat.now_s))
        if not holding.done and holding.failure is None:
            return
        prepare, returning, mission = self._prepare_next, self._returning, self._mission
        self._drop_work()
        self.phase = Phase.HOVERING if holding.aloft else Phase.IDLE
        if holding.failure is None and mission is not None:
            mission.stand_down()
        elif mission is not None and returning is None:
            mission.carry_on()
        if holding.failure is not None:
            self._seat.report(Refused(holding.order, holding.failure))
            if prepare is not None:
                self._seat.report(Refused(prepare, holding.failure))
            if returning is not None:
                self._returning, self.phase = returning, Phase.RETURNING
        elif prepare is not None:
            self._begin_preparation(prepare)

    def _advance_return(self) -> None:
        returning, heartbeat = self._returning, self._seat.vehicle.heartbeat
        if returning is None or heartbeat is None:
            return
        self._seat.say(*returning.advance(heartbeat, self._seat.now_s))
        on_ground = self._seat.vehicle.landed in (Landed.ON_GROUND, Landed.UNDEFINED)
        if not heartbeat.armed and (on_ground or returning.disarmed_long(self._seat.now_s)):
            self._drop_work()
            self.phase = Phase.IDLE
            self._seat.report(Home())
        elif returning.failure is not None:
            self._drop_work()
            self.phase = Phase.HOVERING
            self._seat.report(Refused(returning.order, returning.failure))

    # Keeping the books.

    def _judge_leg(self) -> None:
        leg, order = self._leg, self._order
        if leg is None or order is None:
            return
        if leg.arrived:
            self._end_leg()
            self._seat.report(Arrived(order.leg))
        elif leg.failure is not None:
            self._end_leg()
            text = self._seat.vehicle.recent_warning(self._seat.now_s)
            reason = f"{leg.failure}: {text}" if text else leg.failure
            self._seat.report(Refused(order, reason))

    def _end_leg(self) -> None:
        self._leg = self._order = None
        self.phase = Phase.HOVERING
        if self._mission is not None:
            self._mission.wait_there()

    def _flies_for_us(self, custom_mode: int) -> bool:
        """Whether that mode is our doing, as far as targets go."""
        if self._mission is not None:
            return self._mission.expects(custom_mode, self._seat.now_s)
        return self._seat.flavour is not None and self._seat.flavour.is_commanded(custom_mode)

    def _obeys(self, custom_mode: int) -> bool:
        """Whether the vehicle takes our orders in that mode, be it still taking off on one."""
        flavour = self._seat.flavour
        return flavour is not None and (
            self._flies_for_us(custom_mode)
            or (flavour.is_taking_off(custom_mode) and self._took_off())
        )

    def _took_off(self) -> bool:
        """Whether the preparation under way has asked for takeoff."""
        return self._preparation is not None and self._preparation.took_off

    def _drop_work(self) -> None:
        """Give up whatever is under way; nothing is sent about it any more."""
        self._leg = self._order = None
        self._prepare = self._preparation = self._prepare_next = None
        self._returning = self._holding = self._awaited = None
        self._seat.commands.cancel_all()
