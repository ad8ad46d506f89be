"""The camera of a vehicle: its trigger on along a line, and kept on what some lines lead round.

Both are told by commands whichever way the vehicle is commanded otherwise, when the line begins and
when it is left, be it on the way. A vehicle that does not take them flies all the same. Who was
never to take pictures, or to look anywhere, is told nothing.

What is looked at (a region of interest to MAVLink) is told once the vehicle flies there, and again
with each target that it takes: ArduCopter forgets it with a new target and when it enters AUTO
(`ModeGuided::set_yaw_state_rad`, `ModeAuto::init`), PX4 with a new mission (`MissionBase`). Leaves
out: what a camera does with it.
"""

from __future__ import annotations

from dataclasses import dataclass

from agent.vehicle.commands import CommandEnded, CommandOutcome
from agent.vehicle.conversation import Conversation
from agent.vehicle.firmware.profile import Firmware
from swarm.model.frames import wgs84_from_enu
from swarm.protocol.fields import Point

CAMERA_TAG = "camera"
LOOK_TAG = "look"
_TRIGGER_COMPLAINTS = {
    CommandOutcome.REFUSED: "it does not take the trigger of its camera",
    CommandOutcome.UNANSWERED: "the trigger of its camera does not answer",
}
_LOOK_COMPLAINTS = {
    CommandOutcome.REFUSED: "it does not take what its camera is to look at",
    CommandOutcome.UNANSWERED: "it does not answer to what its camera is to look at",
}


@dataclass(frozen=True, slots=True)
class Look:
    """What a camera is to look at on a flight."""

    place_enu_m: Point
    """[m; mission origin]."""
    takings: int
    """Another one with each target that the vehicle takes; 0: it has not taken the newest yet."""


class CameraControl:
    """What one vehicle's camera is set to, and what it should be."""

    def __init__(self, conversation: Conversation) -> None:
        self._conversation = conversation
        self._wanted_m: float | None = None
        self._sent_m: float | None = None
        """What it was last told; whether it does so is not known before it has ended."""
        self._ended = False
        self._look: Look | None = None
        self._sent_look: Look | None = None
        """What it was last told to look at; None: ahead."""
        self._look_ended = False
        self._looks = False
        """Whether it may look at anything on our order."""
        self._refused: Point | None = None
        """What it was told in vain, and is not told again."""

    def want(self, distance_m: float | None) -> None:
        """A picture every so many metres from now on, 0: none; None: none, if any were taken."""
        if distance_m is not None or self._wanted_m is not None:
            self._wanted_m = distance_m or 0.0

    def look(self, look: Look | None) -> None:
        """Be kept on that from now on; None: on nothing any more, if it was on anything."""
        self._look = look

    def advance(self, firmware: Firmware) -> None:
        """Tell the vehicle what is wanted, again if that was called off before it answered."""
        conversation, wanted_m = self._conversation, self._wanted_m
        told = self._ended or conversation.commands.pending(CAMERA_TAG)
        if wanted_m is not None and not (told and wanted_m == self._sent_m):
            self._sent_m, self._ended = wanted_m, False
            conversation.send(CAMERA_TAG, firmware.trigger_camera(wanted_m))
        self._advance_look(firmware)

    def _advance_look(self, firmware: Firmware) -> None:
        conversation, look = self._conversation, self._look
        if look is None:
            self._refused = None
            if not self._looks:
                return
        elif not look.takings or look.place_enu_m == self._refused:
            return
        told = self._look_ended or conversation.commands.pending(LOOK_TAG)
        if told and look == self._sent_look:
            return
        conversation.cancel(LOOK_TAG)  # of another number: it would be repeated beside this one
        self._sent_look, self._look_ended = look, False
        if look is None:
            conversation.send(LOOK_TAG, firmware.look_ahead())
        else:
            self._looks = True
            place = wgs84_from_enu(conversation.config.origin, look.place_enu_m)
            conversation.send(LOOK_TAG, firmware.look_at(*place))

    def on_ended(self, ended: CommandEnded) -> None:
        """Take the outcome of a command."""
        if ended.tag == CAMERA_TAG:
            self._ended = True
            self._conversation.tell_caution("camera", _TRIGGER_COMPLAINTS.get(ended.ending))
        elif ended.tag == LOOK_TAG:
            self._look_ended, look = True, self._sent_look
            if look is None:
                self._looks = False
            elif ended.ending is not CommandOutcome.ACCEPTED:
                self._refused = look.place_enu_m
            self._conversation.tell_caution("look", _LOOK_COMPLAINTS.get(ended.ending))
