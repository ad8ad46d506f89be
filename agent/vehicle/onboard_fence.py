"""The zones as the vehicle's own fence: put on it, read back, switched on, and taken off again.

The fence is the last line, behind the agent's own check (agent.vehicle.zone_guard), so nothing
waits for it longer than a few tries take. It stands on the vehicle while that flies for us, and no
longer. A zone becomes part of it only once the vehicle is outside, and will be when it brakes: a
fence put over a vehicle makes it flee at once, or is not heeded. What is no longer a zone is
cleared at once, before anything is flown through it, and the rest put on anew. A fence that is not
ours is left as it is: ours is one all of whose polygons are zones that we were told of. What a
ground station changes while ours stands is not noticed.

Of the two kinds of transfers only one is under way at a time, since PX4 knows no more; missions
go first.

Protocol: https://mavlink.io/en/services/mission.html#geofence
"""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np
import numpy.typing as npt

from agent.vehicle.commands import CommandEnded, CommandOutcome, result_text
from agent.vehicle.conversation import Conversation
from agent.vehicle.fence_items import (
    FenceArea,
    areas_of,
    fence_areas,
    fence_items,
)
from agent.vehicle.firmware.fences import FenceSetup
from agent.vehicle.firmware.profile import Firmware
from agent.vehicle.messages import Inbound, MissionKind, ParameterRead, StatusText
from agent.vehicle.mission_transfer import (
    MissionFailed,
    MissionInForce,
    MissionPolicy,
    MissionRead,
    MissionTransfer,
)
from agent.vehicle.parameter_reading import ParameterReading
from swarm.model import Zone
from swarm.model.fence_rings import blocks_all_heights
from swarm.protocol.fields import Point

if TYPE_CHECKING:
    from swarm.allocation.legs.obstacles import Obstacles

_TAG = "fence"

_CLEAR_M = 1.0
"""A zone is put on a vehicle that is farther away from it than that."""

_LOW_M = 2.0
"""Nothing is flown lower above the ground, but straight up and down."""

_MOST_ITEMS = 512
"""A fence of more corners is not ours."""

_MOST_KNOWN = 256
"""So many areas are remembered as ours."""

_TRIES = 3
"""Failures before the vehicle is flown without it."""

_LATER_S = 60.0
"""Pause before it is tried once more, then."""

_ASKS = 8
"""Times a parameter is asked for before it counts as not known."""

_POLL_S = 0.25

FloatArray = npt.NDArray[np.float64]

_TAKING_OFF_S = 4.0
"""A landed vehicle is waited for so long: less than the silence after which it is given up."""

_ALONE = "only its agent keeps it out of zones"


