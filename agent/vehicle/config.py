"""Settings of one vehicle's bridge, and the URLs of its links."""

from __future__ import annotations

import math
import re
from collections.abc import Collection
from dataclasses import dataclass, field, fields, replace
from enum import StrEnum
from typing import ClassVar

from agent.vehicle.commands import CommandPolicy
from swarm.bus.config import is_loopback
from swarm.model import Zone
from swarm.model.frames import Origin
from swarm.model.terrain import Terrain
from swarm.protocol.fields import Point
from swarm.runtime.errors import Fault, InputError

ONBOARD_COMPUTER = 191
"""Component id of a companion (MAV_COMP_ID_ONBOARD_COMPUTER, MAV_COMPONENT of common.xml)."""

_INSIDE = 0.999
"""Of the fence: rounding must not lead out of it again."""


class CommandStyle(StrEnum):
    """How a vehicle is told where to fly."""

    REPOSITION = "reposition"
    """Each target by MAV_CMD_DO_REPOSITION: in force within one message."""
    MISSION = "mission"
    """Each target as a mission that ends in a return home: the vehicle comes home by itself
    if nobody commands it any more."""


def status_rate_for(position_rate_hz: float) -> float:
    """Rate of the other streams beside positions at that rate: a fifth of it, within 1 to 2 Hz.

    There are several of them, so they would be most of what is read of a vehicle whose positions
    are asked for seldom.
    """
    return min(2.0, max(1.0, position_rate_hz / 5.0))


