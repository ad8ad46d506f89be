"""An onlooker that knows only a mission's name and learns the rest from the bus.

Leaves out: what it makes of what it hears (coordinator.observer), and how that is
shown (coordinator.status.table).
"""

from __future__ import annotations

import asyncio
from functools import partial

from coordinator.observer import Observer
from coordinator.tempo import Tempo
from swarm.bus.port import Bus, TokenSeen
from swarm.config import Timing
from swarm.deadline import earliest
from swarm.errors import Fault, InputError, SwarmError
from swarm.events import BusFact, Finish, Heard, Learned, Wish
from swarm.model import Mission
from swarm.state.board import mission_of
from swarm.wire.keys import ANY_TOKEN, mission_of_token
from swarm.wire.messages import Message, Status

__all__ = ["Onlooker", "find_missions", "only_mission"]

SETTLE_S = 0.4
"""Wall time after the first token of a mission in which those of others come too."""
_UNEVEN = 0.02
"""Change of the mission's pace that is worth setting the clock anew."""


async def find_missions(bus: Bus, patience_s: float | None) -> list[str]:
    """Names of all missions that somebody on ``bus`` flies, once there is one.

    Args:
        bus: open; its inbox is read.
        patience_s: how long to wait for the first [wall s]; None for as long as it takes.
    """
    bus.watch_tokens(ANY_TOKEN)
    found: set[str] = set()
    wait_s = patience_s
    try:
        while True:
            async with asyncio.timeout(wait_s):
                await bus.inbox.wait()
            tokens = [event.key for event in bus.inbox.take() if isinstance(event, TokenSeen)]
            new = {mission for token in tokens if (mission := mission_of_token(token))} - found
            found |= new
            wait_s = SETTLE_S if new else wait_s
    except TimeoutError:
        return sorted(found)


async def only_mission(bus: Bus, patience_s: float | None) -> str:
    """The mission that is meant when none is named.

    Args:
        bus: open; its inbox is read.
        patience_s: how long to wait for it [wall s]; None for as long as it takes.

    Raises:
        SwarmError: there is none.
        InputError: there are several.
    """
    missions = await find_missions(bus, patience_s)
    if not missions:
        raise SwarmError(f"nobody on the bus flies a mission (looked for {patience_s:g} s)")
    if len(missions) > 1:
        problem = f"there are several missions: {', '.join(missions)}"
        raise InputError(Fault("--mission", "", problem, "name one of them"))
    return missions[0]


class Onlooker:
    """A core that feeds an `Observer` until that knows how the mission stands.

    Args:
        mission: name of the mission.
        timing: timers, in the seconds of ``now_s``.
        patience_s: how long to wait for what is missing [s of ``now_s``]; None to look on
            for ever.
        complete: keep the observer's mission like the board, which takes 0.1 s a change for
            100 UAVs and 1000 tasks; else its board alone tells the tasks.
    """

    def __init__(
        self,
        mission: str,
        timing: Timing,
        patience_s: float | None,
        *,
        complete: bool = True,
    ) -> None:
        self.observer = Observer(Mission(mission, horizon_s=1.0, uavs=(), tasks=()), timing)
        self._name = mission
        self._patience_s = patience_s
        self._complete = complete
        self._leave_at_s: float | None = None
        self._version = self.observer.replica.board_version
        self._learned = False
        self._tempo = Tempo()

    def start(self, now_s: float) -> list[Wish]:
        """Ask what has happened so far."""
        if self._patience_s is not None:
            self._leave_at_s = now_s + self._patience_s
        return self.observer.start(now_s)

    def step(self, fact: BusFact, now_s: float) -> list[Wish]:
        """Take note of one fact."""
        wishes = self.observer.step(fact, now_s)
        replica = self.observer.replica
        changed = replica.board_version != self._version
        if self._complete and replica.brief is not None and changed:
            self._version = replica.board_version
            self.observer.revise(partial(mission_of, replica, self._name, replica.brief))
        if isinstance(fact, Learned):
            self._learned = self.known
        if isinstance(fact, Heard):
            self._keep_time(fact.message, now_s)
        if self._leave_at_s is not None and (self.informed or self._leave_at_s <= now_s):
            wishes.append(Finish(0 if self.known else 1))
        return wishes

    def _keep_time(self, message: Message, now_s: float) -> None:
        """Follow the mission's time if it runs otherwise than the own clock."""
        if not isinstance(message.body, Status) or message.body.mission_s is None:
            return
        mission_s, known_s = message.body.mission_s, self.observer.mission_s(now_s)
        pace = self._tempo.told(message.writer, now_s, mission_s)
        if known_s is None or (pace == 1.0 and self.observer.pace == 1.0):
            return
        # The picture's clock shall run evenly: small differences are the network's.
        if abs(pace / self.observer.pace - 1.0) > _UNEVEN or abs(known_s - mission_s) > pace:
            self.observer.keep_time(now_s, mission_s, pace)

    def next_deadline_s(self) -> float | None:
        """When `step` wants a tick."""
        deadlines = (self.observer.next_deadline_s(), self._leave_at_s)
        return earliest(*deadlines)

    @property
    def known(self) -> bool:
        """Whether there is anything to show."""
        return self.observer.replica.brief is not None

    @property
    def lack(self) -> str:
        """What to say when there is nothing to show."""
        there = sorted(self.observer.present)
        who = f"{', '.join(there)} cannot tell it yet" if there else "nobody is there"
        return f"nothing is known of mission {self.observer.mission.name}: {who}"

    @property
    def informed(self) -> bool:
        """Whether nothing more is to be waited for: what all know, and a word of each UAV there."""
        observer = self.observer
        fleet = {uav.id for uav in observer.mission.uavs}
        told = fleet & observer.present <= observer.statuses.keys()
        return self._learned and bool(observer.present) and told
