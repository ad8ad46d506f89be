"""Bytes <-> messages; the one place where MAVLink's wire units change into SI.

Of pymavlink only the generated dialect is used, which does no I/O and keeps no globals.

Wire units: https://mavlink.io/en/messages/common.html
"""

from __future__ import annotations

import math
import struct
from collections.abc import Callable, Hashable, Mapping
from typing import Any

from pymavlink.dialects.v20 import ardupilotmega as mavlink

from agent.vehicle.contact import PeerLatch
from agent.vehicle.framing import Framer, MavlinkFrame, TextJoiner
from agent.vehicle.messages import (
    AltitudeFrame,
    BatteryStatus,
    CommandAck,
    CommandInt,
    CommandLong,
    DecodedMessage,
    EkfStatus,
    ExtendedState,
    GroundHeartbeat,
    Heartbeat,
    Inbound,
    LandedState,
    MissionAck,
    MissionClearAll,
    MissionCount,
    MissionCurrent,
    MissionItem,
    MissionKind,
    MissionReached,
    MissionRequest,
    MissionRequestList,
    MissionSetCurrent,
    Outbound,
    ParameterMissing,
    ParameterRead,
    ParameterSet,
    ParameterValue,
    Position,
    SystemStatus,
)
from agent.vehicle.signing import Signing

_AUTOPILOT_COMPONENT = 1
_PEER_SILENCE_S = 3.0
_INT_FRAME = {AltitudeFrame.MEAN_SEA_LEVEL: 5, AltitudeFrame.HOME: 6, AltitudeFrame.NONE: 2}
_FRAME_BY_WIRE = {
    0: AltitudeFrame.MEAN_SEA_LEVEL,
    2: AltitudeFrame.NONE,
    5: AltitudeFrame.MEAN_SEA_LEVEL,
    3: AltitudeFrame.HOME,
    6: AltitudeFrame.HOME,
}
_LIFTS_NOTHING = (mavlink.MAV_BATTERY_FUNCTION_AVIONICS, mavlink.MAV_BATTERY_FUNCTION_PAYLOAD)
_TOTAL_UNKNOWN = 0xFFFF
_LANDED_BY_WIRE = {int(state): state for state in LandedState}
_KIND_BY_WIRE = {int(kind): kind for kind in MissionKind}


