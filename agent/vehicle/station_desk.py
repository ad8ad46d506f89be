"""What ground stations beside a fleet are told of one UAV, and what they may ask of it; pure.

Each hears the vehicle's frames as they came. Beside them this desk speaks as the onboard computer
of the same system (component 191): heartbeats, what the UAV does as STATUSTEXT, its numbers as
NAMED_VALUE_INT and NAMED_VALUE_FLOAT. Nothing that a station says reaches the vehicle. Five
commands addressed to that component are wishes (COMMAND_LONG):

    MAV_CMD_USER_1  hold        MAV_CMD_USER_4  ready: the battery has been changed
    MAV_CMD_USER_2  resume      MAV_CMD_USER_5  abort: param1 is 1 to ask for it, 2 to confirm
    MAV_CMD_USER_3  return

The first four concern the system that they are addressed to, or with system 0 everybody who hears
them; an abort always everybody, as every vehicle of a fleet hears what its station says on the
port that they share. Each is answered by a COMMAND_ACK, and in words where there is a reason; one
that is addressed to another system is answered by that one alone. They are heeded only if the
agent was told to, with a signing key only if they are signed by it.

Leaves out: what follows from a wish (agent.core.ground_station); sockets (agent.links); events and
parameters of MAVLink, which need descriptions that stations fetch by file transfer.

Source: https://mavlink.io/en/messages/common.html
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

from pymavlink.dialects.v20 import ardupilotmega as mavlink

from agent.core.station_words import (
    AnswerStation,
    ShowStations,
    StationAction,
    StationAsked,
    StationVerdict,
    StationWish,
)
from agent.vehicle.config import ONBOARD_COMPUTER
from agent.vehicle.framing import Framer
from agent.vehicle.signing import Signing
from swarm.protocol.uav_messages import StatusPhase

WISHES = {
    mavlink.MAV_CMD_USER_1: StationWish.HOLD,
    mavlink.MAV_CMD_USER_2: StationWish.RESUME,
    mavlink.MAV_CMD_USER_3: StationWish.RETURN,
    mavlink.MAV_CMD_USER_4: StationWish.READY,
    mavlink.MAV_CMD_USER_5: StationWish.ABORT,
}
ASK, CONFIRM = 1.0, 2.0
"""First parameter of an abort."""
CONFIRM_INTERVALS = 10.0
"""So many intervals of its heartbeats after an abort was asked for it may be confirmed."""
PHASES = tuple(StatusPhase)
"""The value ``phase`` is a place in it, from 0."""

_RESULTS = {
    StationVerdict.DONE: mavlink.MAV_RESULT_ACCEPTED,
    StationVerdict.NOT_NOW: mavlink.MAV_RESULT_TEMPORARILY_REJECTED,
    StationVerdict.DENIED: mavlink.MAV_RESULT_DENIED,
}
_ALARMING = frozenset({StatusPhase.HOLDING, StatusPhase.RETURNING, StatusPhase.OUT})
_OFF = "nothing is done for ground stations: swarm agent --station-actions"
_EVERYBODY = 0
_MOST_ASKED = 16
"""Wishes that wait for an answer; the core answers each within its step."""
_CHUNK_BYTES = 50
_MOST_CHUNKS = 5


@dataclass(frozen=True, slots=True)
class TellStation:
    """Send these frames to a ground station."""

    data: bytes
    station: int | None = None
    """Which, by its place; None: all of them."""


DeskAction = TellStation | StationAsked


@dataclass(frozen=True, slots=True)
class _OpenWish:
    """A wish that has not been answered yet."""

    station: int
    command: int
    sender: tuple[int, int] | None
    """Its system and component; None if another vehicle answers."""


class StationDesk:
    """The onboard computer of one vehicle, as ground stations see it.

    Args:
        system_id: of the vehicle.
        signings: of each station in order: signs what it is told, and judges what it says if that
            is heeded; None: nothing is signed.
        heeds: whether wishes are heeded.
        heartbeat_interval_s: between two heartbeats.
    """

    def __init__(
        self,
        system_id: int,
        signings: Sequence[Signing | None],
        *,
        heeds: bool,
        heartbeat_interval_s: float = 1.0,
    ) -> None:
        self._system = system_id
        self._signings = signings
        self._heeds = heeds
        self._framers = [Framer(signing if heeds else None) for signing in signings]
        self._interval_s = heartbeat_interval_s
        self._heartbeat_at_s = -math.inf
        self._began_s: float | None = None
        """When it spoke first, from where its messages count their time."""
        self._sender = mavlink.MAVLink(None, srcSystem=system_id, srcComponent=ONBOARD_COMPUTER)
        self._shown: ShowStations | None = None
        self._shown_s = 0.0
        self._asked: dict[int, _OpenWish] = {}
        self._abort_asked_s = [-math.inf for _ in signings]
        """When each station asked for an abort last."""
        self._n_asked = 0
        self._text_id = 0
        self._told = ""

    @property
    def distrusted(self) -> int:
        """Frames of ground stations dropped because of their signature or its absence."""
        return sum(sum(framer.distrusted.values()) for framer in self._framers)

    def next_deadline_s(self) -> float:
        """When to call `advance` at the latest."""
        return self._heartbeat_at_s

    def advance(self, now_s: float) -> list[DeskAction]:
        """What is due by now."""
        if now_s < self._heartbeat_at_s:
            return []
        self._heartbeat_at_s = now_s + self._interval_s
        kind, none = mavlink.MAV_TYPE_ONBOARD_CONTROLLER, mavlink.MAV_AUTOPILOT_INVALID
        state = mavlink.MAV_STATE_ACTIVE
        beat = mavlink.MAVLink_heartbeat_message(kind, none, 0, 0, state, 3)
        return self._tell(beat) + self._values(now_s)

    # -- what is asked for -------------------------------------------------------------------

    def hear(self, station: int, data: bytes, now_s: float) -> list[DeskAction]:
        """What the ground station at that place says; never raises on anything received."""
        actions: list[DeskAction] = []
        for frame in self._framers[station].feed(data):
            raw = frame.message
            if raw is None or raw.get_type() not in ("COMMAND_LONG", "COMMAND_INT"):
                continue
            if raw.target_component == ONBOARD_COMPUTER:
                actions += self._on_command(station, raw, now_s)
        return actions

    def _on_command(self, station: int, raw: Any, now_s: float) -> list[DeskAction]:
        wish = WISHES.get(raw.command)
        ours = raw.target_system in (self._system, _EVERYBODY)
        if not (ours or wish is StationWish.ABORT):
            return []
        sender = (raw.get_srcSystem(), raw.get_srcComponent())
        asked = _OpenWish(station, raw.command, sender if ours else None)
        if wish is None:
            return self._acknowledge(asked, mavlink.MAV_RESULT_UNSUPPORTED)
        if raw.get_type() == "COMMAND_INT":
            return self._acknowledge(asked, mavlink.MAV_RESULT_COMMAND_LONG_ONLY)
        if not self._heeds:
            return self._acknowledge(asked, mavlink.MAV_RESULT_DENIED, _OFF)
        if wish is StationWish.ABORT and raw.param1 != CONFIRM:
            return self._ask_abort(asked, raw.param1, now_s)
        if wish is StationWish.ABORT and now_s > self._may_confirm_until_s(station):
            result, why = mavlink.MAV_RESULT_TEMPORARILY_REJECTED, "abort: ask first, then confirm"
            return self._acknowledge(asked, result, why)
        if len(self._asked) >= _MOST_ASKED:
            return self._acknowledge(asked, mavlink.MAV_RESULT_TEMPORARILY_REJECTED)
        self._n_asked += 1
        self._asked[self._n_asked] = asked
        return [StationAsked(self._n_asked, wish)]

    def _ask_abort(self, asked: _OpenWish, step: float, now_s: float) -> list[DeskAction]:
        if step != ASK:
            why = "abort: param1 is 1 to ask for it and 2 to confirm it"
            return self._acknowledge(asked, mavlink.MAV_RESULT_DENIED, why)
        self._abort_asked_s[asked.station] = now_s
        why = "abort asked for: confirm it, or nothing happens"
        return self._acknowledge(asked, mavlink.MAV_RESULT_ACCEPTED, why)

    def _may_confirm_until_s(self, station: int) -> float:
        return self._abort_asked_s[station] + CONFIRM_INTERVALS * self._interval_s

    def _acknowledge(self, asked: _OpenWish, result: int, reason: str = "") -> list[DeskAction]:
        told: list[DeskAction] = []
        if asked.sender is not None:
            ack = mavlink.MAVLink_command_ack_message(asked.command, result, 0, 0, *asked.sender)
            told += self._tell(ack, asked.station)
        accepted = result == mavlink.MAV_RESULT_ACCEPTED
        severity = mavlink.MAV_SEVERITY_NOTICE if accepted else mavlink.MAV_SEVERITY_WARNING
        return told + self._text(severity, reason, asked.station)

    # -- what is told ------------------------------------------------------------------------

    def tell(self, action: StationAction, now_s: float) -> list[DeskAction]:
        """Pass on what the agent wants ground stations to know."""
        match action:
            case AnswerStation(number, verdict, reason):
                asked = self._asked.pop(number, None)
                return [] if asked is None else self._acknowledge(asked, _RESULTS[verdict], reason)
            case ShowStations():
                return self._show(action, now_s)

    def _show(self, shown: ShowStations, now_s: float) -> list[DeskAction]:
        self._shown, self._shown_s = shown, now_s
        words = f"{shown.uav} {shown.phase.value}"
        words += f" {shown.task}" if shown.task else ""
        words += f": {shown.note}" if shown.note else ""
        told: list[DeskAction] = []
        if words != self._told:
            self._told = words
            alarming = shown.phase in _ALARMING
            severity = mavlink.MAV_SEVERITY_WARNING if alarming else mavlink.MAV_SEVERITY_INFO
            told += self._text(severity, words, None)
        return told

    def _values(self, now_s: float) -> list[DeskAction]:
        """What was shown last, in numbers."""
        shown = self._shown
        if shown is None:
            return []
        told: list[DeskAction] = []
        self._began_s = now_s if self._began_s is None else self._began_s
        since_ms = round(1e3 * (now_s - self._began_s)) % 2**32
        integers = {
            "phase": PHASES.index(shown.phase),
            "task": shown.task_number,
            "tasks_done": shown.n_done,
            "tasks_open": shown.n_open,
        }
        for name, value in integers.items():
            told += self._tell(
                mavlink.MAVLink_named_value_int_message(since_ms, name.encode(), value)
            )
        eta_s = math.nan
        if shown.eta_s is not None:
            eta_s = max(0.0, shown.eta_s - (now_s - self._shown_s))
        return told + self._tell(
            mavlink.MAVLink_named_value_float_message(since_ms, b"eta_s", eta_s)
        )

    def _text(self, severity: int, words: str, station: int | None) -> list[DeskAction]:
        """A text, in as many messages as it takes; none where there is nothing to say."""
        data = words.encode("ascii", "replace")[: _MOST_CHUNKS * _CHUNK_BYTES]
        chunks = [data[at : at + _CHUNK_BYTES] for at in range(0, len(data), _CHUNK_BYTES)]
        text_id = 0
        if len(data) >= _CHUNK_BYTES:  # a full chunk says that more follow, an empty one if need be
            self._text_id = text_id = self._text_id % 65_535 + 1
            chunks += [b""] if len(chunks[-1]) == _CHUNK_BYTES else []
        told: list[DeskAction] = []
        for seq, chunk in enumerate(chunks):
            told += self._tell(
                mavlink.MAVLink_statustext_message(severity, chunk, text_id, seq), station
            )
        return told

    def _tell(self, raw: Any, station: int | None = None) -> list[DeskAction]:
        """One frame, to that station or to each; signed for each by itself."""
        frame = bytes(raw.pack(self._sender))
        self._sender.seq = (self._sender.seq + 1) % 256
        if all(signing is None for signing in self._signings):
            return [TellStation(frame, station)]
        to = range(len(self._signings)) if station is None else [station]
        told: list[DeskAction] = []
        for number in to:
            signing = self._signings[number]
            data = frame if signing is None else signing.sign(frame, raw.crc_extra)
            told.append(TellStation(data, number))
        return told
