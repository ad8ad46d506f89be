"""The session behind a dashboard: it finds a mission and observes it, again and again.

Publishes ``operator/<target>`` and ``operator/task/<task>`` when the operator wants something;
subscribes to all that is said, watches ``alive/*`` and shows no token.
"""

from __future__ import annotations

from collections import Counter, deque
from collections.abc import Awaitable, Callable, Sequence

from coordinator.dashboard.operator_session import KEPT_ROWS, OperatorSession
from coordinator.dashboard.source import CommandRow, PlaybackControl, Refusal, RefusedError
from coordinator.joining import observer_shell, only_mission
from coordinator.mission_view.mission_state import MissionState
from coordinator.operator.requests import OperatorRequest
from swarm.bus.port import Bus
from swarm.model.ids import OPERATOR
from swarm.protocol.events import CommonAction, CommonEvent, Tick
from swarm.protocol.timing import LinkPreset
from swarm.runtime.clock import Clock, incarnation
from swarm.runtime.log import get_logger
from swarm.runtime.shell import Core, Shell

ObservingCore = Core[CommonEvent, CommonAction]

EFFECT_S = 10.0
"""Wall time in which an order shows its effect, or it has not been obeyed."""


class LiveMission:
    """A source that is a mission on the bus, or will be.

    Args:
        mission: its name; None for the only one there is, and after it for the next.
        open_bus: takes a seat on the bus, however long that takes.
        complete: see `MissionObserver`.
        around: puts a core that looks on with it around the session of a mission.
        name: of this process, in its log.
    """

    def __init__(
        self,
        mission: str | None,
        open_bus: Callable[[], Awaitable[Bus]],
        network: LinkPreset,
        clock: Clock,
        speedup: float,
        *,
        may_order: bool = True,
        complete: bool = False,
        around: Callable[[str, OperatorSession], ObservingCore] = lambda _, session: session,
        name: str = "dashboard",
    ) -> None:
        self.speedup = speedup
        self.orders = self if may_order else None
        """Takes orders; None where the keys are no operator's."""
        self.player: PlaybackControl | None = None
        self._mission = mission
        self._complete = complete
        self._open_bus = open_bus
        self._network = network
        self._clock = clock
        self._linked = False
        self._operator_session: OperatorSession | None = None
        self._shell: Shell[CommonEvent, CommonAction] | None = None
        self._before: deque[CommandRow] = deque(maxlen=KEPT_ROWS)
        """What was ordered in earlier sessions."""
        self._dropped = Counter[str]()
        """What was dropped in earlier seats."""
        self._around = around
        self._log = get_logger(name)

    async def run(self) -> None:
        """Look on until cancelled.

        Raises:
            InputError: no mission is named, and there are several.
        """
        while True:
            bus = await self._open_bus()
            try:
                self._linked = True
                mission = self._mission or await only_mission(bus, None)
                await self._look_on(bus, mission)
            finally:
                self._dropped, self._shell, self._linked = self.dropped, None, False
                bus.close()

    async def _look_on(self, bus: Bus, mission: str) -> None:
        first = 1
        if self._operator_session is not None:
            self._before.extend(self._operator_session.rows)
            first = self._before[-1].n + 1 if self._before else 1
        self._operator_session = OperatorSession(
            mission,
            self._network.timing.scaled(self.speedup),
            incarnation=incarnation(),
            patience_s=EFFECT_S * self.speedup,
            stays=self._mission is not None,
            first=first,
            complete=self._complete,
        )
        replica = self._operator_session.mission_state.replica
        self._shell = observer_shell(
            self._around(mission, self._operator_session),
            bus,
            self._clock,
            mission,
            OPERATOR,
            self._network.answer_s,
            known=replica.digest,
            left_out=lambda: replica.overfull,
        )
        self._log.info("looking on", mission=mission)
        await self._shell.run()

    # -- what a page is fed from --------------------------------------------------------

    @property
    def mission_state(self) -> MissionState | None:
        """What is known."""
        return None if self._operator_session is None else self._operator_session.mission_state

    @property
    def link(self) -> bool:
        """Whether the link to the bus is up."""
        return self._linked and (
            self.mission_state is None or self.mission_state.cut_since_s is None
        )

    def now_s(self) -> float:
        """Now."""
        return self._clock.now_s()

    @property
    def dropped(self) -> Counter[str]:
        """What could not be taken in."""
        return self._dropped + Counter({} if self._shell is None else self._shell.dropped)

    @property
    def commands(self) -> Sequence[CommandRow]:
        """What was ordered here."""
        return [
            *self._before,
            *(() if self._operator_session is None else self._operator_session.rows),
        ]

    def give(self, wish: OperatorRequest, who: str) -> int:
        """Give an order; its number.

        Raises:
            RefusedError: it was not said.
        """
        if self._operator_session is None or self._shell is None:
            raise RefusedError(Refusal.TOO_EARLY, "nobody on the bus flies a mission")
        n = self._operator_session.give(wish, who, self._clock.now_s())
        self._shell.step(Tick())
        return n