class MavlinkCodec:
    """One side of a MAVLink 2 conversation with one autopilot.

    Args:
        target_system_id: system id of the autopilot that is spoken to; 1..255.
        source_system_id: our own system id; 1..255.
        source_component_id: our own component id; 1..255.
        signing: signs what is sent, and lets nothing be heard that is not signed. Without
            it signatures are not looked at: signed frames are heard like others.
        peer_silence_s: see `agent.vehicle.contact`.
    """

    def __init__(
        self,
        target_system_id: int,
        *,
        source_system_id: int = 255,
        source_component_id: int = 191,
        signing: Signing | None = None,
        peer_silence_s: float = _PEER_SILENCE_S,
    ) -> None:
        self._target = target_system_id
        self._own_system = source_system_id
        self._own_component = source_component_id
        self._signing = signing
        self._framer = Framer(signing)
        self._latch = PeerLatch(peer_silence_s, signed=signing is not None)
        self._texts = TextJoiner()
        self._sender = mavlink.MAVLink(
            None, srcSystem=source_system_id, srcComponent=source_component_id
        )
        self.not_for_us = 0
        """Messages addressed to another ground station."""
        self.implausible = 0
        """Messages with a valid checksum and contents that cannot be."""
        self.keep_frames = False
        """Whether to keep the vehicle's frames for `take_frames`."""
        self._kept_frames: list[bytes] = []

    @property
    def peer(self) -> Hashable | None:
        """Whom to answer on a link to which anybody can send; None while that is not known."""
        return self._latch.peer

    @property
    def strangers(self) -> int:
        """Pieces dropped because somebody else than the vehicle's peer sent them."""
        return self._latch.strangers

    @property
    def distrusted(self) -> Mapping[str, int]:
        """Frames dropped because of their signature or its absence, by reason."""
        return self._framer.distrusted

    @property
    def unchecked_frames(self) -> int:
        """Signed frames taken without a key to check them with."""
        return self._framer.unchecked_frames

    @property
    def bad_bytes(self) -> int:
        """Bytes received that belonged to no valid frame."""
        return self._framer.bad_bytes

    @property
    def unknown_frames(self) -> int:
        """Frames received whose message is not known."""
        return self._framer.unknown_frames

    def decode(
        self, data: bytes, source: Hashable | None = None, now_s: float = 0.0
    ) -> list[DecodedMessage]:
        """Messages completed by ``data`` that the bridge knows; anything else is counted.

        Args:
            data: what came.
            source: from whom, on a link to which anybody can send; only its peer is listened to.
            now_s: when [s].
        """
        heard: list[DecodedMessage] = []
        frames = list(self._framer.feed(data, source))
        if source is not None:
            proof = any(map(self._proves, frames))
            if not self._latch.admits(source, now_s, proof=proof):
                return []
            self._framer.kept = self._latch.peer
        for frame in frames:
            if self.keep_frames and frame.system_id == self._target:
                self._kept_frames.append(frame.data)
            raw = frame.message
            if raw is None:
                if frame.later is not None:
                    heard.append(DecodedMessage(frame.system_id, frame.data[6], frame.later))
                continue
            if raw.get_msgId() == mavlink.MAVLINK_MSG_ID_STATUSTEXT:
                heard += self._texts_of(raw)
                continue
            convert = _CONVERTERS.get(raw.get_msgId())
            if convert is None:
                continue
            if not self._addressed_to_us(raw):
                self.not_for_us += 1
                continue
            message = convert(raw)
            if message is None:
                self.implausible += 1
                continue
            heard.append(DecodedMessage(raw.get_srcSystem(), raw.get_srcComponent(), message))
        return heard

    def encode(self, message: Outbound) -> bytes:
        """One MAVLink 2 frame; sequence numbers count up with every call."""
        raw = self._raw(message)
        frame = bytes(raw.pack(self._sender))
        self._sender.seq = (self._sender.seq + 1) % 256
        return frame if self._signing is None else self._signing.sign(frame, raw.crc_extra)

    def take_frames(self) -> list[bytes]:
        """The vehicle's frames as they came, unknown ones too, since the last call."""
        frames, self._kept_frames = self._kept_frames, []
        return frames

    def reset_link(self) -> None:
        """Forget the peer, and half-received frames and texts, because the link is a new one."""
        self._framer.reset()
        self._latch.forget()
        self._texts.forget()

    def excuse_silence(self, now_s: float) -> None:
        """Nobody was listened to for a while, so nobody was silent."""
        self._latch.excuse_silence(now_s)

    def _proves(self, frame: MavlinkFrame) -> bool:
        """Whether only the autopilot that is spoken to can have said it, as far as can be told."""
        raw = frame.message
        return (
            raw is not None
            and frame.system_id == self._target
            and raw.get_srcComponent() == _AUTOPILOT_COMPONENT
            and (self._signing is None or frame.signed)
        )

    def _texts_of(self, raw: Any) -> list[DecodedMessage]:
        """Texts of the autopilot that are complete by this chunk; nobody else's are joined."""
        sender = (raw.get_srcSystem(), raw.get_srcComponent())
        ours = sender == (self._target, _AUTOPILOT_COMPONENT)
        joiner = self._texts if ours else TextJoiner()
        texts = joiner.add(raw.severity, str(raw.text), raw.id, raw.chunk_seq)
        return [DecodedMessage(*sender, text) for text in texts]

    def _addressed_to_us(self, raw: Any) -> bool:
        """Whether ``raw`` is for us or for everybody (MAVLink 1 acknowledgements say 0)."""
        system = getattr(raw, "target_system", 0)
        component = getattr(raw, "target_component", 0)
        return system in (0, self._own_system) and component in (0, self._own_component)

    def _raw(self, message: Outbound) -> Any:
        to = (self._target, _AUTOPILOT_COMPONENT)
        match message:
            case GroundHeartbeat():
                return mavlink.MAVLink_heartbeat_message(
                    mavlink.MAV_TYPE_GCS, mavlink.MAV_AUTOPILOT_INVALID, 0, 0, 0, 3
                )
            case CommandLong(command, params, confirmation):
                return mavlink.MAVLink_command_long_message(*to, command, confirmation, *params)
            case CommandInt(command, frame, params, lat_deg, lon_deg, alt_m):
                place = (*_wire_place(lat_deg, lon_deg), alt_m)
                return mavlink.MAVLink_command_int_message(
                    *to, _INT_FRAME[frame], command, 0, 0, *params, *place
                )
            case ParameterRead(name):
                return mavlink.MAVLink_param_request_read_message(*to, name.encode(), -1)
            case ParameterSet(name, value):
                return mavlink.MAVLink_param_set_message(
                    *to, name.encode(), value, mavlink.MAV_PARAM_TYPE_REAL32
                )
            case MissionCount(count, kind):
                return mavlink.MAVLink_mission_count_message(*to, count, kind)
            case MissionItem():
                head = (message.seq, _INT_FRAME[message.frame], message.command)
                flags = (int(message.current), int(message.autocontinue))
                place = (*_wire_place(message.lat_deg, message.lon_deg), message.alt_m)
                return mavlink.MAVLink_mission_item_int_message(
                    *to, *head, *flags, *message.params, *place, message.kind
                )
            case MissionRequest(seq, kind):
                return mavlink.MAVLink_mission_request_int_message(*to, seq, kind)
            case MissionRequestList(kind):
                return mavlink.MAVLink_mission_request_list_message(*to, kind)
            case MissionAck(result, kind):
                return mavlink.MAVLink_mission_ack_message(*to, result, kind)
            case MissionClearAll(kind):
                return mavlink.MAVLink_mission_clear_all_message(*to, kind)
            case MissionSetCurrent(seq):
                return mavlink.MAVLink_mission_set_current_message(*to, seq)


