"""The bridge with a link and a clock: the only place of it where time passes.

Everything happens in the loop's thread and without waiting: an order is on its way to the autopilot
before `order` returns. Ground stations may be shown the vehicle: its frames as they came. Two who
command one vehicle undo each other's orders, so nothing that they say is passed on to it.
"""

from __future__ import annotations

import asyncio
from collections import Counter, deque
from collections.abc import Callable, Hashable, Mapping, Sequence

from agent.core.interface import HandedOver, VehicleOrder, VehicleReport
from agent.core.station_words import StationAction, StationAsked
from agent.links.link import ByteLink, open_link
from agent.links.station_links import StationLinks
from agent.links.vehicle_clock import VehicleClock
from agent.vehicle.bridge import Bridge
from agent.vehicle.config import BridgeConfig, parse_forward, parse_link
from agent.vehicle.conversation import SendBytes
from agent.vehicle.session import BridgeEvent, BytesReceived, LinkClosed, LinkOpened, TimePassed
from agent.vehicle.signing import Signing, SigningKey
from agent.vehicle.turnaround import TurnaroundMeter
from swarm.runtime.clock import Clock, unix_s
from swarm.runtime.log import get_logger

TURNAROUNDS = "next targets sent"
"""Event in whose log line a vehicle tells how long each next target took."""
CLOCK = "clock of the vehicle"
"""Event in whose log line it tells how many seconds of its clock passed in one of ours."""


_SHORTEST_WAIT_S = 0.001

_REDIAL_TIMEOUTS = 2.0
"""A link that has been silent for that many of the bridge's timeouts is dialled again, if the
vehicle was not ours to hand over, which does so at once."""


