"""A vehicle that was handed over: it is commanded no more, and listened to.

The words that explain a hand-over may come after it. One that was handed over for its silence
is taken back once it is heard again, if it flies as it was left. Left alone it would hover
until its battery is empty: our heartbeats keep its own failsafe for a lost ground station from
acting, and many have none. Anything else means that somebody else, or a failsafe, has it.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass

from agent.core.interface import HandedOver, HandOverExplained, HeardAgain
from agent.vehicle.activity import Activity, FlightPhase
from agent.vehicle.messages import ExtendedState, Heartbeat, Inbound, LandedState
from agent.vehicle.session import VehicleSession
from agent.vehicle.supervision import intervention
from swarm.protocol.fields import Point

_WORDS_LATE_S = 0.5
"""So much later than the mode the words may come that say why a failsafe set it. ArduCopter
tells the mode first, some milliseconds before, on a link that loses nothing."""

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


class HandOver(Activity):
    """The vehicle is somebody else's, until it is prepared anew or called home.

    Args:
        explanation: of a reason that may not have been said in full.
        loss: of a vehicle that fell silent, as long as it may be ours.
    """

    phase = FlightPhase.HANDED_OVER
    in_our_hands = False

    def __init__(
        self,
        session: VehicleSession,
        explanation: HandOverReason | None = None,
        loss: LinkLoss | None = None,
    ) -> None:
        super().__init__(session)
        self._explanation = explanation
        self._loss = loss
        self.taken_back = False
        """It is heard again, and obeys as it did before it was lost."""

    def on_message(self, message: Inbound) -> None:
        """Note what is heard of a vehicle that was lost."""
        if self._loss is not None:
            self._loss.on_message(message)

    def on_reboot(self) -> None:
        """The autopilot began anew: it is not as it was left."""
        if self._loss is not None:
            self._loss = None
            self._session.report(HandOverExplained("heard again: the autopilot rebooted"))

    def advance(self) -> None:
        """Complete the reason, and say what became of a vehicle that was lost."""
        session, explanation, loss = self._session, self._explanation, self._loss
        if explanation is not None and session.now_s >= explanation.due_s:
            self._explanation = None
            if (reason := explanation.better()) is not None:
                session.report(HandOverExplained(reason))
        news = None if loss is None else loss.news()
        if news is not None:
            self._loss = None
            self.taken_back = isinstance(news, HeardAgain)
            session.report(news)

    def next_deadline_s(self) -> float:
        """When the reason is to be completed."""
        return math.inf if self._explanation is None else self._explanation.due_s


def hand_over(
    session: VehicleSession,
    reason: str,
    *,
    explanation: HandOverReason | None = None,
    loss: LinkLoss | None = None,
) -> HandOver:
    """Command nothing any more; ``loss`` where that is for silence."""
    session.commands.cancel_all()
    if session.mission is not None:
        session.mission.abort(reason)
    session.abort_fence()
    session.pace_m_s = None  # whatever it was told, nothing is put back any more
    session.report(HandedOver(reason, silent=loss is not None))
    return HandOver(session, explanation, loss)


@dataclass(frozen=True, slots=True)
class HandOverReason:
    """Why a vehicle was handed over, told in full once the words for it have come."""

    told: str
    """As far as it was known at once."""
    why: Callable[[float], str | None]
    """By all that was said until then and since."""
    at_s: float
    """When it was handed over."""

    @property
    def due_s(self) -> float:
        """By then all has been said."""
        return self.at_s + _WORDS_LATE_S

    def better(self) -> str | None:
        """The reason in full; None if it was known at once."""
        reason = self.why(self.at_s)
        return None if reason == self.told else reason


class LinkLoss:
    """One vehicle that fell silent while it was ours.

    Args:
        session: with the vehicle, as it was last heard.
        sent_to_enu_m: where it may be flying to [m; mission origin].
    """

    def __init__(self, session: VehicleSession, sent_to_enu_m: Sequence[Point]) -> None:
        heartbeat = session.vehicle.heartbeat
        self._session = session
        self._mode = None if heartbeat is None else heartbeat.custom_mode
        self._lost_s = session.vehicle.heard_at_s or session.now_s
        self._place_enu_m = session.position_filter.place_m(-math.inf)
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
            case ExtendedState(landed) if landed is not LandedState.UNDEFINED:
                self._tells_whether_it_flies = True
            case _:
                pass

    def news(self) -> HeardAgain | HandOverExplained | None:
        """What became of it; None as long as that is not known."""
        session, heartbeat = self._session, self._session.vehicle.heartbeat
        if session.silent:
            self._begin_anew()
            return None
        if not self._heartbeats or heartbeat is None:
            return None
        if self._heard_s is None:
            self._heard_s = session.now_s
        if (why := self._taken(heartbeat)) is not None:
            return HandOverExplained(f"{self._heard_again}: {why}")
        watched_s = session.now_s - self._heard_s
        place_enu_m = session.position_filter.place_m(session.now_s - _FRESH_S)
        position = session.vehicle.position
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
        heard_s = self._session.now_s if self._heard_s is None else self._heard_s
        return f"heard again after {heard_s - self._lost_s:.0f} s"

    def _taken(self, heartbeat: Heartbeat) -> str | None:
        """Why it is not to be commanded, by its heartbeat; None if it may be."""
        session, firmware, mode = self._session, self._session.firmware, heartbeat.custom_mode
        if firmware is None or self._mode is None:
            return "it is not known what it is"
        if self._tells_whether_it_flies and not firmware.airborne(session.vehicle):
            return "it stands on the ground"
        if heartbeat.armed and firmware.is_returning(mode):
            name = firmware.mode_name(mode, session.vehicle.told_modes)
            return f"it returns or lands by itself, in {name}"
        if heartbeat.armed and firmware.is_mission(mode) and mode == self._mode:
            return "it flies its mission, which ends at home"
        # A takeoff ends in the guided mode by itself.
        ours = (mode, self._mode) if firmware.is_taking_off(self._mode) else (self._mode,)
        expected = mode in ours and (firmware.is_commanded(mode) or firmware.is_taking_off(mode))
        return intervention(
            session.vehicle, heartbeat, firmware, session.now_s, expected=expected, may_disarm=False
        )

    def _is_on_its_way(self, place_enu_m: Point, velocity_enu_m_s: Point) -> bool:
        """Whether our orders explain where it is, and where it flies."""
        if self._place_enu_m is None:
            return False
        still = math.hypot(*velocity_enu_m_s) <= self._session.config.arrival_speed_m_s
        ends, circle_m = (self._place_enu_m, *self._sent_to_enu_m), self._session.circle_m
        if circle_m > 0.0:
            aside_m = _ASTRAY_M + 2.0 * circle_m
            return any(_near(place_enu_m, self._place_enu_m, end, aside_m) for end in ends)
        if still:
            # Somewhere between, somebody has stopped it.
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


def _near(place_m: Point, from_m: Point, to_m: Point, aside_m: float = _ASTRAY_M) -> bool:
    """Whether a place lies along a way, at one of its heights or between them."""
    (east_m, north_m, up_m), (to_east_m, to_north_m, to_up_m) = place_m, to_m
    way_east_m, way_north_m = to_east_m - from_m[0], to_north_m - from_m[1]
    length2 = way_east_m**2 + way_north_m**2
    along = (east_m - from_m[0]) * way_east_m + (north_m - from_m[1]) * way_north_m
    share = min(1.0, max(0.0, along / length2)) if length2 > 0.0 else 1.0
    found_m = math.hypot(
        east_m - from_m[0] - share * way_east_m, north_m - from_m[1] - share * way_north_m
    )
    low_m, high_m = sorted((from_m[2], to_up_m))
    return found_m <= aside_m and low_m - _ASTRAY_M <= up_m <= high_m + _ASTRAY_M
