"""Options of `swarm run` that it hands on to agents and simulated autopilots.

Each is checked by the rules of the command it is for, before anything is started. Leaves
out: what they do.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path

from agent.mavlink.config import CommandStyle
from agent.mavlink.link_address import parse_forward
from agent.mavlink.signing_key import load_signing_key, signing_key_of
from sim.autopilot.options import faults_by_uav
from sim.launch.autopilots import Autopilots, Simulated
from sim.launch.fence import Fence
from swarm.errors import Fault, InputError
from swarm.suggest import instead

__all__ = ["HandedOn", "check_handed_on", "parse_command_styles"]

_COMMAND = "--command"


@dataclass(frozen=True, slots=True)
class HandedOn:
    """Values as the commands take them; None and empty: not given."""

    command: Mapping[str, CommandStyle] = field(default_factory=dict)
    """By UAV; the others get the default of `swarm agent`."""
    forward: tuple[str, ...] = ()
    signing_key: Path | None = None
    """Of all vehicles, or a folder with each UAV's own."""
    battery_reserve: float | None = None
    keep_jerk: bool = False
    fence: Fence | None = None
    without_bus_s: float | None = None
    accept_no_failsafe: bool = False
    faults: tuple[str, ...] = ()
    """Each ``UAV:KIND@T+DURATION``."""

    def to_agent(self, uav: str) -> list[str]:
        """Arguments of the agent of ``uav``."""
        style, key = self.command.get(uav), self.signing_key
        return [
            *([] if style is None else ["--command", style]),
            *(word for url in self.forward for word in ("--forward", url)),
            *_given("--battery-reserve", self.battery_reserve),
            *(["--keep-jerk"] if self.keep_jerk else []),
            *([] if self.fence is None else self.fence.to_agent()),
            *_given("--without-bus-s", self.without_bus_s),
            *(["--accept-no-failsafe"] if self.accept_no_failsafe else []),
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
            remedy = instead(uav, uavs, "the scenario has")
            raise InputError(Fault(_COMMAND, text, f"no UAV {uav!r}", remedy))
        if uav in found:
            raise InputError(Fault(_COMMAND, text, f"{uav} is named twice", "name each UAV once"))
        found[uav] = _style(style)
    return found


def _style(text: str) -> CommandStyle:
    try:
        return CommandStyle(text)
    except ValueError:
        remedy = instead(text, CommandStyle)
        raise InputError(Fault(_COMMAND, text, "no such way to command", remedy)) from None


def check_handed_on(handed_on: HandedOn, autopilots: Autopilots, uavs: Sequence[str]) -> None:
    """Refuse what a command to be started would refuse, and what would reach nobody.

    Raises:
        InputError: a value is wrong, or does not go with the autopilots.
    """
    for url in handed_on.forward:
        parse_forward(url)
    if handed_on.signing_key is not None:
        for path in dict.fromkeys(signing_key_of(uav, handed_on.signing_key) for uav in uavs):
            load_signing_key(path)
    if handed_on.faults and not isinstance(autopilots, Simulated):
        remedy = "use --autopilot sim or sim-px4"
        problem = "only befalls simulated autopilots"
        raise InputError(Fault("--fault", handed_on.faults[0], problem, remedy))
    faults_by_uav(handed_on.faults, uavs)