class MavlinkVehicle:
    """A vehicle behind a MAVLink link. Close it in ``finally``.

    Args:
        config: how to treat it.
        url: where the autopilot is; see `agent.links.link`.
        clock: vehicle time; a scaled one when the vehicle is simulated faster.
        on_report: hears every report, in order, in the loop's thread. It may give
            orders from inside the call.
        key: shared with the autopilot: everything is signed, nothing unsigned believed.
        forward: URLs of ground stations that are shown the vehicle.
        on_asked: hears what these ask of the UAV; None: they may not.

    Raises:
        InputError: a URL is wrong, or this machine cannot open such a link.
    """

    def __init__(
        self,
        config: BridgeConfig,
        url: str,
        clock: Clock,
        on_report: Callable[[VehicleReport], None],
        *,
        key: SigningKey | None = None,
        forward: Sequence[str] = (),
        on_asked: Callable[[StationAsked], None] | None = None,
    ) -> None:
        self.bridge = Bridge(config, None if key is None else Signing(key, unix_s))
        redial_s = clock.wall_delay_s(_REDIAL_TIMEOUTS * config.silence_timeout_s)
        self.link: ByteLink = open_link(parse_link(url), self, silence_s=redial_s)
        self._stations = StationLinks(
            map(parse_forward, forward),
            config.system_id,
            clock,
            on_asked,
            key=key,
        )
        self.bridge.codec.keep_frames = bool(self._stations)
        self._log = get_logger(__name__, link=self.link.url)
        self._told_dropped: set[str] = set()
        self._told_unchecked = False
        self._meter = TurnaroundMeter()
        self._vehicle_clock = VehicleClock()
        self._clock = clock
        self._on_report = on_report
        self._reports: deque[VehicleReport] = deque()
        self._reporting = False
        self._closed = False
        self._timer: asyncio.TimerHandle | None = None
        self._timer_due_s = float("inf")

    async def start(self) -> None:
        """Open the link and go to work, in the running loop."""
        self.link.start()
        self._stations.start()
        self._happen(TimePassed())

    @property
    def dropped(self) -> Mapping[str, int]:
        """What was dropped so far, by reason: frames, and parameters."""
        dropped = self._disbelieved()
        dropped["absurd parameters"] = self.bridge.absurd_parameters
        dropped["not forwarded"] = self._stations.dropped
        dropped["from ground stations"] = self._stations.distrusted
        return +dropped

    def _disbelieved(self) -> Counter[str]:
        """What was not listened to, by reason."""
        dropped = Counter(self.bridge.codec.distrusted)
        dropped["from strangers"] = self.bridge.codec.strangers
        return +dropped

    def order(self, order: VehicleOrder) -> None:
        """Give the vehicle an order; what comes of it is reported."""
        self._happen(order)

    def tell_stations(self, action: StationAction) -> None:
        """Tell the ground stations that are shown the vehicle."""
        self._stations.tell(action)

    async def close(self) -> None:
        """Leave the vehicle as it is and close the link; closing twice is fine."""
        self._closed = True
        if self._timer is not None:
            self._timer.cancel()
            self._timer = None
        await self.link.close()
        await self._stations.close()
        self._tell_turnarounds()
        if (frac := self._vehicle_clock.frac) is not None:
            self._log.info(CLOCK, clock_frac=round(frac, 4))

    def link_up(self) -> None:
        """Called by the link."""
        self._happen(LinkOpened())

    def link_down(self) -> None:
        """Called by the link."""
        self._happen(LinkClosed())

    def received(self, data: bytes, source: Hashable | None = None) -> None:
        """Called by the link."""
        self._meter.received(self._clock.now_s())
        self._happen(BytesReceived(data, source))
        if (boot_s := self.bridge.boot_s) is not None:
            self._vehicle_clock.note(boot_s, self._clock.now_s())
        self._stations.show(self.bridge.codec.take_frames())
        self._tell_of_dropped()

    def _tell_of_dropped(self) -> None:
        """Tell people of every reason once: a hostile peer must not fill the log."""
        codec = self.bridge.codec
        believes_all = not (codec.distrusted or codec.strangers)
        for reason, count in () if believes_all else self._disbelieved().items():
            if reason not in self._told_dropped:
                self._told_dropped.add(reason)
                self._log.warning("frames are dropped", reason=reason, count=count)
        if self.bridge.codec.unchecked_frames and not self._told_unchecked:
            self._told_unchecked = True
            self._log.warning(
                "the vehicle signs, and may obey nobody who does not; give --signing-key"
            )

    def _tell_turnarounds(self) -> None:
        """Log how long each next target took, in wall time; once."""
        done, self._meter.turnarounds = self._meter.turnarounds, []
        idled, self._meter.idled = self._meter.idled, 0
        if done or idled:
            targets_ms = [self._wall_ms(each.target_s) for each in done]
            in_force_ms = [self._wall_ms(each.in_force_s) for each in done if each.in_force_s]
            self._log.info(TURNAROUNDS, target_ms=targets_ms, in_force_ms=in_force_ms, idled=idled)

    def _wall_ms(self, duration_s: float) -> float:
        return round(1e3 * self._clock.wall_delay_s(duration_s), 3)

    def _happen(self, event: BridgeEvent) -> None:
        """Step the bridge and send what it says; what it reports follows.

        An order from inside a report is sent before the next report, and before whatever
        else the hearer makes of its own: to publish or log may take longer than to decide.
        """
        if self._closed:
            return
        if isinstance(event, VehicleOrder):
            self._meter.ordered(event)
        actions = self.bridge.step(event, self._clock.now_s())
        self.link.answer(self.bridge.codec.peer)
        for action in actions:
            if isinstance(action, SendBytes):
                self.link.send(action.data)
                self._meter.sent(action.data, self._clock.now_s())
            else:
                if isinstance(action, HandedOver):
                    self._let_go()
                self._reports.append(action)
        if not self._reporting:
            self._report()
            self._set_timer()

    def _report(self) -> None:
        self._reporting = True
        try:
            while self._reports:
                report = self._reports.popleft()
                self._meter.reported(report)
                self._on_report(report)
        finally:
            self._reporting = False

    def _let_go(self) -> None:
        """No order may reach a vehicle that was handed over, however late its link delivers."""
        if self.bridge.silent:
            self.link.give_up()
        else:
            self.link.discard()

    def _set_timer(self) -> None:
        loop = asyncio.get_running_loop()
        wait_s = self._clock.wall_delay_s(self.bridge.next_deadline_s() - self._clock.now_s())
        due_s = loop.time() + max(wait_s, _SHORTEST_WAIT_S)
        if self._timer is not None:
            if self._timer_due_s <= due_s:
                return  # it will ring early enough, and look again
            self._timer.cancel()
        self._timer_due_s = due_s
        self._timer = loop.call_at(due_s, self._ring)

    def _ring(self) -> None:
        self._timer = None
        self._happen(TimePassed())
