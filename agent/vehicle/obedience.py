"""How one vehicle's orders are obeyed: which activity begins with each, or why none does.

An order that cannot be carried out is refused, and one for a vehicle of which nothing is known yet
waits until it has been looked at. Leaves out: what follows once an activity has ended
(agent.vehicle.transitions).
"""

from __future__ import annotations

import math

from agent.core.interface import (
    GiveWay,
    GoTo,
    Held,
    Hold,
    Home,
    KeepOut,
    Landed,
    Prepare,
    Ready,
    Refused,
    Return,
    Swap,
    VehicleOrder,
)
from agent.vehicle.activity import Activity, FlightPhase, Hovering, Idle
from agent.vehicle.config import BridgeConfig
from agent.vehicle.firmware.profile import Firmware
from agent.vehicle.hand_over import HandOver, hand_over
from agent.vehicle.holding import Holding, modes_to_leave
from agent.vehicle.landing import Landing
from agent.vehicle.leg import Flying
from agent.vehicle.messages import LandedState
from agent.vehicle.preparing import Preparing
from agent.vehicle.returning import Returning, ReturnVia
from agent.vehicle.session import VehicleSession
from agent.vehicle.standing import Departing, Standing
from agent.vehicle.yielding import HOLD, Yielding, gives_way, pending_of, set_pace

_UNHEARD_TIMEOUTS = 3.0
"""A vehicle that may be in the air has that many silence timeouts to be heard at all."""


class Searching(Activity):
    """Finds out what there is to know before an order can be carried out.

    Args:
        order: to be carried out then.
    """

    phase = FlightPhase.IDLE
    polls = True
    in_our_hands = False

    def __init__(self, session: VehicleSession, order: Return | Hold) -> None:
        super().__init__(session)
        self.order = order
        self.unclear: str | None = "not looked at yet"
        """What is still to be learned, in words; None if it is enough."""
        self.in_vain = False
        """The vehicle has had its time."""
        self._until_s = session.now_s + _UNHEARD_TIMEOUTS * session.config.silence_timeout_s
        session.tell_anew()

    def advance(self) -> None:
        """Look, and say what is waited for."""
        self.unclear = self._session.missing() or self._doubt()
        self.in_vain = self.unclear is not None and self._session.now_s >= self._until_s
        if self.unclear is not None and not self.in_vain:
            self._session.tell_not_ready(self.unclear)

    def _doubt(self) -> str | None:
        session = self._session
        if not session.vehicle.armed:
            return None
        if isinstance(self.order, Hold) and session.vehicle.landed is LandedState.UNDEFINED:
            return "waiting to hear whether it flies (EXTENDED_SYS_STATE)"
        if session.mission is not None and session.flies_unknown_mission():
            session.mission.look()
            return "reading the mission that the vehicle flies"
        return None


def obey(activity: Activity, order: VehicleOrder, session: VehicleSession) -> Activity:
    """Carry an order out, or refuse it."""
    if isinstance(order, Prepare | Swap | Hold | Return):
        set_pace(session, None)
        session.comes_back_into_zone = False
    match order:
        case GiveWay():
            return give_way(activity, order, session)
        case Prepare():
            return begin_preparing(activity, order, session)
        case GoTo():
            return go_to(activity, order, session)
        case Hold():
            return _hold(activity, order, session)
        case Return():
            return return_home(activity, order, session)
        case Swap():
            return _land(activity, order, session)
        case Ready(leg):
            if isinstance(activity, Standing) and activity.order.leg == leg:
                activity.let_start()
            return activity
        case KeepOut(zones, margin_m):
            session.keep_out(zones, margin_m)
            return activity


def begin_preparing(activity: Activity, order: Prepare, session: VehicleSession) -> Activity:
    """Prepare a vehicle for flight; one that takes no targets is stopped first."""
    if isinstance(activity, Standing):
        session.report(Refused(order, "it stands at its base, and is sent off from there"))
        return activity
    if fault := _fault_of(order, session.config):
        session.report(Refused(order, fault))
        return activity
    if _must_stop_first(activity, session) and not session.silent:
        return begin_holding(activity, Hold("to be prepared anew"), session, prepare_next=order)
    ours = activity.in_our_hands
    session.commands.cancel_all()
    session.forget_mission()
    session.safety.begin()
    session.awaits_turn = False
    session.cruise_speed_m_s = order.speed_m_s
    session.planned_m_s2 = order.acceleration_m_s2
    session.told_motors = order.begun
    session.sent_to_enu_m.append(order.position_enu_m)
    session.tell_anew()
    return Preparing(session, order, ours=ours)


