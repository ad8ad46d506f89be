"""A vehicle leaves the way of another UAV, and goes on as it was ordered.

In the air it is stopped as by a hold, or flies to a place aside by targets, be it commanded by
missions or not; what it was ordered is kept meanwhile, with what is left of its way, and is obeyed
anew afterwards. Slower is told by a change of speed. Leaves out: when that is needed
(swarm.separation.tactical).
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace
from itertools import pairwise

from agent.core.interface import GiveWay, GoTo, Hold, Return
from agent.vehicle.activity import Activity, FlightPhase, Hovering
from agent.vehicle.commands import CommandEnded
from agent.vehicle.firmware.profile import Firmware
from agent.vehicle.leg import Flying, RepositionLeg, reposition_leg
from agent.vehicle.messages import Inbound, Position
from agent.vehicle.returning import Returning
from agent.vehicle.session import VehicleSession
from swarm.protocol.fields import Point

HOLD = Hold("to give way to another UAV")
_PACE_TAG = "pace"
_FLOWN_M = 6.0
"""A corner that near counts as flown; vehicles cut them."""


class Yielding(Activity):
    """Makes room for another UAV: hovers, or flies aside and hovers there.

    Args:
        pending: what it goes on with; None: it hovered.
        wanted: how it makes room.
    """

    phase = FlightPhase.YIELDING

    def __init__(
        self,
        session: VehicleSession,
        firmware: Firmware,
        pending: GoTo | Return | None,
        wanted: GiveWay,
    ) -> None:
        super().__init__(session)
        self.pending = pending
        self.wanted = wanted
        self._firmware = firmware
        self._leg: RepositionLeg | None = None

    @property
    def trigger_m(self) -> float | None:
        """It takes no pictures aside of its line."""
        pending = self.pending
        return None if not isinstance(pending, GoTo) or pending.trigger_m is None else 0.0

    def begin(self) -> None:
        """The vehicle takes targets: fly aside, if that is wanted."""
        self._leg = None
        path, session = self.wanted.path_enu_m, self._session
        if not path:
            return
        if any(map(session.config.out_of_bounds, path)) or session.way_objection(path):
            return  # it hovers; who advised it finds out that it does not move
        speed_m_s = session.cruise_speed_m_s
        insists = not self._firmware.pilots_stop_it_there
        self._leg = reposition_leg(session, self._firmware, path, speed_m_s, insists=insists)
        session.sent_to_enu_m.append(path[-1])
        self._leg.start()

    def on_ended(self, ended: CommandEnded) -> None:
        """Take the outcome of a command."""
        if self._leg is not None:
            self._leg.on_ended(ended)

    def on_message(self, message: Inbound) -> None:
        """Take what the vehicle says of where it is to go."""
        if self._leg is not None:
            self._leg.on_message(message)

    def on_position(self, position: Position) -> None:
        """Turn at corners of the way aside."""
        if self._leg is not None and self._leg.failure is None:
            self._leg.on_position(position)


def pending_of(activity: Activity, session: VehicleSession) -> GoTo | Return | None:
    """What an activity goes on with after it has made room, from where the vehicle is."""
    place_enu_m = session.known_place_m()
    match activity:
        case Yielding(pending=pending):
            return pending
        case Flying(order=order):
            ahead = _ahead(place_enu_m, (*order.via_enu_m, order.position_enu_m))
            return replace(order, via_enu_m=ahead[:-1])
        case Returning(order=Return(via_enu_m=via_enu_m) as order) if via_enu_m is not None:
            ahead = _ahead(place_enu_m, (*order.path_enu_m, via_enu_m))
            return replace(order, path_enu_m=ahead[:-1])
        case _:
            return None


def gives_way(activity: Activity) -> bool:
    """Whether the vehicle is in the middle of what can be interrupted."""
    match activity:
        case Flying() | Hovering() | Yielding():
            return True
        case Returning():
            return activity.flies_by_place
        case _:
            return False


def set_pace(session: VehicleSession, speed_m_s: float | None) -> None:
    """Fly what is flown no faster than that; None, or no speed at all: at cruise speed again."""
    if speed_m_s is not None and not 0.0 < speed_m_s < session.cruise_speed_m_s:
        speed_m_s = None
    if speed_m_s == session.pace_m_s or session.firmware is None:
        return
    session.pace_m_s = speed_m_s
    told_m_s = session.cruise_speed_m_s if speed_m_s is None else speed_m_s
    if told_m_s > 0.0:
        session.send(_PACE_TAG, session.firmware.change_speed(told_m_s))


def _ahead(place_enu_m: Point | None, way: Sequence[Point]) -> tuple[Point, ...]:
    """What is left of a way, by the piece of it that is nearest; its end in any case."""
    if place_enu_m is None or len(way) < 2:
        return tuple(way)
    off_m = [_off_m(place_enu_m, *piece) for piece in pairwise(way)]
    first = min(range(len(off_m)), key=off_m.__getitem__)
    # Before the first corner there is a piece that begins where nobody remembers.
    if first == 0 and math.dist(place_enu_m, way[0]) > _FLOWN_M and off_m[0] > _FLOWN_M:
        return tuple(way)
    return tuple(way[first + 1 :])


def _off_m(place: Point, begin: Point, end: Point) -> float:
    along = [b - a for a, b in zip(begin, end, strict=True)]
    length2 = sum(each * each for each in along)
    share = 0.0
    if length2 > 0.0:
        away = (p - a for a, p in zip(begin, place, strict=True))
        share = min(1.0, max(0.0, sum(a * b for a, b in zip(along, away, strict=True)) / length2))
    return math.dist(place, [a + share * d for a, d in zip(begin, along, strict=True)])
