"""What becomes of a vehicle that was handed over for its silence, once it is heard again.

Left alone it would hover until its battery is empty: our heartbeats keep its own failsafe
for a lost ground station from acting, and many have none. So it is taken back if it flies
as it was left: in the air, in the mode that takes our targets, where our orders led or on
the way there. Anything else means that somebody else, or a failsafe, has it. Leaves out:
bringing it home (agent.core orders it, agent.mavlink.returning does it).
"""

from __future__ import annotations

import math
from collections.abc import Sequence

from agent.mavlink.authority import intervention
from agent.mavlink.messages import ExtendedState, Heartbeat, Inbound, Landed
from agent.mavlink.seat import Seat
from agent.vehicle import HandOverExplained, HeardAgain

__all__ = ["LinkLoss"]

Point = tuple[float, float, float]

_LOOK_S = 3.0
"""It is watched for that long: what comes first may have waited in a link for a while."""
_HEARTBEATS = 3
_FRESH_S = 1.5
"""A place older than that, and than the watch, is not where it is now."""
_DOUBT_S = 10.0
"""What is not explained by our orders may be so soon: a vehicle that overshoots comes back."""
_ASTRAY_M = 25.0
"""A vehicle farther than that from everywhere on its way was led there by somebody else:
braking and turning at speed take it less far."""


class LinkLoss:
    """One vehicle that fell silent while it was ours.

    Args:
        seat: the vehicle, as it was last heard.
        sent_to_enu_m: where it may be flying to [m; mission origin].
    """

    def __init__(self, seat: Seat, sent_to_enu_m: Sequence[Point]) -> None:
        heartbeat = seat.vehicle.heartbeat
        self._seat = seat
        self._mode = None if heartbeat is None else heartbeat.custom_mode
        self._lost_s = seat.vehicle.heard_at_s or seat.now_s
        self._place_enu_m = seat.whereabouts.place_m(-math.inf)
        self._sent_to_enu_m = sent_to_enu_m
        self._begin_anew()

    def _begin_anew(self) -> None:
        self._heard_s: float | None = None
        self._heartbeats = 0
        self._tells_whether_it_flies = False

    def on_message(self, message: Inbound) -> None:
        """Note what is fresh."""
        match message:
            case Heartbeat():
                self._heartbeats += 1
            case ExtendedState(landed) if landed is not Landed.UNDEFINED:
                self._tells_whether_it_flies = True
            case _:
                pass

    def news(self) -> HeardAgain | HandOverExplained | None:
        """What became of it; None as long as that is not known."""
        seat, heartbeat = self._seat, self._seat.vehicle.heartbeat
        if seat.silent:
            self._begin_anew()
            return None
        if not self._heartbeats or heartbeat is None:
            return None
        if self._heard_s is None:
            self._heard_s = seat.now_s
        if (why := self._taken(heartbeat)) is not None:
            return HandOverExplained(f"{self._heard_again}: {why}")
        watched_s = seat.now_s - self._heard_s
        place_enu_m = seat.whereabouts.place_m(seat.now_s - _FRESH_S)
        position = seat.vehicle.position
        known = self._heartbeats >= _HEARTBEATS and self._tells_whether_it_flies
        if watched_s < _LOOK_S or not known or place_enu_m is None or position is None:
            return None
        if self._is_on_its_way(place_enu_m, position.velocity_enu_m_s):
            return HeardAgain(f"{self._heard_again}, as it was left")
        if watched_s < _LOOK_S + _DOUBT_S:
            return None
        return HandOverExplained(f"{self._heard_again}: somebody else has moved it")

    @property
    def _heard_again(self) -> str:
        heard_s = self._seat.now_s if self._heard_s is None else self._heard_s
        return f"heard again after {heard_s - self._lost_s:.0f} s"

    def _taken(self, heartbeat: Heartbeat) -> str | None:
        """Why it is not to be commanded, by its heartbeat; None if it may be."""
        seat, flavour, mode = self._seat, self._seat.flavour, heartbeat.custom_mode
        if flavour is None or self._mode is None:
            return "it is not known what it is"
        if self._tells_whether_it_flies and not flavour.airborne(seat.vehicle):
            return "it stands on the ground"
        if heartbeat.armed and flavour.is_returning(mode):
            return f"it returns or lands by itself, in {flavour.mode_name(mode)}"
        if heartbeat.armed and flavour.is_mission(mode) and mode == self._mode:
            return "it flies its mission, which ends at home"
        # A takeoff ends in the guided mode by itself.
        ours = (mode, self._mode) if flavour.is_taking_off(self._mode) else (self._mode,)
        expected = mode in ours and (flavour.is_commanded(mode) or flavour.is_taking_off(mode))
        return intervention(
            seat.vehicle, heartbeat, flavour, seat.now_s, expected=expected, may_disarm=False
        )

    def _is_on_its_way(self, place_enu_m: Point, velocity_enu_m_s: Point) -> bool:
        """Whether our orders explain where it is, and where it flies."""
        if self._place_enu_m is None:
            return False
        still = math.hypot(*velocity_enu_m_s) <= self._seat.config.arrival_speed_m_s
        if still:
            # Somewhere between, somebody has stopped it.
            ends = (self._place_enu_m, *self._sent_to_enu_m)
            return any(_near(place_enu_m, end, end) for end in ends)
        return any(
            _near(place_enu_m, self._place_enu_m, end)
            and _leads_to(end, place_enu_m, velocity_enu_m_s)
            for end in self._sent_to_enu_m
        )


def _leads_to(end_m: Point, place_m: Point, velocity_m_s: Point) -> bool:
    """Whether the way left gets shorter."""
    parts = zip(velocity_m_s, end_m, place_m, strict=True)
    return sum(speed_m_s * (end - place) for speed_m_s, end, place in parts) > 0.0


def _near(place_m: Point, from_m: Point, to_m: Point) -> bool:
    """Whether a place lies along a way, at one of its heights or between them."""
    (east_m, north_m, up_m), (to_east_m, to_north_m, to_up_m) = place_m, to_m
    way_east_m, way_north_m = to_east_m - from_m[0], to_north_m - from_m[1]
    length2 = way_east_m**2 + way_north_m**2
    along = (east_m - from_m[0]) * way_east_m + (north_m - from_m[1]) * way_north_m
    share = min(1.0, max(0.0, along / length2)) if length2 > 0.0 else 1.0
    aside_m = math.hypot(
        east_m - from_m[0] - share * way_east_m, north_m - from_m[1] - share * way_north_m
    )
    low_m, high_m = sorted((from_m[2], to_up_m))
    return aside_m <= _ASTRAY_M and low_m - _ASTRAY_M <= up_m <= high_m + _ASTRAY_M
