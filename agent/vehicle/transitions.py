"""Which activity of one vehicle follows which: the only place that says so.

An activity follows by an order (agent.vehicle.obedience), by the end of the one before, or because
the mission on board did something by itself.
"""

from __future__ import annotations

from typing import Final

from agent.core.interface import (
    HandedOver,
    Held,
    Hold,
    Home,
    Refused,
    Return,
    ReturnAdvised,
    ReturnBegun,
    Swapped,
    VehicleReady,
)
from agent.vehicle.activity import Activity, FlightPhase, Hovering, Idle
from agent.vehicle.hand_over import HandOver, hand_over
from agent.vehicle.holding import Holding
from agent.vehicle.landing import Landing
from agent.vehicle.leg import Flying
from agent.vehicle.messages import LandedState
from agent.vehicle.obedience import (
    Searching,
    begin_holding,
    begin_preparing,
    come_home,
    go_on,
    go_to,
    refuse_return,
    return_home,
    stand_there,
)
from agent.vehicle.preparing import Preparing
from agent.vehicle.returning import Returning
from agent.vehicle.session import VehicleSession
from agent.vehicle.standing import Departing, Standing
from agent.vehicle.yielding import Yielding

_IN_THE_AIR = {
    FlightPhase.HOLDING,
    FlightPhase.RETURNING,
    FlightPhase.PREPARING,
    FlightPhase.LANDING,
}
_LET_GO = {FlightPhase.IDLE, FlightPhase.HANDED_OVER}

SUCCESSORS: Final[dict[FlightPhase, frozenset[FlightPhase]]] = {
    FlightPhase.IDLE: frozenset(
        {
            *_IN_THE_AIR,
            FlightPhase.STANDING,
            FlightPhase.HOVERING,  # found in the air, and a zone lies before its base
            FlightPhase.HANDED_OVER,
        }
    ),
    FlightPhase.PREPARING: frozenset(
        {
            FlightPhase.HOVERING,
            FlightPhase.FLYING,
            FlightPhase.STANDING,
            *_IN_THE_AIR,
            *_LET_GO,
        }
    ),
    FlightPhase.HOVERING: frozenset(
        {FlightPhase.FLYING, FlightPhase.YIELDING, *_IN_THE_AIR, *_LET_GO}
    ),
    FlightPhase.FLYING: frozenset(
        {FlightPhase.HOVERING, FlightPhase.YIELDING, *_IN_THE_AIR, *_LET_GO}
    ),
    FlightPhase.LANDING: frozenset(
        {FlightPhase.STANDING, FlightPhase.HOVERING, *_IN_THE_AIR, *_LET_GO}
    ),
    FlightPhase.YIELDING: frozenset(
        {FlightPhase.HOVERING, FlightPhase.FLYING, *_IN_THE_AIR, *_LET_GO}
    ),
    FlightPhase.STANDING: frozenset({FlightPhase.PREPARING, *_LET_GO}),
    FlightPhase.HOLDING: frozenset(
        {FlightPhase.HOVERING, FlightPhase.FLYING, FlightPhase.YIELDING, *_IN_THE_AIR, *_LET_GO}
    ),
    FlightPhase.RETURNING: frozenset(
        {FlightPhase.HOVERING, FlightPhase.FLYING, FlightPhase.YIELDING, *_IN_THE_AIR, *_LET_GO}
    ),
    FlightPhase.HANDED_OVER: frozenset(
        {FlightPhase.PREPARING, FlightPhase.RETURNING, FlightPhase.HOVERING, FlightPhase.IDLE}
    ),
}
"""What may follow which within one step: nothing is flown to that was not prepared, and a
vehicle that was handed over is neither sent anywhere nor stopped. One that an earlier life left in
the air hovers if the landing that it is found for is refused at once."""


def follow(activity: Activity, session: VehicleSession) -> Activity:
    """What comes after an activity that has ended; itself while it goes on."""
    match activity:
        case Flying():
            return _after_leg(activity, session)
        case Preparing() if activity.done or activity.failure is not None:
            return _after_preparation(activity, session)
        case Holding() if activity.done or activity.failure is not None:
            return _after_hold(activity, session)
        case Returning():
            return _after_return(activity, session)
        case Landing():
            return _after_landing(activity, session)
        case Standing():
            return _after_standing(activity, session)
        case Searching() if activity.unclear is None or activity.in_vain:
            return _after_search(activity, session)
        case HandOver(taken_back=True):
            return Hovering(session)
        case _:
            return activity


def follow_mission(activity: Activity, session: VehicleSession) -> Activity:
    """What follows from what the mission on board did by itself."""
    mission, firmware = session.mission, session.firmware
    if mission is None or firmware is None or not isinstance(activity, Hovering | Flying):
        return activity
    if mission.coming_home:
        reason = "nothing followed its last target in time, so it comes home by itself"
        session.commands.cancel_all()
        mission.call_off()
        session.report(ReturnAdvised(reason))
        return come_home(Return(reason), firmware, session)
    if mission.unverified:
        return begin_holding(activity, Hold("which mission it flies is not known"), session)
    return activity


