"""The operator's word that a mission starts without a UAV: what is said, and what comes of it.

Leaves out: saying it (coordinator.operator.errands), and starting (coordinator.beginning).
"""

from __future__ import annotations

from dataclasses import dataclass

from coordinator.observer import Observer
from coordinator.operator.verdict import Result, Verdict
from swarm.events import BusFact, Learned
from swarm.model.ids import COORDINATOR
from swarm.state.commands import dispensable
from swarm.wire.messages import Brief, ClaimPhase, EpochPhase, Message, StartWithout

__all__ = ["StartWish", "Starting"]


@dataclass(frozen=True, slots=True)
class StartWish:
    """Start the mission without one UAV."""

    target: str
    """Its id."""
    reason: str = ""
    """Why, in the operator's words."""

    def __str__(self) -> str:
        return f"start without {self.target}"


class Starting:
    """One such word, and what comes of it.

    Args:
        wish: what the operator wants.
        observer: of the mission.
        patience_s: how long to wait for the effect [s of ``now_s``].
    """

    asks = True
    """The coordinator's own answer tells whether it knows."""

    def __init__(self, wish: StartWish, observer: Observer, patience_s: float) -> None:
        self._wish = wish
        self._observer = observer
        self._patience_s = patience_s
        self._confirmed = False

    def body(self, brief: Brief) -> StartWithout | Verdict:
        """What to say; or why it cannot be said."""
        uav, fleet = self._wish.target, [str(uav.id) for uav in brief.uavs]
        if uav not in fleet:
            return Verdict(Result.UNKNOWN_UAV, f"the fleet is {', '.join(fleet)}")
        phase = self._observer.phase
        if phase is not EpochPhase.PREPARING:
            past = "has started already" if phase is EpochPhase.RUNNING else "has ended"
            return Verdict(Result.NOT_OBEYED, f"the mission {past}: nobody waits for {uav}")
        return StartWithout(uav, brief.run, self._wish.reason)

    def heed(self, fact: BusFact, said: Message) -> None:
        """See whether the coordinator knows of it."""
        if isinstance(fact, Learned):
            answers = (each for each in fact.snapshots if each.writer == COORDINATOR)
            messages = (message for each in answers for message in each.messages)
            self._confirmed |= any(m.key == said.key and m.stamp >= said.stamp for m in messages)

    def next_deadline_s(self) -> float | None:
        """Only news can change the judgement."""
        return None

    def judge(self, said: Message, now_s: float, *, late: bool) -> Verdict | None:
        """What has come of it by now; None as long as that is open, and it is not ``late``."""
        del said, now_s  # whoever has said it since means the same
        observer, uav, epoch = self._observer, self._wish.target, self._observer.replica.epoch
        if epoch is not None and epoch.phase is EpochPhase.RUNNING:
            how = "with" if uav in epoch.sequence else "without"
            return Verdict(Result.OBEYED, f"the mission has started {how} {uav}")
        if epoch is not None and epoch.phase is EpochPhase.ENDED:
            return Verdict(Result.NOT_OBEYED, f"the mission has ended: {epoch.reason}")
        waits_for = self._waits_for
        if self._confirmed and (late or waits_for):
            what = f"waits for {waits_for}" if waits_for else "starts as soon as it is planned"
            return Verdict(Result.OBEYED, f"without {uav}; the mission {what}")
        if not late:
            return None
        if COORDINATOR not in observer.present:
            text = "there is no coordinator that could start the mission"
        else:
            text = f"the coordinator has not confirmed it within {self._patience_s:g} s"
        return Verdict(Result.NOT_OBEYED, text)

    @property
    def _waits_for(self) -> str:
        """What else the start waits for; empty if for nothing but its plan."""
        replica, present = self._observer.replica, self._observer.present
        fleet = [] if replica.brief is None else [str(uav.id) for uav in replica.brief.uavs]
        phases = {u: c.phase for u, c in replica.claims.items() if u in present}
        settled = (ClaimPhase.IDLE, ClaimPhase.OUT, ClaimPhase.PAUSED)
        without = dispensable(replica)
        missing = [u for u in fleet if phases.get(u) not in settled and u not in without]
        if missing:
            return ", ".join(missing)
        nobody = ClaimPhase.IDLE not in phases.values()
        return "the first UAV that is airborne" if nobody else ""
