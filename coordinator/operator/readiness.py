"""A person's word that a UAV on the ground may start again: what is said, and what comes of it."""

from __future__ import annotations

from dataclasses import dataclass

from coordinator.operator.commands import RequestHandler, RequestVerdict
from swarm.protocol.bases import wants_slot
from swarm.protocol.field_messages import UavReady
from swarm.protocol.messages import Message, MissionConfig
from swarm.protocol.operator_commands import NOT_READY
from swarm.protocol.uav_messages import BaseStage, Claim, ClaimPhase, Status

_ON_THE_GROUND = (BaseStage.LANDED, BaseStage.PARKED)


@dataclass(frozen=True, slots=True)
class ReadyRequest:
    """Its battery is changed: let one UAV start again."""

    target: str
    reason: str = ""

    def __str__(self) -> str:
        return f"ready {self.target}"


class ReadyHandler(RequestHandler[ReadyRequest, UavReady]):
    """One such word, and what comes of it: the UAV itself confirms it, or has gone on.

    It is refused where the vehicle must not start as it stands there, which its UAV says in its
    note. Of a UAV that is lost, it says that nobody stands in its slot any more: all others confirm
    that.
    """

    _before: Claim | None = None
    """What the UAV claimed when it was said."""
    _confirming: Status | None = None
    """The UAV's last status when it had confirmed it: what it says of its vehicle may be older."""

    def body(self, brief: MissionConfig) -> UavReady | RequestVerdict:
        """What to say; or why it cannot be said."""
        uav = self._wish.target
        if uav not in self._fleet:
            return self._no_such_uav()
        if self._is_over:
            return RequestVerdict.bad("the mission has ended: nobody starts any more")
        claim = self._claim
        if claim is None or claim.stage not in _ON_THE_GROUND:
            doing = "nothing is known of it" if claim is None else "it is in the air, or at home"
            return RequestVerdict.bad(f"{uav} does not stand at a base: {doing}")
        if wants_slot(claim):
            return RequestVerdict.bad(
                f"{uav} waits for a slot of {claim.base}: say so once its battery is changed there"
            )
        if claim.stage is BaseStage.LANDED and claim.sortie_end_s is not None:
            return RequestVerdict.bad(f"{uav} has not touched down at {claim.base} yet")
        self._before = claim
        return UavReady(uav, brief.run, self._wish.reason)

    def judge(self, said: Message, now_s: float, *, late: bool) -> RequestVerdict | None:
        """What has come of it by now; None as long as that is open, and it is not ``late``."""
        del said, now_s  # whoever has said it since means the same
        uav, before, claim = self._wish.target, self._before, self._claim
        if before is None or claim is None:
            return None
        if claim.base != before.base:
            where = f"flies to {claim.task or claim.base}" if claim.is_taken else "is on its way"
            return RequestVerdict.good(f"{uav} {where}")
        if uav in self._mission_state.present:
            return self._judge_present(before, claim, late=late)
        silent = sorted(self._expected - self.known_to)
        if self.known_to and (late or not silent):
            text = f"{uav} is not there; its slot at {before.base} counts as free"
            unsure = f"; {', '.join(silent)} not confirmed it yet" if silent else ""
            return RequestVerdict.good(f"{text}{unsure}")
        return RequestVerdict.bad(f"nobody confirms it, and {uav} is not there") if late else None

    def _judge_present(self, before: Claim, claim: Claim, *, late: bool) -> RequestVerdict | None:
        """What has come of it by the word of the UAV itself."""
        uav, status = self._wish.target, self._mission_state.statuses.get(self._wish.target)
        if uav not in self.known_to:
            waited = f"has not confirmed it within {self._patience_s:g} s"
            return RequestVerdict.bad(f"{uav} {waited}") if late else None
        may = f"{uav} may start again from {before.base}"
        if claim.phase is not ClaimPhase.HELD or claim.task is not None:
            return RequestVerdict.good(may)  # its battery is full
        self._confirming = self._confirming or status
        if status is None or (status is self._confirming and not late):
            return RequestVerdict.good(may) if late else None
        if status.note.startswith(NOT_READY):
            why = status.note.removeprefix(NOT_READY)
            return RequestVerdict.bad(f"{uav} stays on the ground: {why}")
        return RequestVerdict.good(f"{may}, not yet: {status.note}") if late else None

    @property
    def told(self) -> dict[str, object]:
        """Who has confirmed it."""
        return {"known_to": sorted(self.known_to)}

    @property
    def _claim(self) -> Claim | None:
        return self._mission_state.replica.claims.get(self._wish.target)
