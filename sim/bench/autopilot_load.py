"""How many flying vehicles with telemetry one process simulates.

The vehicles live in a process of their own, whose processor time is counted; their ground
stations are TCP clients in this one. Each asks for the streams that the bridge asks for,
sends its vehicle away, and times the answer to a TIMESYNC once a second, which includes the
way through this process. Leaves out: missions, and clients that decode what they hear.
"""

from __future__ import annotations

import asyncio
import contextlib
import functools
import struct
from collections import Counter
from collections.abc import AsyncIterator, Iterable
from dataclasses import dataclass

import numpy as np
from pymavlink.dialects.v20 import ardupilotmega as mavlink
from rich.console import RenderableType

from agent.vehicle.config import BridgeConfig
from agent.vehicle.firmware.ardupilot import ArduCopter
from sim.bench.fleets import scenario_file, started, survey_mission
from sim.bench.machine import cpu_s, this_machine
from sim.bench.results import BenchResult, Progress, table_of, unheard
from swarm.model import Mission, Origin
from swarm.model.frames import DEFAULT_ORIGIN
from swarm.runtime.clock import Clock, SystemClock
from swarm.runtime.table import Column

POSITION_HZ = 10.0
READY_S = 4.0
"""From power-up until a vehicle can be armed [s]."""
TAKEN_OFF_S = 7.0
"""From the order to take off until a target is flown to [s]."""
SETTLE_S = 2.0
"""From the last order to the measurement [s]."""
FAR_E7 = 5_000_000
"""So far away, in 1e-7 degrees, that no vehicle arrives."""
HEIGHT_M = 10.0
_MAGIC = 0xFD
_OVERHEAD_BYTES = 12
_SIGNATURE_BYTES = 13
_GUIDED = 4


@dataclass(frozen=True, slots=True)
class StreamRate:
    """One message of all vehicles together."""

    message: str
    asked_hz: float
    """Of every vehicle."""
    delivered_frac: float
    """Messages heard, per message asked for in that time."""


@dataclass(frozen=True, slots=True)
class AutopilotLoad(BenchResult):
    """What was measured."""

    vehicles: int
    seconds: float
    """Length of the measurement [s]."""
    streams: tuple[StreamRate, ...]
    messages_per_s: float
    delivered_frac: float
    """Of all streams together."""
    cores: float
    """Processor time of the autopilots' process per second."""
    latency_p50_s: float | None
    latency_p99_s: float | None
    latency_largest_s: float | None

    def parts(self) -> Iterable[RenderableType]:
        """See `BenchResult`."""
        yield f"{self.vehicles} flying vehicles in one process, {self.seconds:.0f} s:"
        yield table_of(
            self.streams,
            Column("message", words=True, key="message"),
            Column("asked", "g", "Hz", key="asked_hz"),
            Column("delivered", ".2%", key="delivered_frac"),
        )
        latencies_s = (self.latency_p50_s, self.latency_p99_s, self.latency_largest_s)
        answers = "no answer was timed"
        if None not in latencies_s:
            median, p99, largest = (f"{1e3 * (time_s or 0.0):.1f} ms" for time_s in latencies_s)
            answers = (
                f"answers after {median} (median), {p99} (p99), {largest} (largest), the client's "
                "own time included"
            )
        yield (
            f"{self.delivered_frac:.2%} of what was asked for, {self.messages_per_s:.0f} messages "
            f"per second by {self.cores:.2f} cores; {answers}."
        )


class FrameCounter:
    """Counts MAVLink 2 frames by message without decoding them."""

    def __init__(self) -> None:
        self.counts: Counter[int] = Counter()
        """Frames by message id."""
        self._rest = b""

    def feed(self, data: bytes) -> list[bytes]:
        """Take bytes of the stream; the payloads of the TIMESYNC answers among them."""
        data = self._rest + data
        answers = []
        at = 0
        while len(data) - at >= _OVERHEAD_BYTES:
            if data[at] != _MAGIC:
                at += 1
                continue
            length = data[at + 1]
            signed = data[at + 2] & 1
            end = at + _OVERHEAD_BYTES + length + (_SIGNATURE_BYTES if signed else 0)
            if end > len(data):
                break
            message_id = int.from_bytes(data[at + 7 : at + 10], "little")
            self.counts[message_id] += 1
            if message_id == mavlink.MAVLINK_MSG_ID_TIMESYNC:
                answers.append(data[at + 10 : at + 10 + length])
            at = end
        self._rest = data[at:]
        return answers


