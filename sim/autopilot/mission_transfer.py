"""The mission protocol seen from the vehicle: upload, download, clear.

Source: https://mavlink.io/en/services/mission.html. An upload takes the place of
the mission only when its last item has come. Leaves out: fences and rally points
(answered as unsupported), partial writes.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field

from pymavlink.dialects.v20 import ardupilotmega as mavlink

from sim.autopilot.events import Outbox, Sender
from sim.autopilot.flavours.base import MissionHabits
from sim.autopilot.mission_items import (
    MAX_ITEMS,
    MissionItem,
    MissionStore,
    int_frame,
    item_from_message,
)

__all__ = ["MissionTransfer"]

_RESEND_S = 1.0
_TIMEOUT_S = 8.0


@dataclass(slots=True)
class _Upload:
    """An upload under way."""

    sender: Sender
    count: int
    resend_s: float
    expires_s: float
    items: list[MissionItem] = field(default_factory=list)


class MissionTransfer:
    """One upload at a time, and any number of downloads."""

    def __init__(
        self,
        store: MissionStore,
        outbox: Outbox,
        *,
        habits: MissionHabits,
        current: Callable[[], int],
        home_item: Callable[[], MissionItem] | None,
        uploaded: Callable[[tuple[MissionItem, ...], float], None],
        clear: Callable[[], bool],
    ) -> None:
        self._store = store
        self._outbox = outbox
        self._habits = habits
        self._current = current
        """Gives the number of the current item."""
        self._home_item = home_item
        """Gives item 0, where that is home and not the first waypoint."""
        self._uploaded = uploaded
        """Called with the mission that was replaced, after the acknowledgement."""
        self._clear = clear
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
            self._outbox.text(mavlink.MAV_SEVERITY_WARNING, "Mission upload timeout")
            self._acknowledge(upload.sender, mavlink.MAV_MISSION_OPERATION_CANCELLED)
        else:
            self._request_next(upload, at_s)

    def forget(self, channel: int) -> None:
        """Give up an upload whose channel is gone."""
        if self._upload is not None and self._upload.sender.channel == channel:
            self._upload = None

    def handle(self, message: mavlink.MAVLink_message, sender: Sender, now_s: float) -> None:
        """Serve one message of the mission protocol; others are left alone."""
        kind = message.get_msgId()
        mission_type = getattr(message, "mission_type", mavlink.MAV_MISSION_TYPE_MISSION)
        if kind == mavlink.MAVLINK_MSG_ID_MISSION_ACK:
            if self._upload is not None and self._upload.sender == sender:
                self._upload = None  # the ground station gave up
        elif mission_type != mavlink.MAV_MISSION_TYPE_MISSION:
            self._acknowledge(sender, mavlink.MAV_MISSION_UNSUPPORTED, mission_type)
        elif kind == mavlink.MAVLINK_MSG_ID_MISSION_COUNT:
            self._begin_upload(message.count, sender, now_s)
        elif kind in (
            mavlink.MAVLINK_MSG_ID_MISSION_ITEM,
            mavlink.MAVLINK_MSG_ID_MISSION_ITEM_INT,
        ):
            self._take_item(message, sender, now_s)
        elif kind == mavlink.MAVLINK_MSG_ID_MISSION_REQUEST_LIST:
            self._send_count(sender)
        elif kind in (
            mavlink.MAVLINK_MSG_ID_MISSION_REQUEST,
            mavlink.MAVLINK_MSG_ID_MISSION_REQUEST_INT,
        ):
            self._send_item(
                message.seq, sender, as_int=kind == mavlink.MAVLINK_MSG_ID_MISSION_REQUEST_INT
            )
        elif kind == mavlink.MAVLINK_MSG_ID_MISSION_CLEAR_ALL:
            cleared = self._upload is None and self._clear()
            self._acknowledge(
                sender, mavlink.MAV_MISSION_ACCEPTED if cleared else mavlink.MAV_MISSION_ERROR
            )

    def _begin_upload(self, count: int, sender: Sender, now_s: float) -> None:
        running = self._upload
        if running is not None and (running.sender.system, running.sender.component) != (
            sender.system,
            sender.component,
        ):
            self._acknowledge(sender, mavlink.MAV_MISSION_DENIED)
        elif count > MAX_ITEMS:
            self._upload = None
            self._acknowledge(sender, mavlink.MAV_MISSION_NO_SPACE)
        elif count == 0:
            self._commit(_Upload(sender, 0, now_s, now_s), now_s)
        else:
            self._upload = _Upload(sender, count, now_s, now_s + _TIMEOUT_S)
            self._request_next(self._upload, now_s)

    def _take_item(self, message: mavlink.MAVLink_message, sender: Sender, now_s: float) -> None:
        upload = self._upload
        if upload is None:
            self._acknowledge(sender, mavlink.MAV_MISSION_ERROR)
            return
        if (upload.sender.system, upload.sender.component) != (sender.system, sender.component):
            self._acknowledge(sender, mavlink.MAV_MISSION_DENIED)
            return
        if message.seq != len(upload.items):
            self._acknowledge(sender, mavlink.MAV_MISSION_INVALID_SEQUENCE)
            return
        item = item_from_message(message, gives_way=self._habits.gives_way)
        if not isinstance(item, MissionItem):
            self._upload = None
            self._acknowledge(sender, item)
            return
        upload.items.append(item)
        upload.expires_s = now_s + _TIMEOUT_S
        if len(upload.items) < upload.count:
            self._request_next(upload, now_s)
        else:
            self._commit(upload, now_s)

    def _commit(self, upload: _Upload, now_s: float) -> None:
        self._upload = None
        old = self._store.items
        self._store.replace(tuple(upload.items))
        self._acknowledge(upload.sender, mavlink.MAV_MISSION_ACCEPTED)
        self._uploaded(old, now_s)

    def _request_next(self, upload: _Upload, now_s: float) -> None:
        upload.resend_s = now_s + _RESEND_S
        request = (
            mavlink.MAVLink_mission_request_int_message
            if self._habits.asks_for_int
            else mavlink.MAVLink_mission_request_message
        )
        sender = upload.sender
        self._outbox.reply(sender, request(sender.system, sender.component, len(upload.items)))

    def _count(self) -> int:
        # Home is an item of its own, also where no mission stands on the vehicle.
        return max(len(self._store.items), 0 if self._home_item is None else 1)

    def _send_count(self, sender: Sender) -> None:
        self._outbox.reply(
            sender,
            mavlink.MAVLink_mission_count_message(sender.system, sender.component, self._count()),
        )

    def _send_item(self, seq: int, sender: Sender, *, as_int: bool) -> None:
        item = self._store.item(seq)
        if seq == 0 and self._home_item is not None:
            item = self._home_item()
        if item is None:
            # Tell the ground station how many there are, and that it asked for too many.
            self._send_count(sender)
            self._acknowledge(sender, mavlink.MAV_MISSION_ERROR)
            return
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
                int(self._habits.marks_current and seq == self._current()),
                item.autocontinue,
                *item.params,
                item.lat_e7 * scale,
                item.lon_e7 * scale,
                item.height_m,
            ),
        )

    def _frame(self, item: MissionItem, *, as_int: bool) -> int:
        """The one it is given back in: ArduCopter keeps none of an item without a place."""
        if not self._habits.int_frames:
            return item.frame if item.is_place else int(mavlink.MAV_FRAME_GLOBAL)
        return int_frame(item.frame) if as_int else item.frame

    def _acknowledge(self, to: Sender, result: int, mission_type: int = 0) -> None:
        self._outbox.reply(
            to, mavlink.MAVLink_mission_ack_message(to.system, to.component, result, mission_type)
        )
