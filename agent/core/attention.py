"""What of the words of others one agent has to look up for.

In a large fleet nearly all that is said concerns others: they take tasks, hold them and end them,
while this UAV is busy with its own. It remembers what they say, and nothing else follows.
"""

from __future__ import annotations

from collections.abc import Iterable

from agent.core.context import AgentContext, AgentPart
from agent.core.state_sync import StateSync
from agent.core.states import BUSY
from swarm.protocol.events import MessagesReceived
from swarm.protocol.messages import Message
from swarm.protocol.uav_messages import Claim, Outcome


class Attention(AgentPart):
    """Tells what an agent only remembers from what it has to think about.

    Args:
        context: of the agent.
        sync: takes in what is heard.
        shows_stations: whether ground stations are shown what the fleet has done.
    """

    def __init__(self, context: AgentContext, sync: StateSync, *, shows_stations: bool) -> None:
        super().__init__(context)
        self._sync = sync
        self._shows_stations = shows_stations

    def only_remembers(self, event: MessagesReceived, now_s: float) -> bool:
        """Whether nothing follows from ``event``; then it has been taken in.

        To be asked while nothing is due by itself.
        """
        messages = event.messages
        if messages:
            task = self._busy_with()
            if task is None or self._announcer.has_news(now_s):
                return False
            for message in messages:
                if not self._is_about_another(message, task):
                    return False
            for message in messages:
                self._sync.hear(message, now_s)
        return True

    def may_read_later(self, message: Message, now_s: float) -> bool:
        """Whether it would be only remembered now, and later as well, before anything else.

        To be asked while nothing is due by itself; in shared air what others say of their ways is
        looked at when they say it.
        """
        task = self._busy_with()
        brief = self._replica.brief
        if task is None or brief is None or brief.separation_m is not None:
            return False
        if self._replica.zone_edits:
            return False
        if self._mission_view.place_enu_m is None or self._announcer.has_news(now_s):
            return False
        return self._is_about_another(message, task)

    def read(self, heard: Iterable[tuple[Message, float]]) -> None:
        """Take in what could be read later, each as of when it was heard [s of ``now_s``]."""
        for message, at_s in heard:
            self._sync.hear(message, at_s)

    def _busy_with(self) -> str | None:
        """The task that this UAV flies to or works at; None where more is to be thought of."""
        claim = self._replica.claims.get(self._uav)
        if claim is None or self._machine.state not in BUSY or self._shows_stations:
            return None
        return claim.task

    def _is_about_another(self, message: Message, task: str) -> bool:
        """Whether a UAV that is there says what it does about another task, and elsewhere."""
        body, writer = message.body, message.writer
        if not isinstance(body, Claim | Outcome) or body.task == task:
            return False
        if not self._peers.membership.is_credible(writer):
            return False
        return isinstance(body, Outcome) or not self._airway.concerned(writer, body)
