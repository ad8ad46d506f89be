"""The mission and the fence that stand on a vehicle, and their transfer.

Ground stations upload, download and clear them by the mission protocol, seen here from the vehicle.
Source: https://mavlink.io/en/services/mission.html. An upload takes the place of what there
was only when its last item has come. Rally points are answered as unsupported.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING

from pymavlink.dialects.v20 import ardupilotmega as mavlink

from sim.autopilot.events import FirmwareEvent, Sender
from sim.autopilot.fence import FENCE_COMMANDS, FenceError, has_too_few_corners
from sim.autopilot.mission_item import (
    INT_FRAMES,
    StoredMissionItem,
    fence_item_from_message,
    home_item,
    item_from_message,
)

if TYPE_CHECKING:
    from sim.autopilot.pilot import Pilot

_MAX_ITEMS = 724
"""Room for items, home included."""
_MISSION = int(mavlink.MAV_MISSION_TYPE_MISSION)
_FENCE = int(mavlink.MAV_MISSION_TYPE_FENCE)
_RESEND_S = 1.0
_TIMEOUT_S = 8.0


class MissionStore:
    """The mission as it stands; replaced as a whole, never in part."""

    def __init__(self) -> None:
        self.items: tuple[StoredMissionItem, ...] = ()
        """As uploaded; whether the first is home is the flavour's affair."""

    def item(self, seq: int) -> StoredMissionItem | None:
        """The item of that number, if there is one."""
        return self.items[seq] if 0 <= seq < len(self.items) else None

    def next_navigation(self, seq: int) -> int | None:
        """Number of the first item from ``seq`` on that takes time to fly."""
        for number in range(max(0, seq), len(self.items)):
            if self.items[number].is_navigation:
                return number
        return None


@dataclass(slots=True)
class _Upload:
    """An upload under way."""

    sender: Sender
    count: int
    resend_s: float
    expires_s: float
    kind: int = _MISSION
    """MAV_MISSION_TYPE."""
    items: list[StoredMissionItem] = field(default_factory=list)

    def is_of(self, sender: Sender) -> bool:
        """Whether it is that ground station's, on whatever channel."""
        own = self.sender
        return (own.system, own.component) == (sender.system, sender.component)


