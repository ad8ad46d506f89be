"""A vehicle on the ground between two flights: its battery is changed, and then it may start again.

Nobody starts it as long as a person may stand beside it: that is said by the operator's word
alone, unless it is simulated, and by a battery that is full. The word is about the vehicle as it
stands there: it is taken back where the battery that is in it will not do, as somebody has to go
there again then, and where somebody is seen to have switched it off and on or to have armed it
since. To change a battery is to switch the autopilot off and on: it may fall silent and begin anew
before the word, and nothing follows from that.
It departs as it did first: all checks, motors, take-off, speed, its way home where that stands on
it; see `agent.vehicle.preparation`.
"""

from __future__ import annotations

import math
from dataclasses import replace

from agent.core.interface import GoTo, Prepare, Swap
from agent.vehicle.activity import Activity, FlightPhase
from agent.vehicle.preparing import Preparing
from agent.vehicle.session import VehicleSession
from swarm.protocol.operator_commands import NOT_READY

_ARMED = "armed by somebody else: disarm it"

_LET_START = "and then let it start again: swarm ready"

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
        self._unheard = False
        """Whether it was not heard when somebody let it start: it is going to boot, then."""
        self._let_s = -math.inf
        """When somebody let it start; what was told of its charge before may be of another one."""
        self._refusal: str | None = None
        """Why the last word was taken back."""
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
        self.may_start, self._refusal, self._let_s = True, None, self._session.now_s
        self._unheard = self._session.missing() is not None

    def on_reboot(self) -> None:
        """The autopilot began anew: somebody stands beside it, unless that is over already."""
        if self._unheard:
            self._unheard = False
        else:
            self._take_back(None)

    def _take_back(self, refusal: str | None) -> None:
        """Whoever let it start has to do so again."""
        self.may_start = self.is_ready = self._told_ready = False
        self._refusal = refusal

    def advance(self) -> None:
        """Look whether it may take off, and say what is waited for."""
        session, heartbeat, firmware = (
            self._session,
            self._session.vehicle.heartbeat,
            self._session.firmware,
        )
        if heartbeat is not None and heartbeat.armed and not session.silent:
            # Whoever armed it may stand beside it.
            self._take_back(_ARMED if self.may_start else self._refusal)
            if firmware is not None and firmware.airborne(session.vehicle):
                mode = firmware.mode_name(heartbeat.custom_mode, self._session.vehicle.told_modes)
                self.taken = f"its pilot flies it in {mode}"
        if self.is_ready and (heartbeat is None or not heartbeat.armed):
            return
        reason = self._waits_for()
        self.is_ready = reason is None
        if reason is None:
            self._unheard = False
            return
        if self.may_start and not session.config.ready_by_itself and self._objection() is not None:
            self._take_back(reason)
        refused = self._refusal is not None and not self.may_start
        session.tell_not_ready(f"{NOT_READY}{self._refusal}" if refused else reason)

    def _waits_for(self) -> str | None:
        """What is missing, in words; None if it may take off."""
        session, config, vehicle = self._session, self._session.config, self._session.vehicle
        heartbeat, firmware = vehicle.heartbeat, session.firmware
        changing = "its battery is being changed"
        if config.ready_by_itself:
            if session.now_s < self.since_s + self.order.swap_s:
                return changing
        elif not self.may_start:
            return f"change its battery, {_LET_START}"
        if (missing := session.missing()) is not None or heartbeat is None or firmware is None:
            return f"{changing}: {missing}"
        if heartbeat.armed:
            return _ARMED
        if not vehicle.prearm_heard or (session.tells_charge and not self._charge_is_known):
            return "waiting to hear its charge"
        if objection := self._objection():
            return objection
        return None if session.known_place_m() is not None else "waiting for a position"

    @property
    def _charge_is_known(self) -> bool:
        """Whether its charge was told since somebody let it start."""
        charge = self._session.vehicle.charge
        told_s = -math.inf if charge.told_at_s is None else charge.told_at_s
        return charge.frac is not None and told_s > self._let_s

    def _objection(self) -> str | None:
        """Why somebody has to see to it, whatever was said, in words; None: nothing is known."""
        session, (east_m, north_m, up_m) = self._session, self.order.position_enu_m
        charge_frac, full_frac = session.vehicle.charge.frac, session.config.full_battery_frac
        if session.missing() is not None or (session.tells_charge and not self._charge_is_known):
            return None
        if charge_frac is not None and charge_frac < full_frac:
            return f"battery at {charge_frac:.0%}, below the {full_frac:.0%} of a full one"
        place_enu_m = session.known_place_m()
        if place_enu_m is None:
            return None
        astray_m = math.dist(place_enu_m[:2], (east_m, north_m))
        if astray_m > _ASTRAY_M:
            return f"it stands {astray_m:.0f} m from its base: carry it there"
        above_m = place_enu_m[2] - up_m
        if abs(above_m) > session.config.home_tolerance_m:
            return (
                f"its height is {above_m:+.0f} m off that of its base: restart it, "
                "or correct [origin] alt_m, or position_m of the base"
            )
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
        if session.firmware is not None:
            prepare = replace(prepare, vehicle=session.firmware.kind)
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