def rates_asked_hz(origin: Origin) -> dict[int, float]:
    """What the bridge asks of ArduCopter, by message id, with positions at full rate."""
    status_hz = BridgeConfig(system_id=1, origin=origin).status_rate_hz
    streams = {message_id: status_hz for message_id, _ in ArduCopter().streams}
    return {mavlink.MAVLINK_MSG_ID_GLOBAL_POSITION_INT: POSITION_HZ, **streams}


def stream_rates(
    heard: Counter[int], asked_hz: dict[int, float], vehicles: int, seconds: float
) -> tuple[StreamRate, ...]:
    """How much of each stream was delivered; messages and rates are by message id."""
    return tuple(
        StreamRate(
            mavlink.mavlink_map[message_id].msgname,
            rate_hz,
            heard[message_id] / (rate_hz * vehicles * seconds),
        )
        for message_id, rate_hz in asked_hz.items()
    )


class _Client(asyncio.Protocol):
    """The ground station of one vehicle."""

    def __init__(self, system_id: int, clock: Clock, rtts_s: list[float]) -> None:
        self.frames = FrameCounter()
        self._system_id = system_id
        self._clock = clock
        self._rtts_s = rtts_s
        self._mav = mavlink.MAVLink(None, srcSystem=255, srcComponent=190)
        self._transport: asyncio.WriteTransport | None = None

    def connection_made(self, transport: asyncio.BaseTransport) -> None:
        if isinstance(transport, asyncio.WriteTransport):
            self._transport = transport

    def data_received(self, data: bytes) -> None:
        for payload in self.frames.feed(data):
            _, sent_ns = struct.unpack("<qq", payload.ljust(16, b"\0")[:16])
            self._rtts_s.append(self._clock.now_s() - sent_ns / 1e9)

    def close(self) -> None:
        if self._transport is not None:
            self._transport.abort()

    def ask_for(self, rates_hz: dict[int, float]) -> None:
        for message_id, rate_hz in rates_hz.items():
            self._command(mavlink.MAV_CMD_SET_MESSAGE_INTERVAL, message_id, 1e6 / rate_hz)

    def take_off(self) -> None:
        self._command(mavlink.MAV_CMD_DO_SET_MODE, 1, _GUIDED)
        self._command(mavlink.MAV_CMD_COMPONENT_ARM_DISARM, 1)
        self._command(mavlink.MAV_CMD_NAV_TAKEOFF, 0, 0, 0, 0, 0, 0, HEIGHT_M)

    def fly_away(self, lat_e7: int, lon_e7: int) -> None:
        self._send(
            mavlink.MAVLink_command_int_message(
                self._system_id,
                1,
                mavlink.MAV_FRAME_GLOBAL_RELATIVE_ALT,
                mavlink.MAV_CMD_DO_REPOSITION,
                *(0, 0, -1.0, 1.0, 0.0, 0.0),
                *(lat_e7, lon_e7, HEIGHT_M),
            )
        )

    def time_answer(self) -> None:
        self._send(mavlink.MAVLink_timesync_message(0, int(self._clock.now_s() * 1e9)))

    def _command(self, command: int, *params: float) -> None:
        filled = [*params, *[0.0] * (7 - len(params))]
        self._send(mavlink.MAVLink_command_long_message(self._system_id, 1, command, 0, *filled))

    def _send(self, message: mavlink.MAVLink_message) -> None:
        if self._transport is not None:
            self._transport.write(message.pack(self._mav))
            self._mav.seq = (self._mav.seq + 1) % 256


