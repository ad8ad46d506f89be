"""A vehicle of the virtual-time world that is the real bridge and a simulated autopilot.

Joined by MAVLink frames over a link that may lose some, be slow or be cut. Boot, preparation
and takeoff take their virtual time. The bridge lives as long as the process of its agent; the
next process makes a new one, on a channel of its own, to a vehicle that flew on. Leaves out:
processes that hang (their bridge goes on), signatures, and streams that split frames
(agent.vehicle.framing).
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from functools import partial
from typing import Protocol

from agent.core.interface import Home, Return, VehicleOrder, VehicleReport
from agent.vehicle import session as ground
from agent.vehicle.bridge import Bridge
from agent.vehicle.config import BridgeConfig
from agent.vehicle.conversation import BridgeAction, SendBytes
from sim.autopilot import events as air
from sim.autopilot.codec import ChannelCodec
from sim.autopilot.config import VehicleConfig
from sim.autopilot.faults import VehicleFault
from sim.autopilot.faulty_vehicle import FaultyAutopilot
from sim.autopilot.firmware import FirmwareModelName, firmware_model
from sim.autopilot.pilot import Pilot
from sim.autopilot.vehicle import COMPONENT_ID, SimulatedAutopilot
from sim.world.engine import EventQueue, stream, uniforms

_LEAST_SLEEP_S = 0.001


@dataclass(frozen=True, slots=True)
class LinkQuality:
    """What a MAVLink link does to frames, each way.

    Raises:
        ValueError: a number is out of range.
    """

    latency_s: float = 0.005
    loss_frac: float = 0.0
    """Share of the frames that are lost, 0..1."""

    def __post_init__(self) -> None:
        if not 0.0 <= self.latency_s < math.inf:
            raise ValueError(f"latency must be >= 0 s and finite, not {self.latency_s}")
        if not 0.0 <= self.loss_frac <= 1.0:
            raise ValueError(f"loss must be within 0..1, not {self.loss_frac}")


@dataclass(frozen=True, slots=True)
class Equipment:
    """What one UAV flies with."""

    vehicle: VehicleConfig
    bridge: BridgeConfig
    flavour: FirmwareModelName = FirmwareModelName.ARDUPILOT
    faults: tuple[VehicleFault, ...] = ()
    link: LinkQuality = LinkQuality()


class SteppedBridge(Protocol):
    """A bridge, or one that somebody watches."""

    def step(self, event: ground.BridgeEvent, now_s: float) -> list[BridgeAction]:
        """What to do about ``event``, in order."""
        ...

    def next_deadline_s(self) -> float:
        """When to step with `TimePassed` if nothing else happens before."""
        ...


class BridgedVehicle:
    """One vehicle behind its bridge; see `sim.world.vehicles.SimulatedVehicle`.

    The autopilot is powered up at once. ``report`` is called with everything the bridge says, at
    the time it says it; ``make_bridge`` makes the bridge of each life of the agent.
    """

    def __init__(
        self,
        queue: EventQueue,
        uav: str,
        report: Callable[[VehicleReport], None],
        equipment: Equipment,
        seed: int,
        make_bridge: Callable[[BridgeConfig], SteppedBridge] = Bridge,
    ) -> None:
        start_s = queue.now_s()
        vehicle = SimulatedAutopilot(
            equipment.vehicle, firmware_model(equipment.flavour, equipment.vehicle.vehicle), start_s
        )
        self._machine = FaultyAutopilot(vehicle, equipment.faults, start_s)
        self._queue = queue
        self._report = report
        self._equipment = equipment
        self._make_bridge = make_bridge
        self._draws: Iterator[float] = uniforms(stream(seed, "mavlink", uav))
        self._cut_until_s = -math.inf
        self._era = 0
        """Another one whenever an agent comes or goes; also the number of the channel."""
        self._bridge: SteppedBridge | None = None
        self._codec = self._new_codec()
        self._ground_tick_s = self._air_tick_s = math.inf

    def order(self, order: VehicleOrder, ready: VehicleReport) -> None:
        """Let the bridge obey; without one, there is nothing to bring home (agent.runner)."""
        del ready
        if self._bridge is None:
            if isinstance(order, Return) and not order.resume:
                self._later(0.0, partial(self._report, Home()))
                return
            self._connect()
        self._step_ground(order)

    def leave(self) -> None:
        """The agent's process has ended, and with it the bridge; the autopilot flies on."""
        if self._bridge is not None:
            self._bridge = None
            self._machine.step(air.Disconnected(self._era), self._queue.now_s())
        self._era += 1

    def telemetry(self) -> None:
        """Nothing: the bridge reports by itself where the vehicle is."""

    def cut(self, duration_s: float) -> None:
        """Let nothing through on the link for that long, which nobody is told."""
        self._cut_until_s = self._queue.now_s() + duration_s

    def pilot(self, after_s: float = 0.0) -> Pilot:
        """The autopilot as it is now, or if nobody says anything to it for a while.

        Nothing else may happen to it afterwards if it was brought ahead of the queue's time.
        """
        self._machine.step(air.TimeAdvanced(), self._queue.now_s() + after_s)
        return self._machine.pilot

    # Either end of the link.

    def _connect(self) -> None:
        self._era += 1
        self._bridge = self._make_bridge(self._equipment.bridge)
        self._codec = self._new_codec()
        self._ground_tick_s = self._air_tick_s = math.inf
        self._step_ground(ground.LinkOpened())
        self._step_air(air.Connected(self._era))

    def _new_codec(self) -> ChannelCodec:
        return ChannelCodec(self._equipment.vehicle.system_id, COMPONENT_ID, datagrams=True)

    def _step_ground(self, event: ground.BridgeEvent) -> None:
        bridge = self._bridge
        if bridge is None:
            return
        frames = []
        for action in bridge.step(event, self._queue.now_s()):
            if isinstance(action, SendBytes):
                frames.append(action.data)
            else:
                # Not from inside: whoever ordered is in the middle of its own step.
                self._later(0.0, partial(self._report, action))
        self._carry(frames, self._hear_in_air)
        at_s = self._wake_s(bridge.next_deadline_s())
        if at_s < self._ground_tick_s:
            self._ground_tick_s = at_s
            self._later(at_s - self._queue.now_s(), partial(self._tick_ground, at_s))

    def _step_air(self, event: air.VehicleEvent) -> None:
        said = self._machine.step(event, self._queue.now_s())
        here = [send for send in said if send.channel in (None, self._era)]
        frames = [self._codec.encode(send.message, send.system_id) for send in here]
        self._carry(frames, self._hear_on_ground)
        at_s = self._wake_s(self._machine.next_deadline_s())
        if at_s < self._air_tick_s:
            self._air_tick_s = at_s
            self._later(at_s - self._queue.now_s(), partial(self._tick_air, at_s))

    def _tick_ground(self, at_s: float) -> None:
        if at_s == self._ground_tick_s:  # else an earlier one has taken its place
            self._ground_tick_s = math.inf
            self._step_ground(ground.TimePassed())

    def _tick_air(self, at_s: float) -> None:
        if at_s == self._air_tick_s:
            self._air_tick_s = math.inf
            self._step_air(air.TimeAdvanced())

    def _hear_in_air(self, frames: Sequence[bytes]) -> None:
        for frame in frames:
            for message in self._codec.decode(frame):
                self._step_air(air.MavlinkReceived(self._era, message))

    def _hear_on_ground(self, frames: Sequence[bytes]) -> None:
        for frame in frames:
            self._step_ground(ground.BytesReceived(frame))

    # The link itself.

    def _carry(self, frames: Sequence[bytes], hear: Callable[[Sequence[bytes]], None]) -> None:
        """Bring what is not lost of ``frames`` to the other end."""
        link = self._equipment.link
        if link.loss_frac:
            frames = [frame for frame in frames if next(self._draws) >= link.loss_frac]
        if frames and self._queue.now_s() >= self._cut_until_s:
            self._later(link.latency_s, partial(hear, frames))

    def _wake_s(self, deadline_s: float) -> float:
        now_s = self._queue.now_s()
        return deadline_s if deadline_s > now_s else now_s + _LEAST_SLEEP_S

    def _later(self, delay_s: float, callback: Callable[[], None]) -> None:
        """Do that, unless the agent's process has ended by then."""
        era = self._era

        def do() -> None:
            if era == self._era:
                callback()

        self._queue.after(delay_s, do)
