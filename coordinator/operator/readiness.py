"""A person's word that a UAV on the ground may start again: what is said, and what comes of it."""

from __future__ import annotations

from dataclasses import dataclass

from coordinator.operator.commands import RequestHandler, RequestVerdict
from swarm.protocol.field_messages import UavReady
from swarm.protocol.messages import Message, MissionConfig
from swarm.protocol.uav_messages import BaseStage, Claim

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

    Of a UAV that is lost, it says that nobody stands in its slot any more: all others confirm that.
    """

    _before: Claim | None = None
    """What the UAV claimed when it was said."""

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
            if uav in self.known_to:
                return RequestVerdict.good(f"{uav} may start again from {before.base}")
            waited = f"has not confirmed it within {self._patience_s:g} s"
            return RequestVerdict.bad(f"{uav} {waited}") if late else None
        silent = sorted(self._expected - self.known_to)
        if self.known_to and (late or not silent):
            text = f"{uav} is not there; its slot at {before.base} counts as free"
            unsure = f"; {', '.join(silent)} not confirmed it yet" if silent else ""
            return RequestVerdict.good(f"{text}{unsure}")
        return RequestVerdict.bad(f"nobody confirms it, and {uav} is not there") if late else None

    @property
    def told(self) -> dict[str, object]:
        """Who has confirmed it."""
        return {"known_to": sorted(self.known_to)}

    @property
    def _claim(self) -> Claim | None:
        return self._mission_state.replica.claims.get(self._wish.target)