def _must_stop_first(activity: Activity, session: VehicleSession) -> bool:
    """Whether the vehicle flies on our orders, but takes no targets."""
    firmware, heartbeat = session.firmware, session.vehicle.heartbeat
    return (
        isinstance(activity, Returning | Holding)
        and firmware is not None
        and heartbeat is not None
        and heartbeat.armed
        and not firmware.is_commanded(heartbeat.custom_mode)
        and session.vehicle.landed is not LandedState.ON_GROUND
    )


def go_to(activity: Activity, order: GoTo, session: VehicleSession) -> Activity:
    """Fly somewhere, from the ground if the vehicle stands ready there."""
    match activity:
        case Standing(is_ready=True):
            return _depart(activity, order, session)
        case Departing():
            if fault := _fault_of(order, session.config) or _way_fault(order, session):
                session.report(Refused(order, fault))
            else:
                activity.next_order = order
            return activity
        case Yielding() | Holding(yielding=Yielding()):
            return _go_on_there(activity, order, session)
        case Hovering() | Flying():
            takes_targets = True
        case Holding(returning=None) if session.mission is not None:
            takes_targets = True
        case Returning(flies_by_place=False):
            takes_targets = False
        case Holding() | Returning():
            takes_targets = not _must_stop_first(activity, session)
        case _:
            takes_targets = False
    if not takes_targets or session.firmware is None:
        session.report(Refused(order, f"the vehicle is {activity.phase.value}"))
        return activity
    if fault := _fault_of(order, session.config) or _way_fault(order, session):
        session.report(Refused(order, fault))
        return activity
    if _must_stand_first(activity, order, session):
        return begin_holding(
            activity, Hold("to be sent round corners or zones"), session, go_next=order
        )
    if isinstance(activity, Holding | Returning):
        session.commands.cancel_all()
    session.comes_back_into_zone = _stops_in_zone(order, session)
    flying = Flying(session, session.firmware, order)
    session.sent_to_enu_m.append(order.position_enu_m)
    flying.start()
    return flying


def _go_on_there(activity: Activity, order: GoTo, session: VehicleSession) -> Activity:
    """Take an order for when the vehicle has made room."""
    yielding = activity.yielding if isinstance(activity, Holding) else activity
    if fault := _fault_of(order, session.config) or _way_fault(order, session):
        session.report(Refused(order, fault))
    elif isinstance(yielding, Yielding):
        yielding.pending = order
    return activity


def give_way(activity: Activity, order: GiveWay, session: VehicleSession) -> Activity:
    """Make room for another UAV, or go on; whoever can't be interrupted goes on in any case."""
    firmware = session.firmware
    if isinstance(activity, Preparing):
        session.awaits_turn = order.stands
        return activity
    if isinstance(activity, Holding) and activity.yielding is not None:
        activity.yielding.wanted = order  # it is being stopped: what is wanted follows
        return activity
    if firmware is None or not gives_way(activity) or session.silent:
        return activity
    set_pace(session, order.speed_m_s)
    if not (order.stands or order.path_enu_m):
        return go_on(activity, session) if isinstance(activity, Yielding) else activity
    yielding = Yielding(session, firmware, pending_of(activity, session), order)
    heartbeat = session.vehicle.heartbeat
    commanded = heartbeat is not None and firmware.is_commanded(heartbeat.custom_mode)
    if order.stands or not commanded or not (session.mission is None or _is_by_target(activity)):
        return begin_holding(activity, HOLD, session, yielding=yielding)
    session.commands.cancel_all()
    yielding.begin()
    return yielding


def _is_by_target(activity: Activity) -> bool:
    """Whether no mission of ours is flown, or about to be."""
    return isinstance(activity, Yielding | Returning)


def go_on(yielding: Yielding, session: VehicleSession) -> Activity:
    """There is room: obey what was ordered before, or since."""
    session.commands.cancel_all()
    after = Hovering(session)
    match yielding.pending:
        case GoTo() as order:
            return go_to(after, order, session)
        case Return() as order:
            return return_home(after, order, session)
        case None:
            return after


