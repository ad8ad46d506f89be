"""The mission that stands on a vehicle: items, what is accepted as one, and their transfer.

Ground stations upload, download and clear it by the mission protocol, seen here from the vehicle.
Sources: https://mavlink.io/en/services/mission.html and
https://mavlink.io/en/messages/common.html#MAV_CMD. An upload takes the place of the mission only
when its last item has come. Fences and rally points are answered as unsupported.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

from pymavlink.dialects.v20 import ardupilotmega as mavlink

from sim.autopilot.events import Sender
from sim.autopilot.positions import ABOVE_HOME_FRAMES, ABOVE_SEA_FRAMES, place_enu_m, place_wgs84_e7
from sim.world.motion import Point
from swarm.model.frames import Origin

if TYPE_CHECKING:
    from sim.autopilot.pilot import Pilot

_MAX_ITEMS = 724
"""Room for items, home included."""
_RESEND_S = 1.0
_TIMEOUT_S = 8.0

_PLACES = frozenset(
    {
        mavlink.MAV_CMD_NAV_WAYPOINT,
        mavlink.MAV_CMD_NAV_LOITER_UNLIM,
        mavlink.MAV_CMD_NAV_LOITER_TIME,
        mavlink.MAV_CMD_NAV_LAND,
        mavlink.MAV_CMD_NAV_TAKEOFF,
    }
)

_DONE_AT_ONCE = frozenset({mavlink.MAV_CMD_DO_CHANGE_SPEED, mavlink.MAV_CMD_DO_GUIDED_LIMITS})

_GIVES_WAY = frozenset({mavlink.MAV_CMD_NAV_GUIDED_ENABLE, mavlink.MAV_CMD_DO_GUIDED_LIMITS})

_NAMES = {
    mavlink.MAV_CMD_NAV_WAYPOINT: "WP",
    mavlink.MAV_CMD_NAV_LOITER_UNLIM: "LoitUnlim",
    mavlink.MAV_CMD_NAV_LOITER_TIME: "LoitTime",
    mavlink.MAV_CMD_NAV_RETURN_TO_LAUNCH: "RTL",
    mavlink.MAV_CMD_NAV_LAND: "Land",
    mavlink.MAV_CMD_NAV_TAKEOFF: "Takeoff",
    mavlink.MAV_CMD_NAV_GUIDED_ENABLE: "GuidedEnable",
    mavlink.MAV_CMD_DO_CHANGE_SPEED: "ChangeSpeed",
    mavlink.MAV_CMD_DO_GUIDED_LIMITS: "GuidedLimits",
}


@dataclass(frozen=True, slots=True)
class StoredMissionItem:
    """One step of a mission, in wire units."""

    frame: int
    """MAV_FRAME, the variant without ``_INT``."""
    command: int
    """MAV_CMD."""
    params: tuple[float, float, float, float]
    lat_e7: int
    lon_e7: int
    height_m: float
    autocontinue: int = 1

    @property
    def is_place(self) -> bool:
        """Whether latitude, longitude and height mean something."""
        return self.command in _PLACES

    @property
    def is_navigation(self) -> bool:
        """Whether it takes time to fly, rather than being done at once."""
        return self.command not in _DONE_AT_ONCE

    @property
    def name(self) -> str:
        """What the autopilot calls it when it begins."""
        return _NAMES[self.command]


_FRAMES_KEPT = {
    mavlink.MAV_FRAME_GLOBAL_INT: mavlink.MAV_FRAME_GLOBAL,
    mavlink.MAV_FRAME_GLOBAL_RELATIVE_ALT_INT: mavlink.MAV_FRAME_GLOBAL_RELATIVE_ALT,
}


_INT_FRAMES: dict[int, int] = {kept: sent for sent, kept in _FRAMES_KEPT.items()}


def _item_from_message(
    message: mavlink.MAVLink_message, *, gives_way: bool
) -> StoredMissionItem | int:
    """The item in a MISSION_ITEM or MISSION_ITEM_INT, or the MAV_MISSION_RESULT of refusing it."""
    if message.command not in _NAMES or (message.command in _GIVES_WAY and not gives_way):
        return int(mavlink.MAV_MISSION_UNSUPPORTED)
    # Yaw is given as NaN where it doesn't matter; one NaN, so that equal items are equal.
    yaw_deg = math.nan if math.isnan(message.param4) else message.param4
    params = (message.param1, message.param2, message.param3, yaw_deg)
    if not all(math.isfinite(value) for value in params[:3]) or not math.isfinite(message.z):
        return int(mavlink.MAV_MISSION_INVALID)
    scale = 1e7 if message.get_msgId() == mavlink.MAVLINK_MSG_ID_MISSION_ITEM else 1
    if not (math.isfinite(message.x) and math.isfinite(message.y)):
        return int(mavlink.MAV_MISSION_INVALID)
    item = StoredMissionItem(
        frame=_FRAMES_KEPT.get(message.frame, message.frame),
        command=message.command,
        params=params,
        lat_e7=round(message.x * scale),
        lon_e7=round(message.y * scale),
        height_m=message.z,
        autocontinue=message.autocontinue,
    )
    if item.is_place:
        if item.frame not in ABOVE_HOME_FRAMES | ABOVE_SEA_FRAMES:
            return int(mavlink.MAV_MISSION_UNSUPPORTED_FRAME)
        if abs(item.lat_e7) > 890_000_000:
            return int(mavlink.MAV_MISSION_INVALID_PARAM5_X)
        if abs(item.lon_e7) > 1_800_000_000:
            return int(mavlink.MAV_MISSION_INVALID_PARAM6_Y)
    return item


def item_place_enu_m(
    item: StoredMissionItem, origin: Origin, here_enu_m: Point, home_up_m: float
) -> Point:
    """Place of an item [m]; zeros mean where the vehicle is."""
    place = place_enu_m(origin, item.frame, item.lat_e7, item.lon_e7, item.height_m, home_up_m)
    if place is None:
        return here_enu_m
    east_m, north_m, up_m = place
    if item.lat_e7 == 0 and item.lon_e7 == 0:
        east_m, north_m, _ = here_enu_m
    if item.height_m == 0.0:
        up_m = here_enu_m[2]
    return east_m, north_m, up_m


def home_item(origin: Origin, home_enu_m: Point) -> StoredMissionItem:
    """Home as an item of a mission."""
    lat_e7, lon_e7, alt_mm = place_wgs84_e7(origin, home_enu_m)
    return StoredMissionItem(
        frame=mavlink.MAV_FRAME_GLOBAL,
        command=mavlink.MAV_CMD_NAV_WAYPOINT,
        params=(0.0, 0.0, 0.0, 0.0),
        lat_e7=lat_e7,
        lon_e7=lon_e7,
        height_m=alt_mm / 1e3,
    )


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
        mission_type = getattr(message, "mission_type", mavlink.MAV_MISSION_TYPE_MISSION)
        match message.get_msgId():
            case mavlink.MAVLINK_MSG_ID_MISSION_ACK:
                if self._upload is not None and self._upload.sender == sender:
                    self._upload = None  # the ground station gave up
            case _ if mission_type != mavlink.MAV_MISSION_TYPE_MISSION:
                self._acknowledge(sender, mavlink.MAV_MISSION_UNSUPPORTED, mission_type)
            case mavlink.MAVLINK_MSG_ID_MISSION_COUNT:
                self._begin_upload(message.count, sender, now_s)
            case mavlink.MAVLINK_MSG_ID_MISSION_ITEM | mavlink.MAVLINK_MSG_ID_MISSION_ITEM_INT:
                self._take_item(message, sender, now_s)
            case mavlink.MAVLINK_MSG_ID_MISSION_REQUEST_LIST:
                self._send_count(sender)
            case mavlink.MAVLINK_MSG_ID_MISSION_REQUEST:
                self._send_item(message.seq, sender, as_int=False)
            case mavlink.MAVLINK_MSG_ID_MISSION_REQUEST_INT:
                self._send_item(message.seq, sender, as_int=True)
            case mavlink.MAVLINK_MSG_ID_MISSION_CLEAR_ALL:
                cleared = self._upload is None and self._pilot.run.clear()
                result = mavlink.MAV_MISSION_ACCEPTED if cleared else mavlink.MAV_MISSION_ERROR
                self._acknowledge(sender, result)

    def _begin_upload(self, count: int, sender: Sender, now_s: float) -> None:
        if self._upload is not None and not self._upload.is_of(sender):
            self._acknowledge(sender, mavlink.MAV_MISSION_DENIED)
        elif count > _MAX_ITEMS:
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
        if not upload.is_of(sender):
            self._acknowledge(sender, mavlink.MAV_MISSION_DENIED)
            return
        if message.seq != len(upload.items):
            self._acknowledge(sender, mavlink.MAV_MISSION_INVALID_SEQUENCE)
            return
        item = _item_from_message(message, gives_way=self._behaviour.gives_way)
        if not isinstance(item, StoredMissionItem):
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
        self._store.items = tuple(upload.items)
        self._acknowledge(upload.sender, mavlink.MAV_MISSION_ACCEPTED)
        self._pilot.mission_uploaded(old, now_s)

    def _request_next(self, upload: _Upload, now_s: float) -> None:
        upload.resend_s = now_s + _RESEND_S
        request = (
            mavlink.MAVLink_mission_request_int_message
            if self._behaviour.asks_for_int
            else mavlink.MAVLink_mission_request_message
        )
        sender = upload.sender
        self._outbox.reply(sender, request(sender.system, sender.component, len(upload.items)))

    def _send_count(self, sender: Sender) -> None:
        # Home is an item of its own, also where no mission stands on the vehicle.
        count = max(len(self._store.items), self._behaviour.first_item)
        self._outbox.reply(
            sender, mavlink.MAVLink_mission_count_message(sender.system, sender.component, count)
        )

    def _send_item(self, seq: int, sender: Sender, *, as_int: bool) -> None:
        item = self._store.item(seq)
        if seq < self._behaviour.first_item:
            item = home_item(self._pilot.config.origin, self._pilot.flight.home_enu_m)
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
                int(self._behaviour.marks_current and seq == self._pilot.run.told),
                item.autocontinue,
                *item.params,
                item.lat_e7 * scale,
                item.lon_e7 * scale,
                item.height_m,
            ),
        )

    def _frame(self, item: StoredMissionItem, *, as_int: bool) -> int:
        """The one it is given back in: ArduCopter keeps none of an item without a place."""
        if not self._behaviour.int_frames:
            return item.frame if item.is_place else int(mavlink.MAV_FRAME_GLOBAL)
        return _INT_FRAMES.get(item.frame, item.frame) if as_int else item.frame

    def _acknowledge(self, to: Sender, result: int, mission_type: int = 0) -> None:
        self._outbox.reply(
            to, mavlink.MAVLink_mission_ack_message(to.system, to.component, result, mission_type)
        )