class OnboardFence:
    """The fence of one vehicle.

    Args:
        conversation: with the vehicle.
        firmware: which it is.
    """

    def __init__(self, conversation: Conversation, firmware: Firmware) -> None:
        config = conversation.config
        self._conversation = conversation
        self._firmware = firmware
        policy = MissionPolicy(config.mission_reply_timeout_s, config.mission_tries, 0)
        self._transfer = MissionTransfer(policy, MissionKind.FENCE)
        self._parameters = ParameterReading(firmware, firmware.fence_names)
        self._asks = 0
        self._ask_at_s = -math.inf
        self._zones: dict[Zone, Obstacles] = {}
        self._pending: tuple[Zone, ...] = ()
        """Not part of it yet: the vehicle may be inside."""
        self._included: tuple[Zone, ...] = ()
        self._wanted: tuple[FenceArea, ...] = ()
        self._known: deque[FenceArea] = deque(maxlen=_MOST_KNOWN)
        """Of all zones that we were told of."""
        self._low_m: float | None = None
        self._held: tuple[FenceArea, ...] | None = None
        """What stands on the vehicle, verified; None if that is not known."""
        self._sent: tuple[FenceArea, ...] | None = None
        """What the transfer under way is to leave there; None while it only reads."""
        self._stale = False
        """What may stand there holds a zone that is none any more."""
        self._ours = False
        """What stands on the vehicle is ours, or nothing: it may be replaced."""
        self._asked_on = self._is_on = False
        """Whether we have switched it on: asked for, and acknowledged."""
        self._failures = 0
        self._next_at_s = -math.inf
        self._driven_s = -math.inf
        """When it was last carried on with."""
        self._without: str | None = None
        """Why there will be none of ours; None as long as there may."""
        self._failure: str | None = None
        self._disowned: str | None = None
        self._off_by_s: float | None = None
        """When it has to be off; None while it is wanted."""
        self._left: str | None = None
        """What could not be taken off again, in words."""

    # What is wanted.

    def keep_out(self, zones: Sequence[Zone]) -> None:
        """Let these be the zones, in place of those before."""
        if zones:  # plain missions start sooner without
            from swarm.allocation.legs.obstacles import Obstacles
        origin = self._conversation.config.origin
        self._zones = {zone: Obstacles([zone], _CLEAR_M) for zone in zones}
        for zone in zones:
            self._known += [a for a in fence_areas(zone, origin) if a not in self._known]
        kept = [zone for zone in self._included if zone in zones]
        if len(kept) < len(self._included):
            self._stale = True
            self.interrupt()
        self._want(kept)

    def advance(
        self, way_enu_m: tuple[Point, Point] | None, home_up_m: float, *, may_begin: bool
    ) -> None:
        """Put on the vehicle what it should have.

        Args:
            way_enu_m: where it is, and where it would come to a stop [m; mission origin]; None:
                not known.
            home_up_m: height of its home [m above the mission origin].
            may_begin: whether no other transfer is under way.
        """
        if self._off_by_s is not None:
            self._off_by_s = self._left = None
            self._want(())
        if way_enu_m is not None and (self._pending or self._included):
            self._include(np.array([place_enu_m[:2] for place_enu_m in way_enu_m]), home_up_m)
        self._carry_on(may_begin=may_begin)

    def take_off(self) -> bool:
        """Leave nothing of ours on the vehicle, which has landed; whether that is over."""
        now_s = self._conversation.now_s
        if self._ours and self._off_by_s is None:
            self.interrupt()
            self._off_by_s = now_s + _TAKING_OFF_S
            self._want(())
        if self._ours:
            self._carry_on(may_begin=True)
        if self._ours and self._off_by_s is not None and now_s >= self._off_by_s:
            self.interrupt()
            self._ours, self._held, self._is_on = False, None, False
            self._left = "the zones of this mission stand on it still, as its fence"
        return not self._ours

    @property
    def stands(self) -> bool:
        """Whether there may be something of ours on the vehicle."""
        return self._ours

    @property
    def objection(self) -> str | None:
        """Why a vehicle on the ground is not started yet, in words; None if it may be."""
        if self._pending and self._low_m is None:
            return "waiting for a position"
        if self._is_settled or self._failures >= _TRIES:
            return None
        again = f" failed ({self._failure}), trying again" if self._failure else ""
        return f"putting the zones on it as its fence{again}"

    @property
    def caution(self) -> str | None:
        """What people should know of it; None if there is nothing."""
        if self._without is not None:
            return f"{self._without}: {_ALONE}"
        if self._failures >= _TRIES:
            return f"{self._failure}: {_ALONE}"
        if self._held and (setup := self._setup.caution) is not None:
            return f"zones are on it as its fence, but {setup}"
        return self._left or self._disowned

    # What happens.

    def on_message(self, message: Inbound) -> None:
        """Take what concerns fences."""
        self._parameters.on_message(message)
        said = message.text if isinstance(message, StatusText) and self._ours else ""
        if self._firmware.disowns_fence(said):
            self._disowned = f"of the zones on it as its fence it says: {said.strip()}"
        self._conversation.say(*self._transfer.on_message(message, self._conversation.now_s))
        self._settle()

    def on_ended(self, ended: CommandEnded) -> None:
        """Take a command's outcome."""
        if ended.tag != _TAG:
            return
        if ended.ending is CommandOutcome.ACCEPTED:
            self._is_on = self._asked_on
        else:
            self._fail(f"it does not switch its fence on ({result_text(ended.result)})")

    def interrupt(self) -> None:
        """Let another transfer begin now; this one is begun anew after it."""
        if self._transfer.busy:
            self._conversation.say(*self._transfer.cancel("another transfer goes first"))
            self._forget_transfer()

    def abort(self) -> None:
        """Say nothing more, because the vehicle is somebody else's, and perhaps its fence, too."""
        if self._transfer.busy:
            self._transfer.abort("it is not ours any more")
        self._forget_transfer()
        self._ours = False

    def next_deadline_s(self) -> float | None:
        """When there is something to do, beside what follows from news; None also at a rest."""
        if self._driven_s < self._conversation.now_s:
            return None
        if self._transfer.busy:
            return self._transfer.next_deadline_s()
        if self._is_settled:
            return None
        return max(self._next_at_s, self._conversation.now_s + _POLL_S)

    # Pieces.

    @property
    def _is_settled(self) -> bool:
        """Whether there is nothing to be done."""
        if self._without is not None or not (self._wanted or self._ours):
            return True
        wants_on = self._setup.switches and bool(self._wanted)
        return self._held == self._wanted and self._is_on is wants_on

    @property
    def _setup(self) -> FenceSetup:
        return self._firmware.fence_setup(self._parameters.values)

    def _want(self, included: Sequence[Zone]) -> None:
        """Let these zones be part of it, and the others as soon as they may be."""
        origin = self._conversation.config.origin
        self._included = tuple(included)
        self._pending = tuple(zone for zone in self._zones if zone not in self._included)
        self._wanted = tuple(area for zone in included for area in fence_areas(zone, origin))
        self._failures, self._next_at_s = 0, -math.inf
        self._failure = self._disowned = None

    def _include(self, way_m: FloatArray, home_up_m: float) -> None:
        """Make zones part of it that the vehicle is outside of, if they lie in every way.

        Until they stand on the vehicle it must stay outside.

        Args:
            way_m: shape (2, 2), begin and end [m; east, north].
            home_up_m: height of its home [m above the mission origin].
        """
        if self._low_m is None:
            self._low_m = home_up_m + _LOW_M
        heights_m = (self._low_m, self._conversation.config.fence_height_m)
        pending = [zone for zone in self._pending if blocks_all_heights(zone, *heights_m)]
        self._pending = tuple(pending)
        zones = [*self._included, *pending]
        if self._held == self._wanted or self._transfer.busy:
            kept, new = self._included, pending
        else:
            kept, new = (), zones
        outside = (zone for zone in new if self._zones[zone].clear(way_m[:1], way_m[1:])[0])
        wanted = [*kept, *outside]
        if wanted != list(self._included):
            self._want(wanted)
            self._pending = tuple(zone for zone in zones if zone not in wanted)

    def _carry_on(self, *, may_begin: bool) -> None:
        now_s = self._driven_s = self._conversation.now_s
        self._conversation.say(*self._transfer.on_time(now_s))
        self._settle()
        if self._ours and not self._wanted and self._held == () and not self._is_on:
            self._ours, self._held = False, None
        if self._transfer.busy or self._is_settled or now_s < self._next_at_s:
            return
        if not (may_begin and self._knows_setup()):
            return
        setup = self._setup
        if not (setup.puts or self._ours):
            self._without = f"zones are not put on it as its fence, since {setup.caution}"
        elif not self._ours:
            self._sent = None
            self._conversation.say(*self._transfer.read(range(1, _MOST_ITEMS), now_s))
        elif self._held != self._wanted:
            self._put()
        elif not self._conversation.commands.pending(_TAG):
            self._switch(on=not self._is_on)

    def _knows_setup(self) -> bool:
        """Whether its parameters are known, or it will not tell them; asks for them if not."""
        unread = self._parameters.unread((name,) for name in self._parameters.names)
        now_s = self._conversation.now_s
        if not unread or self._asks > _ASKS:
            return True
        if now_s >= self._ask_at_s:
            self._asks += 1
            self._ask_at_s = now_s + self._conversation.config.commands.ack_timeout_s / 2.0
            self._conversation.say(*map(ParameterRead, unread))
        return False

    def _put(self) -> None:
        """Clear what is to go, and put on the rest."""
        now_s, held = self._conversation.now_s, self._held or ()
        self._stale |= any(area not in self._wanted for area in held)
        self._sent = () if self._stale else self._wanted
        if self._sent:
            self._conversation.say(*self._transfer.upload(fence_items(self._sent), now_s))
        else:
            if self._is_on:  # ArduCopter heeds what it has cleared for some tenths of a second
                self._switch(on=False)
            self._conversation.say(*self._transfer.clear(now_s))

    def _switch(self, *, on: bool) -> None:
        self._asked_on = on
        self._conversation.send(_TAG, self._firmware.switch_polygons(on=on))

    def _settle(self) -> None:
        """Take the outcome of a transfer, once."""
        if self._transfer.busy or self._transfer.result is None:
            return
        result, self._transfer.result = self._transfer.result, None
        match result:
            case MissionRead(count, items):
                self._on_read(count, areas_of(items) if items or not count else None)
            case MissionInForce():
                self._held, self._stale = self._sent, False
                self._failures, self._failure = 0, None
            case MissionFailed(unsupported=True) if not self._ours:
                self._without = "its firmware takes no fence"
            case MissionFailed(reason):
                self._held = None
                self._fail(f"zones cannot be put on it as its fence ({reason})")

    def _on_read(self, count: int, areas: tuple[FenceArea, ...] | None) -> None:
        """What stands on the vehicle is ours, or is left there."""
        held = [next(filter(area.is_same, self._known), None) for area in areas or ()]
        known = tuple(area for area in held if area is not None)
        if areas is not None and len(known) == len(areas):
            self._ours, self._held = True, known
        else:
            points = f"{count} item{'s' if count != 1 else ''}"
            self._without = f"it has a fence of its own ({points}), which is left as it is"

    def _fail(self, reason: str) -> None:
        self._failures += 1
        self._failure = reason
        pause_s = self._conversation.config.retry_delay_s
        if self._failures >= _TRIES:
            pause_s = _LATER_S
        self._next_at_s = self._conversation.now_s + pause_s

    def _forget_transfer(self) -> None:
        self._transfer.result = None
        self._held = None
