"""Options of `swarm run` that it passes on to agents and autopilots, and the fence it draws."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path

from agent.vehicle.config import CommandStyle, check_station_actions, parse_forward
from agent.vehicle.signing import load_signing_key, signing_key_of
from sim.autopilot.options import faults_by_uav
from sim.fleet.autopilots import Autopilots, SimulatedAutopilots
from swarm.model import Mission
from swarm.model.layers import layers_over
from swarm.runtime.errors import Fault, InputError, remedy_for_name

_RADIUS_FACTOR = 1.2

_RADIUS_MARGIN_M = 200.0

_HEIGHT_MARGIN_M = 50.0

_MOST_RADIUS_M = 1e6

_MOST_HEIGHT_M = 1e5
"""What `swarm agent` takes."""


@dataclass(frozen=True, slots=True)
class Fence:
    """Of the UAVs of a run, around the mission's origin."""

    radius_m: float
    height_m: float
    """Above the origin, and below it."""

    def to_agent(self) -> list[str]:
        """Arguments of an agent."""
        return ["--fence-radius-m", repr(self.radius_m), "--fence-height-m", repr(self.height_m)]


def fence_around(
    mission: Mission, radius_m: float | None = None, height_m: float | None = None
) -> Fence:
    """A fence with room for every start and every task, pop-ups included.

    Unless given, its radius is a fifth and 200 m beyond the farthest place; its height is 50 m
    beyond the highest layer above the highest place, or beyond the lowest place.
    """
    places = [uav.position_enu_m for uav in mission.uavs]
    places += [task.position_enu_m for task in mission.tasks]
    farthest_m = max((math.hypot(east_m, north_m) for east_m, north_m, _ in places), default=0.0)
    heights_m = [up_m for _, _, up_m in places] or [0.0]
    layer_m = layers_over(mission.terrain).layer_m(max(0, len(mission.uavs) - 1))
    extent_m = max(max(heights_m) + layer_m, -min(heights_m))
    return Fence(
        radius_m or min(_RADIUS_FACTOR * farthest_m + _RADIUS_MARGIN_M, _MOST_RADIUS_M),
        height_m or min(extent_m + _HEIGHT_MARGIN_M, _MOST_HEIGHT_M),
    )


_COMMAND = "--command"


@dataclass(frozen=True, slots=True)
class PassthroughOptions:
    """Values as the commands take them; None and empty: not given."""

    command: Mapping[str, CommandStyle] = field(default_factory=dict)
    """By UAV; the others get the default of `swarm agent`."""
    forward: tuple[str, ...] = ()
    station_actions: bool = False
    """Whether ground stations that are shown the vehicles may ask anything of the UAVs."""
    signing_key: Path | None = None
    """Of all vehicles, or a folder with each UAV's own."""
    battery_reserve: float | None = None
    keep_jerk: bool = False
    fence: Fence | None = None
    without_bus_s: float | None = None
    accept_no_failsafe: bool = False
    ready_by_itself: bool = False
    """Nobody stands beside the vehicles who could let them start again after a swap."""
    faults: tuple[str, ...] = ()
    """Each ``UAV:KIND@T+DURATION``."""

    def to_agent(self, uav: str) -> list[str]:
        """Arguments of the agent of ``uav``."""
        style, key = self.command.get(uav), self.signing_key
        return [
            *([] if style is None else ["--command", style]),
            *(word for url in self.forward for word in ("--forward", url)),
            *(["--station-actions"] if self.station_actions else []),
            *_given("--battery-reserve", self.battery_reserve),
            *(["--keep-jerk"] if self.keep_jerk else []),
            *([] if self.fence is None else self.fence.to_agent()),
            *_given("--without-bus-s", self.without_bus_s),
            *(["--accept-no-failsafe"] if self.accept_no_failsafe else []),
            *(["--ready-by-itself"] if self.ready_by_itself else []),
            *([] if key is None else ["--signing-key", str(signing_key_of(uav, key))]),
        ]

    def to_autopilot(self, uavs: Sequence[str]) -> list[str]:
        """Arguments of the process that simulates the autopilots of ``uavs``."""
        faults = [fault for fault in self.faults if fault.partition(":")[0] in uavs]
        key = [] if self.signing_key is None else ["--signing-key", str(self.signing_key)]
        return [*(word for fault in faults for word in ("--fault", fault)), *key]


def _given(option: str, value: float | None) -> list[str]:
    return [] if value is None else [option, repr(value)]


def parse_command_styles(text: str | None, uavs: Sequence[str]) -> dict[str, CommandStyle]:
    """How each UAV is commanded, by UAV: one word for all, or ``UAV=STYLE`` with commas between.

    Raises:
        InputError: no such style, no such UAV, or one named twice.
    """
    if text is None:
        return {}
    if "=" not in text:
        return dict.fromkeys(uavs, _style(text))
    found: dict[str, CommandStyle] = {}
    for part in text.split(","):
        uav, marked, style = part.strip().partition("=")
        if not marked:
            remedy = "give one style for all UAVs, or UAV=STYLE with commas between"
            raise InputError(Fault(_COMMAND, text, f"{part.strip()!r} names no UAV", remedy))
        if uav not in uavs:
            remedy = remedy_for_name(uav, uavs, "the scenario has")
            raise InputError(Fault(_COMMAND, text, f"no UAV {uav!r}", remedy))
        if uav in found:
            raise InputError(Fault(_COMMAND, text, f"{uav} is named twice", "name each UAV once"))
        found[uav] = _style(style)
    return found


def _style(text: str) -> CommandStyle:
    try:
        return CommandStyle(text)
    except ValueError:
        remedy = remedy_for_name(text, CommandStyle)
        raise InputError(Fault(_COMMAND, text, "no such way to command", remedy)) from None


def check_passthrough(
    passthrough: PassthroughOptions, autopilots: Autopilots, uavs: Sequence[str]
) -> None:
    """Refuse what a command to be started would refuse, and what would reach nobody.

    Raises:
        InputError: a value is wrong, or does not go with the autopilots.
    """
    for url in passthrough.forward:
        parse_forward(url)
    if passthrough.station_actions:
        check_station_actions(passthrough.forward, signed=passthrough.signing_key is not None)
    if passthrough.signing_key is not None:
        for path in dict.fromkeys(signing_key_of(uav, passthrough.signing_key) for uav in uavs):
            load_signing_key(path)
    if passthrough.faults and not isinstance(autopilots, SimulatedAutopilots):
        remedy = "use --autopilot sim or sim-px4"
        problem = "only befalls simulated autopilots"
        raise InputError(Fault("--fault", passthrough.faults[0], problem, remedy))
    faults_by_uav(passthrough.faults, uavs)
