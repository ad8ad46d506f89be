"""A vehicle on the ground between two flights: its battery is changed, and then it may start again.

Nobody starts it as long as a person may stand beside it: that is said by the operator's word
alone, unless it is simulated, and by a battery that is full. To change a battery is to switch the
autopilot off and on: it may fall silent and begin anew meanwhile, and nothing follows from that.
It departs as it did first: all checks, motors, take-off, speed, its way home where that stands on
it; see `agent.vehicle.preparation`.
"""

from __future__ import annotations

import math

from agent.core.interface import GoTo, Prepare, Swap
from agent.vehicle.activity import Activity, FlightPhase
from agent.vehicle.preparation import Preparing
from agent.vehicle.session import VehicleSession

_ASTRAY_M = 25.0
"""Who stands farther than that from where it was to land stands elsewhere: whoever changes its
battery carries it a few metres, and its position errs by a few."""


class Standing(Activity):
    """Stands where a `Swap` has led it.

    Args:
        since_s: when it was seen there first.
        may_start: somebody has let it start already.
    """

    phase = FlightPhase.STANDING
    polls = True
    in_our_hands = False
    may_disarm = True

    def __init__(
        self, session: VehicleSession, order: Swap, since_s: float, *, may_start: bool = False
    ) -> None:
        super().__init__(session)
        self.order = order
        self.since_s = since_s
        self.may_start = may_start
        """Whether somebody has let it start again."""
        self.is_ready = False
        """Whether that was said, too: its battery is full, and it may take off."""
        self.taken: str | None = None
        """Who flies it away, in words; None as long as it stands."""
        self._told_ready = False
        session.tell_anew()

    def has_news(self) -> bool:
        """Whether it has become ready; true once."""
        news, self._told_ready = self.is_ready and not self._told_ready, self.is_ready
        return news

    def again(self, *, disturbed: bool) -> Standing:
        """It has not left: it stands there still, and may start unless somebody went near it."""
        may_start = self.may_start and not disturbed
        return Standing(self._session, self.order, self.since_s, may_start=may_start)

    def let_start(self) -> None:
        """A person has seen to it."""
        self.may_start = True

    def advance(self) -> None:
        """Look whether it may take off, and say what is waited for."""
        session, heartbeat, firmware = (
            self._session,
            self._session.vehicle.heartbeat,
            self._session.firmware,
        )
        if heartbeat is not None and heartbeat.armed and not session.silent:
            self.may_start = False  # whoever armed it may stand beside it
            if firmware is not None and firmware.airborne(session.vehicle):
                self.taken = f"its pilot flies it in {firmware.mode_name(heartbeat.custom_mode)}"
        if self.is_ready and (heartbeat is None or not heartbeat.armed):
            return
        reason = self._waits_for()
        self.is_ready = reason is None
        if reason is not None:
            session.tell_not_ready(reason)

    def _waits_for(self) -> str | None:
        """What is missing, in words; None if it may take off."""
        session, config, vehicle = self._session, self._session.config, self._session.vehicle
        heartbeat, firmware = vehicle.heartbeat, session.firmware
        changing = "its battery is being changed"
        if config.ready_by_itself:
            if session.now_s < self.since_s + self.order.swap_s:
                return changing
        elif not self.may_start:
            return "change its battery, and then let it start again: swarm ready"
        if (missing := session.missing()) is not None or heartbeat is None or firmware is None:
            return f"{changing}: {missing}"
        if heartbeat.armed:
            return "armed by somebody else: disarm it"
        if not vehicle.prearm_heard:
            return "waiting to hear its charge (SYS_STATUS)"
        charge_frac, full_frac = vehicle.battery_frac, config.full_battery_frac
        if charge_frac is not None and charge_frac < full_frac:
            return f"battery at {charge_frac:.0%}, below the {full_frac:.0%} of a full one"
        place_enu_m = session.known_place_m()
        if place_enu_m is None:
            return "waiting for a position"
        astray_m = math.dist(place_enu_m[:2], self.order.position_enu_m[:2])
        if astray_m > _ASTRAY_M:
            return f"it stands {astray_m:.0f} m from its base: carry it there"
        return None


class Departing(Preparing):
    """Starts a vehicle that stands ready, and takes it to the height of its way.

    Args:
        standing: where and how it stands.
        next_order: what to fly then.
    """

    def __init__(self, session: VehicleSession, standing: Standing, next_order: GoTo) -> None:
        base = standing.order.position_enu_m
        first = (*next_order.via_enu_m, next_order.position_enu_m)[0]
        prepare = Prepare(
            (base[0], base[1], first[2]), session.cruise_speed_m_s, ground_up_m=base[2]
        )
        super().__init__(session, prepare, ours=False)
        self.standing = standing
        self.next_order = next_order
        self._rebooted = False

    @property
    def failure(self) -> str | None:
        """Why it will not get there; None while it may."""
        return "the autopilot rebooted" if self._rebooted else super().failure

    @property
    def disturbed(self) -> bool:
        """Whether somebody else was seen to have armed or flown it, or to have switched it off."""
        return self._rebooted or super().disturbed

    def on_reboot(self) -> None:
        """The autopilot began anew: somebody stands beside it."""
        super().on_reboot()
        self._rebooted = True