def _after_search(search: Searching, session: VehicleSession) -> Activity:
    order, unclear = search.order, search.unclear
    if unclear is None:
        if isinstance(order, Return):
            return return_home(search, order, session)
        return _hold_found(search, order, session)
    session.commands.cancel_all()
    if isinstance(order, Return):
        return refuse_return(order, unclear, session)
    session.report(Refused(order, unclear))
    return Idle(session)


def _hold_found(search: Searching, order: Hold, session: VehicleSession) -> Activity:
    """Stop a vehicle that an earlier life left in the air."""
    firmware, heartbeat = session.firmware, session.vehicle.heartbeat
    aloft = session.vehicle.landed is not LandedState.ON_GROUND
    if firmware is None or heartbeat is None or not (heartbeat.armed and aloft):
        session.report(Held())
        return Idle(session)
    mode = heartbeat.custom_mode
    if session.flies_for_us(mode) or firmware.is_taking_off(mode):
        return begin_holding(search, order, session)
    session.report(
        Refused(
            order, f"its pilot flies it in {firmware.mode_name(mode, session.vehicle.told_modes)}"
        )
    )
    return Idle(session)


def _after_preparation(preparing: Preparing, session: VehicleSession) -> Activity:
    heartbeat, firmware, mission = session.vehicle.heartbeat, session.firmware, session.mission
    session.commands.cancel_all()
    failure = preparing.failure
    if failure is None:
        if mission is not None:
            mission.wait_there()
        if isinstance(preparing, Departing):
            return go_to(Hovering(session), preparing.next_order, session)
        session.report(VehicleReady())
        return Hovering(session)
    aloft = firmware is not None and firmware.airborne(session.vehicle)
    flies = session.vehicle.armed and aloft
    if flies and heartbeat is not None and preparing.obeys(heartbeat.custom_mode):
        session.report(ReturnAdvised(failure))  # nobody else would bring it down
        return Hovering(session)
    if mission is not None:
        mission.stand_down()  # an upload is still ended, never left half
    if isinstance(preparing, Departing):
        session.report(Refused(preparing.next_order, failure))
        return preparing.standing.again(disturbed=preparing.disturbed)
    stands = not (aloft or session.vehicle.armed)
    session.report(Refused(preparing.order, failure, stands))
    return Idle(session)


def _after_leg(flying: Flying, session: VehicleSession) -> Activity:
    outcome = flying.outcome()
    if outcome is None:
        return flying
    if isinstance(outcome, HandedOver):
        return hand_over(session, outcome.reason)
    if session.mission is not None:
        session.mission.wait_there()
    session.report(outcome)
    return Hovering(session)


def _after_hold(holding: Holding, session: VehicleSession) -> Activity:
    mission, returning, prepare = session.mission, holding.returning, holding.prepare_next
    go_next = holding.go_next
    session.commands.cancel_all()
    after = Hovering(session) if holding.aloft else Idle(session)
    if holding.yielding is not None and holding.aloft:
        return _after_stop(holding, holding.yielding, session)
    if holding.failure is not None:
        if mission is not None and returning is None:
            mission.carry_on()
        failure = session.in_its_words(holding.failure)
        session.report(Refused(go_next or holding.order, failure))
        if prepare is not None:
            session.report(Refused(prepare, failure))
        if returning is None:
            return after
        returning.go_straight()
        return returning
    if mission is not None:
        mission.stand_down()
    if prepare is not None:
        return begin_preparing(after, prepare, session)
    if go_next is not None and holding.aloft:
        return go_to(after, go_next, session)
    # It may have landed before it could be stopped.
    session.report(Home() if returning is not None and not holding.aloft else Held())
    return after


def _after_stop(holding: Holding, yielding: Yielding, session: VehicleSession) -> Activity:
    """It stands, to make room; or it could not be stopped, and goes on as it was ordered."""
    if session.mission is not None:
        session.mission.stand_down()
    wanted = yielding.wanted
    if holding.failure is not None or not (wanted.stands or wanted.path_enu_m):
        return go_on(yielding, session)
    yielding.begin()
    return yielding


def _after_landing(landing: Landing, session: VehicleSession) -> Activity:
    if landing.taken is not None:
        return hand_over(session, landing.taken)
    if landing.is_down:
        if not session.take_fence_off():
            return landing
        session.commands.cancel_all()
        return stand_there(session, landing.order, session.now_s)
    if landing.failure is not None:
        session.commands.cancel_all()
        session.report(Refused(landing.order, session.in_its_words(landing.failure)))
        return Hovering(session)
    return landing


def _after_standing(standing: Standing, session: VehicleSession) -> Activity:
    if standing.taken is not None:
        return hand_over(session, standing.taken)
    if standing.has_news():
        session.report(Swapped(standing.order.leg))
    return standing


def _after_return(returning: Returning, session: VehicleSession) -> Activity:
    if returning.has_begun():
        session.report(ReturnBegun())
    if returning.is_down:
        if not session.take_fence_off():
            return returning
        session.commands.cancel_all()
        session.report(Home())
        return Idle(session)
    if returning.failure is not None:
        session.commands.cancel_all()
        failure = session.in_its_words(returning.failure)
        session.report(Refused(returning.order, failure))
        return Hovering(session)
    return returning