def _must_stand_first(activity: Activity, order: GoTo, session: VehicleSession) -> bool:
    """Whether it must fly no mission while it is given one, nor be turned before it stands.

    It might go on with the item of the same number, which may lie anywhere on the way round. And
    what can't brake before a zone is elsewhere by the time that it turns: from there the way may
    lead through.
    """
    mission, heartbeat, firmware = session.mission, session.vehicle.heartbeat, session.firmware
    if session.slides_into_zone() and not _stops_in_zone(order, session):
        return True
    if mission is None or heartbeat is None or firmware is None or isinstance(activity, Holding):
        return False
    if firmware.missions_begin_anew:
        return False
    in_mission = firmware.is_mission(heartbeat.custom_mode) or mission.may_be_flown
    return in_mission and (bool(order.via_enu_m) or mission.has_corners)


def _way_fault(order: GoTo, session: VehicleSession) -> str | None:
    """Why the way there must not be flown, in words; None if it may be."""
    if _stops_in_zone(order, session):
        return None
    way_enu_m = (*order.via_enu_m, order.position_enu_m)
    faults = (session.config.out_of_bounds(corner) for corner in order.via_enu_m)
    return next(filter(None, faults), None) or session.way_objection(way_enu_m)


def _stops_in_zone(order: GoTo, session: VehicleSession) -> bool:
    return not order.via_enu_m and session.stops_in_zone(order.position_enu_m)


def _depart(standing: Standing, order: GoTo, session: VehicleSession) -> Activity:
    """Take off from a base, and then fly there."""
    fault = _fault_of(order, session.config) or _way_fault(order, session)
    if session.cruise_speed_m_s <= 0.0:
        fault = fault or "its cruise speed is not known"
    if fault:
        session.report(Refused(order, fault))
        return standing
    session.commands.cancel_all()
    session.forget_mission()
    session.safety.begin()
    session.awaits_turn = False
    session.tell_anew()
    return Departing(session, standing, order)


def _land(activity: Activity, order: Swap, session: VehicleSession) -> Activity:
    """Land a vehicle for another battery, or see that it stands."""
    if fault := session.config.out_of_bounds(order.position_enu_m):
        session.report(Refused(order, fault))
        return activity
    session.cruise_speed_m_s = order.speed_m_s or session.cruise_speed_m_s
    match activity:
        case HandOver():
            session.report(Refused(order, f"the vehicle is {activity.phase.value}"))
            return activity
        case Standing():
            since_s, may_start = activity.since_s, activity.may_start
            return stand_there(session, order, since_s, may_start=may_start)
        case _:
            ours = activity.in_our_hands
    session.commands.cancel_all()
    if session.mission is not None and ours:
        session.mission.call_off()
    return Landing(session, order, ours=ours)


def stand_there(
    session: VehicleSession, order: Swap, since_s: float, *, may_start: bool = False
) -> Standing:
    """It has landed for another battery."""
    session.abort_fence()
    session.report(Landed(order.leg))
    return Standing(session, order, since_s, may_start=may_start)


def _hold(activity: Activity, order: Hold, session: VehicleSession) -> Activity:
    if isinstance(activity, Standing):
        session.report(Held())
    elif isinstance(activity, HandOver):
        session.report(Refused(order, f"the vehicle is {activity.phase.value}"))
    elif not activity.in_our_hands:
        # It may fly on the orders of an earlier life, or be somebody else's.
        session.commands.cancel_all()
        return Searching(session, order)
    elif session.silent:
        session.report(Refused(order, "the autopilot is silent"))
    elif session.vehicle.armed or _return_under_way(activity) is None:
        return begin_holding(activity, order, session)
    return activity


def _return_under_way(activity: Activity) -> Returning | None:
    """The return that is carried out, or would go on if the vehicle could not be stopped."""
    match activity:
        case Returning():
            return activity
        case Holding(returning=returning):
            return returning
        case _:
            return None