@dataclass(frozen=True, slots=True)
class BridgeConfig:
    """How the bridge treats its vehicle; every duration is in vehicle seconds.

    Raises:
        ValueError: an id, rate, limit or duration is out of range.
    """

    system_id: int
    """MAVLink system id of the vehicle; any other vehicle is never commanded."""
    origin: Origin
    """Zero of the mission's local frame."""
    command: CommandStyle = CommandStyle.REPOSITION
    ground_system_id: int = 255
    """Our own MAVLink system id: the one to which failsafes of both firmwares listen."""
    ground_component_id: int = ONBOARD_COMPUTER
    """Our own MAVLink component id: an onboard computer's. Not a ground station's 190, which
    QGroundControl has on the same system id: its answers would be taken for ours."""
    acceptance_radius_m: float = 1.0
    """Distance to the target, height included, within which the vehicle has arrived."""
    arrival_speed_m_s: float = 0.5
    """Speed below which the vehicle counts as having stopped."""
    position_rate_hz: float = 10.0
    """Rate of GLOBAL_POSITION_INT that is asked for."""
    status_rate_hz: float = 2.0
    """Rate of the other streams that are asked for."""
    heartbeat_interval_s: float = 1.0
    """Interval of our own heartbeat."""
    silence_timeout_s: float = 5.0
    """Without any message for that long, or a heartbeat for three times as long, the vehicle is
    no longer ours."""
    peer_silence_s: float = 3.0
    """On a link to which anybody can send: after so long without a frame of the vehicle from
    where it was heard last it may be heard from elsewhere."""
    stream_timeout_s: float = 3.0
    """A stream that does not come for that long, or three intervals, is asked for again."""
    commands: CommandPolicy = field(default_factory=CommandPolicy)
    mode_tries: int = 5
    """Times a mode is set without being seen before giving up."""
    arm_tries: int = 15
    """Times arming is asked for, refusals and automatic disarming included."""
    takeoff_tries: int = 8
    """Times takeoff is asked for, refusals included."""
    retry_delay_s: float = 2.0
    """Pause after a refused mode, arming or takeoff."""
    effect_timeout_s: float = 4.0
    """Wait for the effect of an accepted command to be seen."""
    climb_timeout_s: float = 15.0
    """A takeoff that gains no height for that long has failed."""
    takeoff_min_m: float = 0.5
    """Lowest height above home at which a start is accepted."""
    home_tolerance_m: float = 10.0
    """How far the vehicle's home may lie above or below the ground that the scenario tells."""
    stall_timeout_s: float = 5.0
    """A vehicle that stands still elsewhere than at its target for that long is told again."""
    stall_tries: int = 3
    """Times it is told again before the order is given up."""
    mission_patience_s: float = 60.0
    """Commanded by missions: how long the vehicle waits at its target, beyond its stay there,
    for the next one before it returns home by itself."""
    mission_reply_timeout_s: float = 1.5
    """Wait for the vehicle's next message of a mission transfer before repeating one's own."""
    mission_tries: int = 6
    """Transmissions of one message of a transfer without progress before giving up."""
    reached_radius_m: float = 5.0
    """Where the vehicle says itself that it reached its target, it must be at least that near,
    or within the acceptance radius if that is wider."""
    accept_no_failsafe: bool = False
    """Whether a vehicle is flown that would not come home by itself if its agent dies."""
    battery_reserve_frac: float | None = 0.2
    """Charge below which the vehicle should go home, 0..1; None leaves that to the autopilot."""
    position_timeout_s: float = 5.0
    """A vehicle in the air that has told no position for that long is no longer commanded."""
    raises_jerk: bool = True
    """The vehicle's limit of jerk is raised for the flight where that spares time, and put back
    after it (agent.vehicle.parameter_override)."""
    fence_radius_m: float = 20_000.0
    """Targets farther from the origin are refused [m, horizontally]."""
    fence_height_m: float = 1_000.0
    """Targets higher above the origin, or lower below it, are refused [m]."""
    zones: tuple[Zone, ...] = ()
    """Where not to fly, as long as no `KeepOut` says anything else."""
    zone_margin_m: float = 0.0
    terrain: Terrain | None = None
    """The ground that no path comes closer to than its clearance; None: it is not known."""
    """Distance to keep from them [m]."""
    ready_by_itself: bool = False
    """Whether a vehicle that has landed for another battery starts again without anybody's word:
    for simulated ones, beside which nobody stands."""
    full_battery_frac: float = 0.9
    """Charge from which on a battery counts as changed, 0..1."""
    corner_m: float = 4.0
    """How far corners of a path may be cut by a vehicle that turns as it is reckoned to [m]; real
    ones have become slower by then, and cut them by half of it at most."""
    disarm_after_s: float = 10.0
    """A vehicle that has landed for another battery disarms by itself within that time, or is
    told to."""

    def __post_init__(self) -> None:
        for name in ("system_id", "ground_system_id", "ground_component_id"):
            value = getattr(self, name)
            if not (isinstance(value, int) and 1 <= value <= 255):
                raise ValueError(f"{name} must be a whole number within 1..255, not {value}")
        for each in fields(self):
            value = getattr(self, each.name)
            may_be_zero = each.name == "zone_margin_m"
            if each.type not in ("int", "float") or (may_be_zero and value == 0):
                continue
            if not (math.isfinite(value) and value > 0):
                raise ValueError(f"{each.name} must be a number > 0, not {value}")
        reserve_frac = self.battery_reserve_frac
        if reserve_frac is not None and not 0.0 < reserve_frac < 1.0:
            raise ValueError(f"battery_reserve_frac must be within 0..1, not {reserve_frac}")
        if self.full_battery_frac > 1.0:
            raise ValueError(f"full_battery_frac must be at most 1, not {self.full_battery_frac}")

    def out_of_bounds(self, position_enu_m: Point) -> str | None:
        """Why a target must not be sent to the vehicle, in words; None if it may be."""
        east_m, north_m, up_m = position_enu_m
        if not all(math.isfinite(c) for c in position_enu_m):
            return f"target {position_enu_m} is not three finite numbers"
        if math.hypot(east_m, north_m) > self.fence_radius_m:
            return f"target is farther than {self.fence_radius_m:g} m from the origin"
        if abs(up_m) > self.fence_height_m:
            return f"target height {up_m:g} m is beyond {self.fence_height_m:g} m"
        return None

    def within_fence(self, position_enu_m: Point) -> Point:
        """The nearest place that may be a target: that one itself, or a little inside the fence."""
        east_m, north_m, up_m = position_enu_m
        away_m, radius_m = math.hypot(east_m, north_m), self.fence_radius_m
        share = 1.0 if away_m <= radius_m else _INSIDE * radius_m / away_m
        height_m = self.fence_height_m
        if abs(up_m) > height_m:
            up_m = math.copysign(_INSIDE * height_m, up_m)
        return (share * east_m, share * north_m, up_m)

    def for_speedup(self, speedup: float) -> BridgeConfig:
        """The same, but with patience for a vehicle whose time runs ``speedup`` times as fast.

        Answers still take wall time to compute and travel: every wait for one lasts at
        least half a wall second, and silence at least three.

        Raises:
            ValueError: ``speedup`` is not a number > 0.
        """
        if not (math.isfinite(speedup) and speedup > 0.0):
            raise ValueError(f"speedup must be a number > 0, not {speedup}")
        answer_s = 0.5 * speedup
        return replace(
            self,
            silence_timeout_s=max(self.silence_timeout_s, 3.0 * speedup),
            peer_silence_s=max(self.peer_silence_s, 3.0 * speedup),
            stream_timeout_s=max(self.stream_timeout_s, answer_s),
            effect_timeout_s=max(self.effect_timeout_s, answer_s),
            climb_timeout_s=max(self.climb_timeout_s, 2.0 * answer_s),
            stall_timeout_s=max(self.stall_timeout_s, answer_s),
            position_timeout_s=max(self.position_timeout_s, 3.0 * speedup),
            mission_reply_timeout_s=max(self.mission_reply_timeout_s, answer_s),
            # Renewing the wait takes a transfer, and half the patience is left for it.
            mission_patience_s=max(self.mission_patience_s, 20.0 * answer_s),
            commands=replace(
                self.commands,
                ack_timeout_s=max(self.commands.ack_timeout_s, answer_s),
                progress_timeout_s=max(self.commands.progress_timeout_s, 2.0 * answer_s),
            ),
        )


