"""Observe a mission of which only the name is known, until it is over and nobody is there any more.

It may be flown at a speed-up that whoever joins it has not been told: see
coordinator.mission_view.pace.
"""

from __future__ import annotations

from functools import partial

from coordinator.mission_view.mission_state import MissionState
from coordinator.mission_view.pace import SpeedupEstimator
from swarm.model import Mission
from swarm.protocol.board import mission_of
from swarm.protocol.events import (
    CommonAction,
    CommonEvent,
    Finish,
    MessageReceived,
    SnapshotsReceived,
)
from swarm.protocol.messages import Message, MissionPhase
from swarm.protocol.operator_commands import abort_command
from swarm.protocol.timing import Timing, earliest
from swarm.protocol.uav_messages import Status, StatusPhase

_UNEVEN = 0.02
"""Change of the mission's pace that is worth setting the clock anew."""


class MissionObserver:
    """A core that feeds a `MissionState` until that knows how the mission stands.

    Args:
        patience_s: how long to wait for what is missing [s of ``now_s``]; None to look on
            for ever.
        complete: keep the state's mission like the board, which takes 0.1 s a change for
            100 UAVs and 1000 tasks; else its board alone tells the tasks.
        explains: see `MissionState`.
        near_m: see `MissionState`.
    """

    def __init__(
        self,
        mission: str,
        timing: Timing,
        patience_s: float | None,
        *,
        complete: bool = True,
        explains: bool = False,
        near_m: float | None = None,
    ) -> None:
        unknown = Mission(mission, horizon_s=1.0, uavs=(), tasks=())
        self.mission_state = MissionState(unknown, timing, explains=explains, near_m=near_m)
        self._name = mission
        self._patience_s = patience_s
        self._complete = complete
        self._leave_at_s: float | None = None
        self._version = self.mission_state.replica.board_version
        self._learned = False
        self._speedup_estimator = SpeedupEstimator()

    def start(self, now_s: float) -> list[CommonAction]:
        """Ask what has happened so far."""
        if self._patience_s is not None:
            self._leave_at_s = now_s + self._patience_s
        return self.mission_state.start(now_s)

    def step(self, fact: CommonEvent, now_s: float) -> list[CommonAction]:
        """Take note of one fact."""
        wishes = self.mission_state.step(fact, now_s)
        replica = self.mission_state.replica
        changed = replica.board_version != self._version
        if self._complete and replica.brief is not None and changed:
            self._version = replica.board_version
            self.mission_state.revise(partial(mission_of, replica, self._name, replica.brief))
        if isinstance(fact, SnapshotsReceived):
            self._learned = self.known
        if isinstance(fact, MessageReceived):
            self._keep_time(fact.message, now_s)
        if self._leave_at_s is not None and (self.informed or self._leave_at_s <= now_s):
            wishes.append(Finish(0 if self.known else 1))
        return wishes

    def _keep_time(self, message: Message, now_s: float) -> None:
        """Follow the mission's time if it runs otherwise than the own clock."""
        if not isinstance(message.body, Status) or message.body.mission_s is None:
            return
        mission_s, known_s = message.body.mission_s, self.mission_state.mission_s(now_s)
        pace = self._speedup_estimator.told(message.writer, now_s, mission_s)
        if known_s is None or (pace == 1.0 and self.mission_state.pace == 1.0):
            return
        # The picture's clock shall run evenly: small differences are the network's.
        if abs(pace / self.mission_state.pace - 1.0) > _UNEVEN or abs(known_s - mission_s) > pace:
            self.mission_state.keep_time(now_s, mission_s, pace)

    def next_deadline_s(self) -> float | None:
        """When `step` wants a tick."""
        deadlines = (self.mission_state.next_deadline_s(), self._leave_at_s)
        return earliest(*deadlines)

    @property
    def known(self) -> bool:
        """Whether there is anything to show."""
        return self.mission_state.replica.brief is not None

    @property
    def lack(self) -> str:
        """What to say when there is nothing to show."""
        there = sorted(self.mission_state.present)
        who = f"{', '.join(there)} cannot tell it yet" if there else "nobody is there"
        return f"nothing is known of mission {self.mission_state.mission.name}: {who}"

    @property
    def informed(self) -> bool:
        """Whether nothing more is to be waited for: what all know, and a word of each UAV there."""
        mission_state = self.mission_state
        fleet = {uav.id for uav in mission_state.mission.uavs}
        told = fleet & mission_state.present <= mission_state.statuses.keys()
        return self._learned and bool(mission_state.present) and told


_ENDS = (StatusPhase.HOME, StatusPhase.OUT)
"""Where an agent's part ends."""


def deserted(mission_state: MissionState) -> bool:
    """Whether the mission is over and nobody is there any more, as far as is known.

    A mission without a coordinator is over when no task is left, or it was aborted. While the
    own link is down nobody is seen leaving: who was home then needs no watching, as when the
    bus ends with the mission.
    """
    if mission_state.replica.brief is None:
        return False
    done = mission_state.phase is MissionPhase.RUNNING and not mission_state.board.unfinished
    if not (
        done
        or mission_state.phase is MissionPhase.ENDED
        or abort_command(mission_state.replica) is not None
    ):
        return False
    there = mission_state.present
    if mission_state.cut_since_s is not None:
        there = {
            uav
            for uav, status in mission_state.statuses.items()
            if uav in there and status.phase not in _ENDS
        }
    return not there