def begin_holding(
    activity: Activity,
    order: Hold,
    session: VehicleSession,
    prepare_next: Prepare | None = None,
    go_next: GoTo | None = None,
    yielding: Yielding | None = None,
) -> Activity:
    """Stop a vehicle that flies on our orders, or is about to."""
    firmware, heartbeat, mission = session.firmware, session.vehicle.heartbeat, session.mission
    if firmware is None or heartbeat is None:
        return activity
    preparing = isinstance(activity, Preparing)
    returning = _return_under_way(activity)
    leaves = modes_to_leave(
        firmware,
        heartbeat.custom_mode,
        took_off=activity.took_off,
        on_missions=mission is not None and (not preparing or mission.may_be_flown),
        returning=returning is not None,
    )
    session.commands.cancel_all()
    if mission is not None:
        mission.suspend()
    return Holding(
        session,
        firmware,
        order,
        leaves,
        motors_asked=preparing and activity.in_our_hands,
        returning=None if yielding is not None else returning,
        prepare_next=prepare_next,
        go_next=go_next,
        yielding=yielding,
    )


def return_home(activity: Activity, order: Return, session: VehicleSession) -> Activity:
    """Bring a vehicle home, unless it is down, somebody else's, or not known well enough."""
    firmware, heartbeat, mission = session.firmware, session.vehicle.heartbeat, session.mission
    if isinstance(activity, Returning):
        in_field = order.path_enu_m or order.land or session.guard
        if order.via_enu_m is None:
            activity.go_straight()
        elif in_field and firmware is not None:
            via = _return_via(order, firmware, session)
            if via is not None:
                activity.go_by(order, via)
        return activity
    yielding = activity.yielding if isinstance(activity, Holding) else activity
    if isinstance(yielding, Yielding) and order.via_enu_m is not None:
        yielding.pending = order
        return activity
    session.commands.cancel_all()
    if isinstance(activity, Standing):
        session.report(Home())
        return Idle(session)
    if firmware is None or heartbeat is None:
        if order.resume:
            return Searching(session, order)
        session.report(Home())
        return Idle(session)
    if session.flies_unknown_mission():
        return Searching(session, order)
    mode = heartbeat.custom_mode
    flew = isinstance(activity, Hovering | Flying | Holding | Landing | Yielding)
    took_off = activity.took_off or flew
    taking_off = firmware.is_taking_off(mode) and (took_off or order.resume)
    on_mission = mission is not None and (
        session.flies_for_us(mode)
        or (isinstance(activity, Holding) and activity.expects_mode(mode))
    )
    commanded = firmware.is_commanded(mode) or taking_off or on_mission
    if mission is not None:
        mission.call_off()
    if not (heartbeat.armed and (took_off or firmware.airborne(session.vehicle) is not False)):
        # That it was armed may not have been heard yet.
        motors_asked = isinstance(activity, Preparing) and activity.in_our_hands
        if commanded and (heartbeat.armed or motors_asked):
            session.send("disarm", firmware.disarm())
        session.take_fence_off()  # begins at once, and ends if there is time for it
        session.report(Home())
        return Idle(session)
    if session.silent:
        return refuse_return(order, "the autopilot is silent", session)
    if not (commanded or firmware.is_returning(mode)):
        return hand_over(
            session, f"its pilot flies it in {firmware.mode_name(mode, session.vehicle.told_modes)}"
        )
    return come_home(order, firmware, session)


def come_home(order: Return, firmware: Firmware, session: VehicleSession) -> Activity:
    """Bring home a vehicle that flies and obeys, or returns already."""
    return Returning(session, firmware, order, _return_via(order, firmware, session))


def _return_via(order: Return, firmware: Firmware, session: VehicleSession) -> ReturnVia | None:
    """The way to where the order says to fly first; None if there is none to be taken."""
    heartbeat, config, via_enu_m = session.vehicle.heartbeat, session.config, order.via_enu_m
    place_enu_m = session.position_filter.place_m(session.now_s - config.stream_timeout_s)
    if via_enu_m is None or heartbeat is None or place_enu_m is None:
        return None
    mode = heartbeat.custom_mode
    obeys = firmware.is_commanded(mode) or firmware.is_mission(mode)
    if not (obeys and firmware.airborne(session.vehicle)) or config.out_of_bounds(via_enu_m):
        return None
    way_enu_m = (*order.path_enu_m, via_enu_m)
    if any(map(config.out_of_bounds, order.path_enu_m)) or session.way_objection(way_enu_m):
        return None
    return ReturnVia(session, firmware, way_enu_m, place_enu_m)


def refuse_return(order: Return, reason: str, session: VehicleSession) -> Activity:
    """Say that it cannot be brought home, and leave it alone."""
    session.abort_fence()
    session.report(Refused(order, reason))
    return HandOver(session)


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