_LINK_REMEDY = (
    "give tcp:HOST:PORT, udpout:HOST:PORT, udpin:HOST:PORT or serial:DEVICE:BAUD, "
    "such as tcp:127.0.0.1:5760"
)

_FORWARD_REMEDY = "give udp:HOST:PORT, such as udp:192.168.1.5:14550"

_HOST = re.compile(
    r"\[[0-9A-Fa-f:.]+(%[A-Za-z0-9._-]+)?\]|[A-Za-z0-9_-]{1,63}(\.[A-Za-z0-9_-]{1,63})*"
)


@dataclass(frozen=True, slots=True)
class _HostAddress:
    scheme: ClassVar[str]
    host: str
    port: int

    def __str__(self) -> str:
        host = f"[{self.host}]" if ":" in self.host else self.host
        return f"{self.scheme}:{host}:{self.port}"


class TcpAddress(_HostAddress):
    """A TCP server to connect to."""

    scheme = "tcp"


class UdpOutAddress(_HostAddress):
    """A UDP peer to speak to."""

    scheme = "udpout"


class UdpInAddress(_HostAddress):
    """A local UDP address to wait at."""

    scheme = "udpin"


@dataclass(frozen=True, slots=True)
class SerialAddress:
    """A serial device and its speed [baud]."""

    device: str
    baud: int

    def __str__(self) -> str:
        return f"serial:{self.device}:{self.baud}"


LinkAddress = TcpAddress | UdpOutAddress | UdpInAddress | SerialAddress


def parse_link(url: str, source: str = "--mavlink") -> LinkAddress:
    """The address that ``url`` names; see `agent.links.link`.

    Args:
        url: the URL.
        source: where it came from, for the message.

    Raises:
        InputError: the URL is none of the four kinds.
    """
    kinds = {kind.scheme: kind for kind in (TcpAddress, UdpOutAddress, UdpInAddress)}
    scheme, place, value = _parts(url, (*kinds, "serial"), source, _LINK_REMEDY)
    if scheme != "serial":
        return kinds[scheme](_host(url, place, value, source, _LINK_REMEDY), value)
    if value == 0:
        raise _fault(source, url, "0 is no baud rate", _LINK_REMEDY)
    return SerialAddress(place, value)


def parse_forward(url: str, source: str = "--forward") -> UdpOutAddress:
    """Where a ground station listens that ``url``, ``udp:HOST:PORT``, names.

    Args:
        url: the URL.
        source: where it came from, for the message.

    Raises:
        InputError: the URL is no such address.
    """
    _, place, value = _parts(url, ("udp",), source, _FORWARD_REMEDY)
    return UdpOutAddress(_host(url, place, value, source, _FORWARD_REMEDY), value)


def check_station_actions(
    forward: Collection[str], *, signed: bool, source: str = "--station-actions"
) -> None:
    """Refuse to heed ground stations that anybody could pass for.

    Args:
        forward: URLs of ground stations, checked by `parse_forward`.
        signed: whether only what is signed is heeded.
        source: what asks for it, for the message.

    Raises:
        InputError: there is no ground station, or one is on another machine and signs nothing.
    """
    if not forward:
        problem = "there is no ground station whose actions could be taken"
        raise InputError(Fault(source, "", problem, "name one: --forward udp:HOST:PORT"))
    for url in forward:
        address = parse_forward(url)
        if not (signed or is_loopback(f"udp/{address.host}:{address.port}")):
            problem = "anybody on that network could pass for this ground station"
            remedy = "give --signing-key, or a ground station on this machine"
            raise InputError(Fault(source, url, problem, remedy))


def _parts(url: str, schemes: Collection[str], source: str, remedy: str) -> tuple[str, str, int]:
    """Scheme, place and number of ``url``."""
    scheme, _, rest = url.partition(":")
    place, _, number = rest.rpartition(":")
    problem = None
    if scheme not in schemes:
        problem = f"{scheme!r} is no kind of link"
    elif not place:
        problem = "a part is missing"
    elif not (number.isascii() and number.isdigit() and len(number) < 9):
        problem = f"{number!r} is not a whole number"
    if problem is not None:
        raise _fault(source, url, problem, remedy)
    return scheme, place, int(number)


def _host(url: str, place: str, port: int, source: str, remedy: str) -> str:
    """The host of ``place``, with its brackets taken off."""
    if not 1 <= port <= 65_535:
        raise _fault(source, url, f"port {port} is not within 1..65535", remedy)
    if _HOST.fullmatch(place) is None:
        raise _fault(source, url, f"{place!r} is no host", remedy)
    return place.strip("[]")


def _fault(source: str, url: str, problem: str, remedy: str) -> InputError:
    return InputError(Fault(source, url, problem, remedy))