def _wire_place(lat_deg: float, lon_deg: float) -> tuple[int, int]:
    """[1e-7 deg]; the longitude within -180..180, for missions across the antimeridian."""
    return round(lat_deg * 1e7), round(((lon_deg + 180.0) % 360.0 - 180.0) * 1e7)


def _heartbeat(raw: Any) -> Inbound | None:
    if raw.autopilot == mavlink.MAV_AUTOPILOT_INVALID or raw.type == mavlink.MAV_TYPE_GCS:
        return None
    return Heartbeat(
        vehicle_type=raw.type,
        autopilot=raw.autopilot,
        armed=bool(raw.base_mode & mavlink.MAV_MODE_FLAG_SAFETY_ARMED),
        custom_mode=raw.custom_mode,
        system_status=raw.system_status,
    )


def _position(raw: Any) -> Inbound | None:
    lat_deg, lon_deg = raw.lat / 1e7, raw.lon / 1e7
    if not (abs(lat_deg) <= 90.0 and abs(lon_deg) <= 180.0):
        return None
    return Position(
        boot_s=raw.time_boot_ms / 1e3,
        lat_deg=lat_deg,
        lon_deg=lon_deg,
        alt_m=raw.alt / 1e3,
        relative_alt_m=raw.relative_alt / 1e3,
        velocity_enu_m_s=(raw.vy / 1e2, raw.vx / 1e2, -raw.vz / 1e2),
        known=not (raw.lat == 0 and raw.lon == 0),
    )


def _battery_frac(remaining_percent: int) -> float | None:
    return min(remaining_percent, 100) / 100.0 if remaining_percent >= 0 else None


def _system_status(raw: Any) -> Inbound | None:
    bit = mavlink.MAV_SYS_STATUS_PREARM_CHECK
    reported = raw.onboard_control_sensors_present & raw.onboard_control_sensors_enabled & bit
    healthy = bool(raw.onboard_control_sensors_health & bit)
    return SystemStatus(
        prearm_ok=healthy if reported else None,
        prearm_healthy=healthy,
        battery_frac=_battery_frac(raw.battery_remaining),
        fence_enabled=bool(raw.onboard_control_sensors_enabled & mavlink.MAV_SYS_STATUS_GEOFENCE),
    )


