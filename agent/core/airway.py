"""Lets one UAV's vehicle go only where nobody else of the fleet is or may be.

In a mission with a separation all orders that move the vehicle come through here. One of them waits
where the vehicle is, until the keepers of the air that its way leads through have granted it (see
swarm.separation): in the UAV's layer, or in another one nearby if that is taken. The rest of the
core knows nothing of other layers: it goes on in the one of the brief, and heights are shifted on
their way to the vehicle and back. Whatever happens, the UAV may stay where it is. In other missions
orders pass as they are.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from functools import partial

from agent.core.base_stand import BaseStand
from agent.core.fleet_air import ASIDE_PATIENCE, GIVES_UP_S, STOP_LEG, FleetAir
from agent.core.interface import (
    Action,
    Arrived,
    Event,
    GoTo,
    HandedOver,
    Held,
    Hold,
    Home,
    Landed,
    MotorsRun,
    OrderVehicle,
    Prepare,
    Refused,
    Return,
    ReturnAdvised,
    ReturnBegun,
    Swap,
    Telemetry,
    VehicleOrder,
    VehicleReady,
)
from agent.core.kept_air import KeptAir
from agent.core.mission_view import MissionView, Peers
from agent.core.stop_on_way import MOST_DOUBLED
from agent.core.way_flown import NO_LEG, WayFlown
from agent.core.wish import Wish
from swarm.protocol.events import LogLine
from swarm.protocol.registers import Replica
from swarm.protocol.timing import Timing, earliest
from swarm.protocol.uav_messages import Claim, ClaimedWay, ClaimPhase
from swarm.separation.shared_air import SharedAir
from swarm.separation.shifted import continued, hovering, landed, left_of_way, lifted
from swarm.separation.way_words import adds_nothing, grants_alone

_BY_GRANT = GoTo | Return | Prepare
"""Orders that may have to wait for a way."""


class Airway(WayFlown):
    """The way of one UAV through the air that its fleet shares."""

    def __init__(
        self,
        uav: str,
        timing: Timing,
        replica: Replica,
        mission_view: MissionView,
        peers: Peers,
        actions: list[Action],
    ) -> None:
        super().__init__(timing, mission_view, FleetAir(uav, replica, mission_view, peers))
        self._uav = uav
        self._retry_s = timing.patience_s
        self._replica = replica
        self._actions = actions
        self.when_departed: Callable[[], None] = lambda: None
        """Is told when the vehicle is sent off after a wait."""
        self.when_detoured: Callable[[], None] = lambda: None
        """Is told when it is sent off by a longer way than was reckoned with."""
        self.last_departure = self._fleet.last_departure
        """What the battery allows."""
        self._wish: Wish | None = None
        self._aside: Wish | None = None
        """It makes room, before its wish is asked again."""
        self._kept = KeptAir(uav, timing.announce_s)
        self._stand = BaseStand()
        self._settled: tuple[object, ...] = ()  # what the last look rested on
        self._comes_down = False
        """Whether it lands where it is, whatever home it is told to return to."""
        self._looks_again = False
        """Whether somebody may still have to be let by."""
        self._room_at_s = -math.inf
        """Not before does it look again whether it is in anybody's way."""
        self._goes_aside = False
        """Whether it flies to make room, or stops on that way."""
        self._rooms_refused = 0
        """How often in a row its vehicle has refused that."""
        self._rises = False
        """Whether it asks for air to take off into, or has got it, and is not up there yet."""
        self._unplaced: Callable[[], None] | None = None
        """Gives an order anew that waits until the vehicle has told where it flies."""
        self.displaced = False
        """Whether it has stopped elsewhere than where its way was worked out from."""

    @property
    def waits(self) -> bool:
        """Whether an order waits for its way."""
        return self._wish is not None

    @property
    def waits_on_ground(self) -> bool:
        """Whether that order is to take the vehicle up from the base where it stands."""
        return self._wish is not None and self._stand.waits

    # -- what the vehicle says -----------------------------------------------------------------

    def hear(self, event: Event) -> Event:
        """What the vehicle says, as the core is to hear it: in the layer of the brief."""
        air = self._fleet.shared
        if air is None:
            return event
        match event:
            case Telemetry(position_enu_m=place):
                self._vehicle.tell(place)
                self._mission_view.waits_on_ground = self.waits_on_ground
                nominal_enu_m = self._nominal(place)
                self._mission_view.raised_m = place[2] - nominal_enu_m[2]
                return replace(event, position_enu_m=nominal_enu_m)
            case VehicleReady():
                self._aloft, self._rises = True, False
                self._way = lifted(self._told_way, self._fleet.hovers_first_enu_m)
            case MotorsRun(ours=True) if self._told_way.flies:
                self._way = replace(self._told_way, grounded=False)  # it may have left the ground
            case Arrived(leg=leg) if leg == self._flown_leg:
                self._arrive()
            case Held():
                self._moves = self._aloft  # it is somewhere on its way
                self._halt.end()
            case HandedOver() | ReturnBegun() if self._aloft:  # it flies as somebody else has it
                self._moves, self._unplaced, self._flown_leg = True, None, NO_LEG
                self._halt.end()
                self._drop_wish()
            case Landed() | Home():
                self._aloft = self._moves = False
                self._halt.end()
                self._lifts_enu_m = None
                self._vehicle.land()
                heir = self._fleet.heir(air) if isinstance(event, Home) else None
                self._way = replace(landed(self._told_way), heir=heir)
            case Refused(order=GoTo(leg=leg)) if leg == self._flown_leg:
                self._moves, now_s = True, self._mission_view.now_s
                self._halt.refused(now_s)
                if self._goes_aside:  # the same place would be refused again
                    self._room_at_s = now_s + self._retry_s * 2.0**self._rooms_refused
                    self._rooms_refused = min(self._rooms_refused + 1, MOST_DOUBLED)
        return event

    def recall(self, claim: Claim) -> None:
        """An earlier life of this agent said so.

        It may have set off on what it had asked for, and not have said that any more. So the
        vehicle is somewhere on that way, and stops there before anything else is asked for.
        """
        if self._way is None and claim.way is not None:
            self._recall_way(claim.way)
            self._kept.recall(claim.way)

    # -- orders ----------------------------------------------------------------------------------

    def order(
        self,
        order: VehicleOrder,
        *,
        own_height: bool = False,
        fixed: bool = False,
        takes_s: float | None = None,
    ) -> None:
        """Pass ``order`` on, at once or when there is a way.

        Args:
            order: to the vehicle, heights in the layer of the brief.
            own_height: it ends at the height of a task.
            fixed: all of it is flown at the heights that it has.
            takes_s: how long its way takes, as reckoned [s]; None: by its length.
        """
        claimed = self._replica.claims.get(self._uav) is not None
        way, self._unplaced = self._told_way, None
        self._rises = isinstance(order, Prepare) and not (self._aloft or way.flies)
        passes = isinstance(order, Prepare) and not self._rises
        if self._fleet.shared is None or not claimed or passes or not isinstance(order, _BY_GRANT):
            self._actions.append(OrderVehicle(order))
            if isinstance(order, Hold | Prepare | Swap) and self._fleet.shared is not None:
                self._halt.end()
                self._drop_wish()
            return
        here = self._fleet.rises_at_enu_m if self._rises else self._here()
        down = isinstance(order, Return) and order.resume and self._vehicle.has_flown(way, order)
        if isinstance(order, Return) and self._aloft and (self._comes_down or down):
            order = replace(order, path_enu_m=(), via_enu_m=self._vehicle.enu_m, land=True)
            here = None
        elif isinstance(order, Return) and not self._aloft:
            if way.flies and order.via_enu_m is not None:  # on its way up it has no other air
                order = replace(order, path_enu_m=(), via_enu_m=way.path_enu_m[-1])
            here = None
        elif here is None and self._aloft and self._vehicle.is_awaited(self._mission_view.now_s):
            again = partial(self.order, own_height=own_height, fixed=fixed, takes_s=takes_s)
            self._unplaced = partial(again, order)
            return
        if here is None:
            self._actions.append(OrderVehicle(order))
            self._drop_wish()
            return
        fixed |= self._rises
        corners = self._fleet.corners(order, here)
        own_height |= self._fleet.keeps_height(order, corners[-1])
        high = self._own_height if self._moves else self._at_own_height
        high |= self._fleet.layer.misses(here)
        since_s = self._mission_view.now_s
        self._wish = Wish(order, since_s, corners, own_height, fixed, high, takes_s)
        self._aside = None
        if self._rises:
            self._actions.append(LogLine("asks for the air above its start", {}))
        if not self._aloft:
            self._stand.wait(self._replica.claims.get(self._uav))
        elif self._moves and not self._halt.under_way:
            self._fly_on(self._fleet.shared, self._wish)

    def _fly_on(self, air: SharedAir, wish: Wish) -> None:
        """Fly on if that is as wished, to the end of what is its own at least; else stop."""
        way, place, corners = self._told_way, self._vehicle.enu_m, wish.corners_enu_m
        known = self._claims(), self._fleet.expired()
        if place is None or not (way.flies or air.is_granted(self._uav, *known)):
            self._stop()  # an earlier life asked for it, and may have waited for it
            return
        same_end = self._own_height == wish.own_height
        if same_end and (left := left_of_way(way, place, corners, wish.end_enu_m)) is not None:
            self._way, self._wish = left, None
            self._depart(wish)
            return
        stays = self._flown_leg not in (STOP_LEG, NO_LEG) and not (
            self._own_height or wish.out_of_layer
        )
        if stays and (further := continued(way, place, corners)) is not None:
            wish.corners_enu_m = further
        else:
            self._stop()

    def _drop_wish(self) -> None:
        """Nothing is asked for any more."""
        self._wish = self._aside = None
        self._goes_aside = False
        self._ask_no_more()

    def _stop(self) -> None:
        """Stop where the vehicle was told to be last, which is on its way."""
        if self._vehicle.enu_m is not None:
            self._flown_leg = STOP_LEG
            self._actions.append(OrderVehicle(self._halt.begin(self._vehicle.enu_m)))

    def _arrive(self) -> None:
        if self._wish is not None and self._flown_leg != STOP_LEG:
            self._wish.goes_on(self._mission_view.now_s)
        stopped, was_aside, self._goes_aside = self._halt.under_way, self._goes_aside, False
        self._end_leg()
        if not stopped:
            self._rooms_refused = 0
            return
        wish, here = self._wish, self._here()
        if wish is None or here is None or not wish.is_from_elsewhere(here):
            return
        if was_aside:  # it knows the way back to where its way begins
            self._fleet.begin_at(wish, here)
            return
        again = partial(self.order, own_height=wish.own_height, fixed=wish.fixed)
        again(wish.order, takes_s=wish.takes_s)
        self.displaced = True

    # -- what it claims ----------------------------------------------------------------------------

    def told(self, claim: Claim) -> Claim:
        """``claim`` with the air that this UAV takes or asks for."""
        if self._fleet.shared is None:
            return claim
        claim = self._stand.told(claim, self._fleet.mission_s)
        way = self._told_way
        if claim.phase is ClaimPhase.OUT and way.grounded and not self._rises:
            way = landed(way)  # it will not take off any more
        whole = self._kept.told(way)
        return claim if claim.way is whole else replace(claim, way=whole)

    def settle(self, now_s: float) -> Sequence[Refused | ReturnAdvised]:
        """What follows from the claims: whom to grant, and where to go.

        Gives orders that are given up, since no way becomes free, or advice to land where it is.
        """
        air = self._fleet.shared
        if air is None or self._uav not in self._replica.claims or not self._has_changed(now_s):
            return []
        if self._unplaced is not None and not self._vehicle.is_awaited(now_s):
            self._unplaced()
        self._fleet.note_losses()
        given_up = self._press(air, now_s)
        self._kept.look(air, self._claims, self._fleet.heard(), self._fleet.expired(), now_s)
        self._depart_if_granted(air, now_s)
        return given_up

    def concerned(self, writer: str, said: Claim) -> bool:
        """Whether `settle` has something to do once ``writer`` has said so."""
        air, known = self._fleet.shared, self._replica.claims.get(writer)
        if air is not None and known is not None and grants_alone(self._uav, said, known):
            return False
        if air is None or self._kept.any or self._halt.under_way or self._aside is not None:
            return air is not None
        return air.concerns(self._uav, writer, said, self._replica.claims)

    def _has_changed(self, now_s: float) -> bool:
        """Whether anything is new since the last look: most steps are about something else."""
        due_s = self.next_deadline_s()
        told = (self._way, self._wish, self._aside, self._halt.under_way, self._moves, self._aloft)
        placed = self._vehicle.enu_m is not None
        now = (self._replica.claim_version, *told, placed, len(self._fleet.heard()))
        before, self._settled = self._settled, now
        return now != before or (due_s is not None and due_s <= now_s)

    def restated(self, *, speaks: bool) -> Claim | None:
        """The own claim, if what is to be told of the air has changed since it was said.

        Where it ``speaks`` in this step in any case, all that is new is told with that.
        """
        air, claim = self._fleet.shared, self._replica.claims.get(self._uav)
        if air is None or claim is None:
            return None
        now = self.told(self._stand.left(claim, self.last_departure.sortie_end_s()))
        if (now.base, now.stage) == (claim.base, claim.stage) and (
            adds_nothing(now.way, claim.way)
            or (not speaks and self._fleet.can_wait(air, now, claim, self._claims()))
        ):
            return None
        return now

    def granted(self, now_s: float) -> tuple[Claim, list[str]] | None:
        """The own claim as it was said, with what was granted since, and who is to hear it at once.

        None: nobody is. All others hear it with the next word of this UAV.
        """
        air, claim = self._fleet.shared, self._replica.claims.get(self._uav)
        if air is None or claim is None:
            self._kept.tell_again_at_s = None
            return None
        return self._kept.told_to(claim, air, self._claims, self._fleet.expired(), now_s)

    def next_deadline_s(self) -> float | None:
        """When `settle` will next have something to do."""
        return earliest(self._asks_again_at_s(), self._kept.tell_again_at_s)

    def _asks_again_at_s(self) -> float | None:
        wish = self._aside or self._wish
        if self._unplaced is not None:
            return self._vehicle.awaited_until_s
        if self._halt.under_way or self._halt.again_s is not None:
            return self._halt.again_s
        again_s = self._room_at_s if self._looks_again else None
        return again_s if wish is None or (self._moves and self._aloft) else wish.retry_at_s

    # -- asking -----------------------------------------------------------------------------------

    def _press(self, air: SharedAir, now_s: float) -> Sequence[Refused | ReturnAdvised]:
        """Ask for what is wished, give way to who is stronger, make room, or give up."""
        if self._halt.is_due(now_s) and self._moves and self._aloft:
            self._stop()
        if self._halt.under_way:
            return []
        self._looks_again = self._aside is None and self._room_at_s > now_s
        if self._aside is None and not self._looks_again:
            self._room_at_s = now_s + self._retry_s
            flies = self._moves and self._aloft
            self._looks_again = self._clear_behind(air) if flies else self._make_room(air)
        if self._moves and self._aloft:
            return []
        wish, battery = self._wish, self.last_departure
        if wish is not None and self._aloft and battery.must_land(wish, self._retry_s):
            return self._come_down(wish)
        if self._aside is not None:
            if now_s - self._aside.since_s > ASIDE_PATIENCE * self._retry_s:
                self._aside, self._way = None, hovering(self._told_way)
            else:
                self._pursue(air, self._aside, now_s)
        if wish is None or self._aside is not None:
            return []
        spent = wish.asked and battery.ends_too_late(wish)
        if wish.task is not None and (now_s - wish.since_s > GIVES_UP_S or spent):
            self._wish = None
            self._way = hovering(self._told_way)
            self._actions.append(LogLine("no way", {"task": wish.task}))
            return [Refused(wish.order, "no way there becomes free", passes=True)]
        self._pursue(air, wish, now_s)
        if self._aloft and (out := self._fleet.way_out(wish, self._retry_s)) is not None:
            self._aside = out
            self._pursue(air, out, now_s)
        return []

    def _come_down(self, wish: Wish) -> list[ReturnAdvised]:
        """Land where it hovers: above and below that nobody else is granted anything."""
        self._comes_down = True
        self._drop_wish()
        self._actions.append(LogLine("lands where it is", {"task": wish.task}))
        if isinstance(wish.order, Return):
            self.order(wish.order)
            return []
        return [ReturnAdvised("no way becomes free, and it can wait no longer")]

    def _pursue(self, air: SharedAir, wish: Wish, now_s: float) -> None:
        rival = self._fleet.stronger(air, wish, self._claims()) if wish.asked else None
        if rival is not None:
            wish.yielded.add(rival)
        if not wish.asked or rival is not None or wish.retry_at_s <= now_s:
            wish.retry_at_s = now_s + self._retry_s
            self._ask(air, wish, again=rival is not None)

    def _ask(self, air: SharedAir, wish: Wish, *, again: bool) -> None:
        """Ask for the nearest layer in which nobody is in the way, else for one to wait for."""
        here, aside = hovering(self._told_way), wish is self._aside
        grounded = not self._aloft
        found = self._fleet.way(air, wish, here, self._claims(), grounded=grounded, aside=aside)
        if found is not None and (found.is_free or ((again or not wish.asked) and not aside)):
            self._request(wish, found.way, again=again)
        elif aside:
            self._aside = None

    def _request(self, wish: Wish, asked: ClaimedWay, *, again: bool) -> None:
        """Ask for that, unless it is asked for already, and nobody is to be let in before."""
        now = self._told_way
        same = (now.path_enu_m, now.shift_m) == (asked.path_enu_m, asked.shift_m)
        if again or not (wish.asked and same):
            if wish is self._aside and self._wish is not None:
                self._wish.asked = False
            wish.asked = True
            self._way = asked

    def _make_room(self, air: SharedAir) -> bool:
        """Step aside for who asks for where it hovers, unless it works; whether there is one."""
        here, claims = hovering(self._told_way), self._claims()
        works = self._wish is None and claims[self._uav].phase is not ClaimPhase.IDLE
        if self._moves or not self._aloft or not here.path_enu_m or works:
            return False
        if not self._fleet.is_in_the_way(air, here, claims, waits=self._wish is not None):
            return False
        place = self._nominal(here.path_enu_m[0])
        self._aside = self._fleet.makes_room(place, own_height=self._at_own_height)
        return True

    def _clear_behind(self, air: SharedAir) -> bool:
        """Give back what it has flown of its way, once somebody who asks needs no more than that.

        Gives whether anybody asks for any of the way.
        """
        way, place = self._told_way, self._vehicle.enu_m
        asked, left = self._fleet.left_for_others(air, way, place, self._claims())
        if left is not None:
            self._way = replace(way, path_enu_m=left)
        return asked

    # -- setting off ------------------------------------------------------------------------------

    def _depart_if_granted(self, air: SharedAir, now_s: float) -> None:
        wish, way = self._aside or self._wish, self._told_way
        if wish is None or not wish.asked or way.flies or self._halt.under_way:
            return
        if air.is_granted(self._uav, self._claims(), self._fleet.expired()):
            if way.path_enu_m:
                self._vehicle.set_off(way.path_enu_m[0], from_ground=not self._aloft)
            if now_s > wish.since_s and wish is not self._aside:
                self.when_departed()
            self._depart(wish)
            if wish is not self._aside:
                self._wish = None
            elif self._wish is not None:
                self._fleet.begin_at(self._wish, self._nominal(self._told_way.path_enu_m[-1]))
            self._aside = None

    def _depart(self, wish: Wish) -> None:
        """Send the vehicle along the way that is its own now."""
        way, order, path = self._told_way, wish.order, self._told_way.path_enu_m
        if isinstance(order, Prepare):  # that it takes off is still to be seen
            self._way = replace(way, flies=True)
            self._actions.append(OrderVehicle(order))
            return
        self._stand.leave()
        self._moves, self._aloft = len(path) > 1, True
        self._lifts_enu_m, self._own_height = None, wish.own_height
        self._way = replace(way, flies=True, grounded=False)
        if wish.is_shorter_than(path):
            self.when_detoured()
        self._flown_leg = order.leg if isinstance(order, GoTo) else STOP_LEG
        self._goes_aside = wish is self._aside
        self._halt.end()
        self._actions.append(OrderVehicle(wish.along(path)))

    def _claims(self) -> Mapping[str, Claim]:
        return self._fleet.claims_with(self.told(self._replica.claims[self._uav]))