class MissionServer:
    """One upload at a time, and any number of downloads."""

    def __init__(self, pilot: Pilot) -> None:
        self._pilot = pilot
        self._store = pilot.store
        self._outbox = pilot.outbox
        self._behaviour = pilot.flavour.missions
        self._upload: _Upload | None = None

    def deadline_s(self) -> float | None:
        """When a request is to be repeated, or the upload given up [s]."""
        if self._upload is None:
            return None
        return min(self._upload.resend_s, self._upload.expires_s)

    def advance(self, at_s: float) -> None:
        """Repeat a request, or give the upload up."""
        upload = self._upload
        if upload is None:
            return
        if at_s >= upload.expires_s:
            self._upload = None
            self._give_up(upload)
        else:
            self._request_next(upload, at_s)

    def _give_up(self, upload: _Upload) -> None:
        cancelled = mavlink.MAV_MISSION_OPERATION_CANCELLED
        if upload.kind == _MISSION:
            self._outbox.text(mavlink.MAV_SEVERITY_WARNING, "Mission upload timeout")
            self._acknowledge(upload.sender, cancelled)
        elif self._behaviour.gives_up_silently:
            self._outbox.text(mavlink.MAV_SEVERITY_CRITICAL, "Operation timeout")
        else:
            self._acknowledge(upload.sender, cancelled, upload.kind)
            self._outbox.text(mavlink.MAV_SEVERITY_WARNING, "Fence upload timeout")

    def forget(self, channel: int) -> None:
        """Give up an upload whose channel is gone."""
        if self._upload is not None and self._upload.sender.channel == channel:
            self._upload = None

    def handle(self, message: mavlink.MAVLink_message, sender: Sender, now_s: float) -> None:
        """Serve one message of the mission protocol; others are left alone."""
        kind = getattr(message, "mission_type", _MISSION)
        known = kind == _MISSION or (kind == _FENCE and self._pilot.config.takes_fences)
        match message.get_msgId():
            case mavlink.MAVLINK_MSG_ID_MISSION_ACK:
                if self._upload is not None and self._upload.sender == sender:
                    self._upload = None  # the ground station gave up
            case _ if not known:
                self._acknowledge(sender, mavlink.MAV_MISSION_UNSUPPORTED, kind)
            case mavlink.MAVLINK_MSG_ID_MISSION_COUNT:
                self._begin_upload(message.count, sender, now_s, kind)
            case mavlink.MAVLINK_MSG_ID_MISSION_ITEM | mavlink.MAVLINK_MSG_ID_MISSION_ITEM_INT:
                self._take_item(message, sender, now_s, kind)
            case mavlink.MAVLINK_MSG_ID_MISSION_REQUEST_LIST:
                self._send_count(sender, kind)
            case mavlink.MAVLINK_MSG_ID_MISSION_REQUEST:
                self._send_item(message.seq, sender, kind, as_int=False)
            case mavlink.MAVLINK_MSG_ID_MISSION_REQUEST_INT:
                self._send_item(message.seq, sender, kind, as_int=True)
            case mavlink.MAVLINK_MSG_ID_MISSION_CLEAR_ALL if kind == _FENCE:
                self._commit(_Upload(sender, 0, now_s, now_s, kind), now_s)
            case mavlink.MAVLINK_MSG_ID_MISSION_CLEAR_ALL:
                cleared = self._upload is None and self._pilot.run.clear()
                result = mavlink.MAV_MISSION_ACCEPTED if cleared else mavlink.MAV_MISSION_ERROR
                self._acknowledge(sender, result)

    def _begin_upload(self, count: int, sender: Sender, now_s: float, kind: int) -> None:
        if self._upload is not None and not self._upload.is_of(sender):
            self._acknowledge(sender, mavlink.MAV_MISSION_DENIED, kind)
        elif count > _MAX_ITEMS:
            self._upload = None
            self._acknowledge(sender, mavlink.MAV_MISSION_NO_SPACE, kind)
        elif count == 0:
            self._commit(_Upload(sender, 0, now_s, now_s, kind), now_s)
        else:
            self._upload = _Upload(sender, count, now_s, now_s + _TIMEOUT_S, kind)
            self._request_next(self._upload, now_s)

    def _take_item(
        self, message: mavlink.MAVLink_message, sender: Sender, now_s: float, kind: int
    ) -> None:
        upload = self._upload
        if upload is None or upload.kind != kind:
            self._acknowledge(sender, mavlink.MAV_MISSION_ERROR, kind)
            return
        if not upload.is_of(sender):
            self._acknowledge(sender, mavlink.MAV_MISSION_DENIED, kind)
            return
        if message.seq != len(upload.items):
            self._acknowledge(sender, mavlink.MAV_MISSION_INVALID_SEQUENCE, kind)
            return
        item = (
            fence_item_from_message(message, FENCE_COMMANDS)
            if kind == _FENCE
            else item_from_message(
                message,
                gives_way=self._behaviour.gives_way,
                lands_on_runways=self._behaviour.lands_on_runways,
            )
        )
        if self._behaviour.gives_up_silently and has_too_few_corners(item):
            item = int(mavlink.MAV_MISSION_ERROR)
        if not isinstance(item, StoredMissionItem):
            self._upload = None
            self._acknowledge(sender, item, kind)
            return
        upload.items.append(item)
        upload.expires_s = now_s + _TIMEOUT_S
        if len(upload.items) < upload.count:
            self._request_next(upload, now_s)
        else:
            self._commit(upload, now_s)

    def _commit(self, upload: _Upload, now_s: float) -> None:
        self._upload = None
        if upload.kind == _FENCE:
            self._commit_fence(upload, now_s)
            return
        old = self._store.items
        self._store.items = tuple(upload.items)
        self._acknowledge(upload.sender, mavlink.MAV_MISSION_ACCEPTED)
        self._pilot.camera.on_mission()
        self._pilot.mission_uploaded(old, now_s)

    def _commit_fence(self, upload: _Upload, now_s: float) -> None:
        try:
            self._pilot.fence_store.replace(tuple(upload.items))
        except FenceError as error:
            self._acknowledge(upload.sender, mavlink.MAV_MISSION_ERROR, _FENCE)
            self._pilot.narrator.tell(FirmwareEvent.FENCE_REFUSED, reason=error)
            self._pilot.narrator.tell(FirmwareEvent.FENCE_KEPT)
            return
        self._acknowledge(upload.sender, mavlink.MAV_MISSION_ACCEPTED, _FENCE)
        self._pilot.fence.uploaded(now_s)

    def _request_next(self, upload: _Upload, now_s: float) -> None:
        upload.resend_s = now_s + _RESEND_S
        request = (
            mavlink.MAVLink_mission_request_int_message
            if self._behaviour.asks_for_int
            else mavlink.MAVLink_mission_request_message
        )
        sender = upload.sender
        seq = len(upload.items)
        self._outbox.reply(sender, request(sender.system, sender.component, seq, upload.kind))

    def _send_count(self, sender: Sender, kind: int) -> None:
        if kind == _FENCE:
            count = len(self._pilot.fence_store.items)
        else:
            # Home is an item of its own, also where no mission stands on the vehicle.
            count = max(len(self._store.items), self._behaviour.first_item)
        to = sender.system, sender.component
        self._outbox.reply(sender, mavlink.MAVLink_mission_count_message(*to, count, kind))

    def _send_item(self, seq: int, sender: Sender, kind: int, *, as_int: bool) -> None:
        if kind == _FENCE:
            fence = self._pilot.fence_store.items
            item = fence[seq] if seq < len(fence) else None
        else:
            item = self._store.item(seq)
        if kind == _MISSION and seq < self._behaviour.first_item:
            item = home_item(self._pilot.config.origin, self._pilot.flight.home_enu_m)
        if item is None:
            # Tell the ground station how many there are, and that it asked for too many.
            self._send_count(sender, kind)
            self._acknowledge(sender, mavlink.MAV_MISSION_ERROR, kind)
            return
        current = self._behaviour.marks_current and seq == self._pilot.run.told
        build = (
            mavlink.MAVLink_mission_item_int_message
            if as_int
            else mavlink.MAVLink_mission_item_message
        )
        scale = 1 if as_int else 1e-7
        self._outbox.reply(
            sender,
            build(
                sender.system,
                sender.component,
                seq,
                self._frame(item, as_int=as_int),
                item.command,
                int(current and kind == _MISSION),
                item.autocontinue,
                *item.params,
                item.lat_e7 * scale,
                item.lon_e7 * scale,
                item.height_m,
                kind,
            ),
        )

    def _frame(self, item: StoredMissionItem, *, as_int: bool) -> int:
        """The one it is given back in: ArduCopter keeps none of an item without a place."""
        if not self._behaviour.int_frames:
            return item.frame if item.is_place else int(mavlink.MAV_FRAME_GLOBAL)
        return INT_FRAMES.get(item.frame, item.frame) if as_int else item.frame

    def _acknowledge(self, to: Sender, result: int, mission_type: int = 0) -> None:
        self._outbox.reply(
            to, mavlink.MAVLink_mission_ack_message(to.system, to.component, result, mission_type)
        )