def _battery(raw: Any) -> Inbound | None:
    lifts = raw.battery_function not in _LIFTS_NOTHING
    return BatteryStatus(_battery_frac(raw.battery_remaining), raw.id, lifts)


def _extended_state(raw: Any) -> Inbound | None:
    landed = _LANDED_BY_WIRE.get(raw.landed_state)
    return None if landed is None else ExtendedState(landed)


def _parameter(raw: Any) -> Inbound | None:
    if not math.isfinite(raw.param_value):
        return None
    integer = None
    if raw.param_type == mavlink.MAV_PARAM_TYPE_INT32:
        (integer,) = struct.unpack("<i", struct.pack("<f", raw.param_value))
    return ParameterValue(raw.param_id, raw.param_value, integer)


def _mission_item(raw: Any, kind: MissionKind) -> Inbound | None:
    frame = _FRAME_BY_WIRE.get(raw.frame)
    numbers = (raw.param1, raw.param2, raw.param3, raw.param4)
    if frame is None or not math.isfinite(raw.z):
        return None
    return MissionItem(
        seq=raw.seq,
        command=raw.command,
        frame=frame,
        lat_deg=raw.x / 1e7,
        lon_deg=raw.y / 1e7,
        alt_m=raw.z,
        params=numbers,
        current=raw.current == 1,
        autocontinue=raw.autocontinue == 1,
        kind=kind,
    )


def _mission(
    convert: Callable[[Any, MissionKind], Inbound | None],
) -> Callable[[Any], Inbound | None]:
    """Of missions proper and of fences, not of rally points."""

    def convert_known(raw: Any) -> Inbound | None:
        kind = _KIND_BY_WIRE.get(raw.mission_type)
        return None if kind is None else convert(raw, kind)

    return convert_known


_CONVERTERS: dict[int, Callable[[Any], Inbound | None]] = {
    mavlink.MAVLINK_MSG_ID_HEARTBEAT: _heartbeat,
    mavlink.MAVLINK_MSG_ID_GLOBAL_POSITION_INT: _position,
    mavlink.MAVLINK_MSG_ID_SYS_STATUS: _system_status,
    mavlink.MAVLINK_MSG_ID_BATTERY_STATUS: _battery,
    mavlink.MAVLINK_MSG_ID_EKF_STATUS_REPORT: lambda raw: EkfStatus(raw.flags),
    mavlink.MAVLINK_MSG_ID_ESTIMATOR_STATUS: lambda raw: EkfStatus(raw.flags),
    mavlink.MAVLINK_MSG_ID_EXTENDED_SYS_STATE: _extended_state,
    mavlink.MAVLINK_MSG_ID_COMMAND_ACK: lambda raw: CommandAck(raw.command, raw.result),
    mavlink.MAVLINK_MSG_ID_PARAM_VALUE: _parameter,
    mavlink.MAVLINK_MSG_ID_PARAM_ERROR: lambda raw: ParameterMissing(raw.param_id),
    mavlink.MAVLINK_MSG_ID_MISSION_REQUEST: _mission(
        lambda raw, kind: MissionRequest(raw.seq, kind)
    ),
    mavlink.MAVLINK_MSG_ID_MISSION_REQUEST_INT: _mission(
        lambda raw, kind: MissionRequest(raw.seq, kind)
    ),
    mavlink.MAVLINK_MSG_ID_MISSION_COUNT: _mission(lambda raw, kind: MissionCount(raw.count, kind)),
    mavlink.MAVLINK_MSG_ID_MISSION_ITEM_INT: _mission(_mission_item),
    mavlink.MAVLINK_MSG_ID_MISSION_ACK: _mission(lambda raw, kind: MissionAck(raw.type, kind)),
    mavlink.MAVLINK_MSG_ID_MISSION_CURRENT: lambda raw: MissionCurrent(
        raw.seq, raw.total if 0 < raw.total < _TOTAL_UNKNOWN else None
    ),
    mavlink.MAVLINK_MSG_ID_MISSION_ITEM_REACHED: lambda raw: MissionReached(raw.seq),
}
"""Converters by message id; one returns None for contents that cannot be."""
