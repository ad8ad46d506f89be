"""The trigger of a vehicle's camera: on along a line, off everywhere else.

Told by a command whichever way the vehicle is commanded otherwise, when the line begins and when
it is left, be it on the way. A vehicle that does not take it flies all the same. Who was never to
take pictures is told nothing. Leaves out: what a camera does with it.
"""

from __future__ import annotations

from agent.vehicle.commands import CommandEnded, CommandOutcome
from agent.vehicle.conversation import Conversation
from agent.vehicle.firmware.profile import Firmware

CAMERA_TAG = "camera"
_COMPLAINTS = {
    CommandOutcome.REFUSED: "it does not take the trigger of its camera",
    CommandOutcome.UNANSWERED: "the trigger of its camera does not answer",
}


class CameraControl:
    """What one vehicle's trigger is set to, and what it should be."""

    def __init__(self, conversation: Conversation) -> None:
        self._conversation = conversation
        self._wanted_m: float | None = None
        self._sent_m: float | None = None
        """What it was last told; whether it does so is not known before it has ended."""
        self._ended = False

    def want(self, distance_m: float | None) -> None:
        """A picture every so many metres from now on, 0: none; None: none, if any were taken."""
        if distance_m is not None or self._wanted_m is not None:
            self._wanted_m = distance_m or 0.0

    def advance(self, firmware: Firmware) -> None:
        """Tell the vehicle what is wanted, again if that was called off before it answered."""
        conversation, wanted_m = self._conversation, self._wanted_m
        told = self._ended or conversation.commands.pending(CAMERA_TAG)
        if wanted_m is not None and not (told and wanted_m == self._sent_m):
            self._sent_m, self._ended = wanted_m, False
            conversation.send(CAMERA_TAG, firmware.trigger_camera(wanted_m))

    def on_ended(self, ended: CommandEnded) -> None:
        """Take the outcome of a command."""
        if ended.tag != CAMERA_TAG:
            return
        self._ended = True
        self._conversation.tell_caution("camera", _COMPLAINTS.get(ended.ending))