async def measure_autopilot(
    vehicles: int, seconds: float, seed: int, tell: Progress = unheard
) -> AutopilotLoad:
    """Fly ``vehicles`` in one process, and measure for ``seconds``.

    Raises:
        ChildFailedError: the process did not start.
        OSError: a vehicle could not be reached, or there is no /proc.
    """
    machine, clock = this_machine(), SystemClock()
    mission = survey_mission(vehicles, 1, seed)
    origin = mission.origin or DEFAULT_ORIGIN
    asked_hz = rates_asked_hz(origin)
    # Vehicles of a fleet are not asked in step.
    pauses_s = np.random.default_rng(seed).uniform(0.0, 1.0, vehicles).tolist()
    rtts_s: list[float] = []
    async with _served(mission, clock, rtts_s, tell) as (pid, clients):
        await asyncio.sleep(READY_S)
        tell(f"taking off with {vehicles} vehicles")
        flights = [
            _fly(client, asked_hz, origin, pause_s)
            for client, pause_s in zip(clients, pauses_s, strict=True)
        ]
        await asyncio.gather(*flights)
        tell(f"flying {vehicles} vehicles")
        timing = [asyncio.ensure_future(each) for each in map(_time_answers, clients, pauses_s)]
        try:
            await asyncio.sleep(SETTLE_S)
            rtts_s.clear()
            began_s, before, spent_s = clock.now_s(), _heard(clients), cpu_s(pid)
            await asyncio.sleep(seconds)
            passed_s = clock.now_s() - began_s
            heard, spent_s = _heard(clients), cpu_s(pid) - spent_s
        finally:
            for task in timing:
                task.cancel()
            await asyncio.gather(*timing, return_exceptions=True)
    heard.subtract(before)
    n_heard = sum(heard[message_id] for message_id in asked_hz)
    times_s = np.array(rtts_s)
    return AutopilotLoad(
        machine=machine,
        vehicles=vehicles,
        seconds=passed_s,
        streams=stream_rates(heard, asked_hz, vehicles, passed_s),
        messages_per_s=sum(heard.values()) / passed_s,
        delivered_frac=n_heard / (sum(asked_hz.values()) * vehicles * passed_s),
        cores=spent_s / passed_s,
        latency_p50_s=float(np.median(times_s)) if times_s.size else None,
        latency_p99_s=float(np.quantile(times_s, 0.99)) if times_s.size else None,
        latency_largest_s=float(times_s.max()) if times_s.size else None,
    )


@contextlib.asynccontextmanager
async def _served(
    mission: Mission, clock: Clock, rtts_s: list[float], tell: Progress
) -> AsyncIterator[tuple[int, list[_Client]]]:
    """The process that simulates the UAVs of a mission, and a client of each."""
    tell(f"starting {len(mission.uavs)} vehicles")
    loop = asyncio.get_running_loop()
    async with contextlib.AsyncExitStack() as stack:
        scenario = stack.enter_context(scenario_file(mission))
        child = await started(stack, "autopilots", ["autopilot", str(scenario), "--json"])
        clients = []
        for said in await child.ready(len(mission.uavs)):
            _, host, port = str(said["url"]).split(":")
            factory = functools.partial(_Client, int(said["system_id"]), clock, rtts_s)
            _, client = await loop.create_connection(factory, host, int(port))
            stack.callback(client.close)
            clients.append(client)
        yield child.pid, clients


async def _fly(client: _Client, asked_hz: dict[int, float], origin: Origin, pause_s: float) -> None:
    """Ask for telemetry, take off and leave for a place that is never reached."""
    await asyncio.sleep(pause_s)
    client.ask_for(asked_hz)
    client.take_off()
    await asyncio.sleep(TAKEN_OFF_S)
    client.fly_away(round(origin.lat_deg * 1e7) + FAR_E7, round(origin.lon_deg * 1e7) + FAR_E7)


async def _time_answers(client: _Client, pause_s: float) -> None:
    """Ask for an answer once a second, until cancelled."""
    await asyncio.sleep(pause_s)
    while True:
        client.time_answer()
        await asyncio.sleep(1.0)


def _heard(clients: list[_Client]) -> Counter[int]:
    return sum((client.frames.counts for client in clients), Counter[int]())
