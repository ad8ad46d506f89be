"""An operator's wishes, any number at once, each followed until it is known what came of it.

For whoever looks on already: `Errands` is given the `Observer` of a mission, which somebody
else feeds, says what the operator wants under the operator's name, repeats it, and judges
from what the observer sees. One command line's seat (coordinator.operator.seat) has one
errand, the dashboard's desk many.

    errands = Errands(observer, incarnation=…, timing=…, patience_s=10.0)
    errand = errands.give(NewTask((10.0, 20.0, 0.0), value=3.0), now_s)
    wishes = errands.step(fact, now_s)    # after `observer.step(fact, now_s)`, for every fact
    errand.verdict                        # None while it is open

`step` gives what is to be published and asked, so step once (with a `Tick`) after `give`, and
whenever `next_deadline_s` comes. The process behind it takes its seat without a token
(``take_seat(bus, mission, None, status=True)``), and its shell has the name `OPERATOR`: then
answers to its questions always tell what is known of the operator's own registers, which is
how an order is confirmed. It should have asked once before it gives anything, lest it speaks
below what other operators have said. Leaves out: the mission (coordinator.observer), the
wishes themselves (coordinator.operator.commanding, coordinator.operator.starting,
coordinator.operator.task_orders), and who may have them.
"""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Protocol

from coordinator.observer import Observer
from coordinator.operator.commanding import Commanding, CommandWish
from coordinator.operator.starting import Starting, StartWish
from coordinator.operator.task_orders import NewTask, Ordering, Withdrawal
from coordinator.operator.verdict import Result, Verdict
from swarm.config import Timing
from swarm.events import Ask, BusFact, Publish, Wish
from swarm.model.ids import OPERATOR
from swarm.state.voice import Voice
from swarm.wire.messages import Brief, Command, Message, StartWithout, TaskOrder

__all__ = ["Errand", "Errands", "OperatorWish"]

OperatorWish = CommandWish | StartWish | NewTask | Withdrawal
Said = Command | StartWithout | TaskOrder


class Deed(Protocol):
    """One kind of wish: what to say for it, and how its effect shows."""

    asks: bool

    def body(self, brief: Brief) -> Said | Verdict:
        """What to say; or why it cannot be said."""
        ...

    def heed(self, fact: BusFact, said: Message) -> None:
        """Take note of a fact, which the observer has taken note of already."""
        ...

    def judge(self, said: Message, now_s: float, *, late: bool) -> Verdict | None:
        """What has come of it by now; None as long as that is open, and it is not ``late``."""
        ...

    def next_deadline_s(self) -> float | None:
        """When `judge` may find something though nothing happens."""
        ...


class Errand:
    """One wish under way.

    Args:
        wish: what the operator wants.
        deed: does it.
    """

    def __init__(self, wish: OperatorWish, deed: Commanding | Starting | Ordering) -> None:
        self.wish = wish
        self.deed = deed
        """Tells more than the verdict: whom a command concerns, who knows of a task order."""
        self.said: Message | None = None
        """What was said; None when it could not be."""
        self.verdict: Verdict | None = None
        """What has come of it; None as long as that is open."""
        self.leave_at_s = math.inf
        self.again_at_s = math.inf
        """When to repeat it."""
        self.ask_at_s = math.inf

    @property
    def obeyed(self) -> bool:
        """Whether it was seen to take effect."""
        return self.verdict is not None and self.verdict.result is Result.OBEYED

    @property
    def task(self) -> str | None:
        """Id of the task that it is about, once there is one."""
        return self.deed.task if isinstance(self.deed, Ordering) else None


class Errands:
    """All of one operator's wishes in one mission.

    Args:
        observer: of the mission; somebody else feeds it.
        incarnation: wall time in milliseconds.
        timing: timers, in the seconds of ``now_s``.
        patience_s: how long to wait for the effect of each [s of ``now_s``].
    """

    def __init__(
        self, observer: Observer, *, incarnation: int, timing: Timing, patience_s: float
    ) -> None:
        self.open: list[Errand] = []
        """Those of which it is not known what came, oldest first."""
        self._observer = observer
        self._voice = Voice(observer.mission.name, OPERATOR, incarnation)
        self._timing = timing
        self._patience_s = patience_s

    def give(self, wish: OperatorWish, now_s: float) -> Errand:
        """Say what the operator wants, from the next step on; at once with a verdict if it cannot.

        Args:
            wish: what they want.
            now_s: now.
        """
        observer, brief = self._observer, self._observer.replica.brief
        deed: Commanding | Starting | Ordering
        if isinstance(wish, CommandWish):
            deed = Commanding(wish, observer, self._patience_s)
        elif isinstance(wish, StartWish):
            deed = Starting(wish, observer, self._patience_s)
        else:
            deed = Ordering(wish, observer, self._timing, self._patience_s)
        errand = Errand(wish, deed)
        if brief is None:
            errand.verdict = Verdict(Result.UNKNOWN_MISSION, "nothing is known of the mission")
            return errand
        body = deed.body(brief)
        if isinstance(body, Verdict):
            errand.verdict = body
            return errand
        self._say(errand, body, now_s)
        errand.leave_at_s = now_s + self._patience_s
        if deed.asks:
            errand.ask_at_s = now_s + self._timing.ask_gap_s
        self.open.append(errand)
        return errand

    def step(self, fact: BusFact, now_s: float) -> list[Wish]:
        """Follow what has been given; call it after the observer has taken note of ``fact``."""
        wishes: list[Wish] = []
        asks = False
        for errand in self.open:
            said = self._said_for_this_run(errand, now_s)
            if said is None:
                continue
            said = self._said_apart(errand, said, now_s)
            errand.deed.heed(fact, said)
            if errand.again_at_s <= now_s:
                errand.again_at_s = now_s + self._timing.announce_s
                wishes.append(Publish(said))
            if errand.ask_at_s <= now_s:
                errand.ask_at_s = now_s + self._timing.ask_s
                asks = True
            late = errand.leave_at_s <= now_s
            errand.verdict = errand.deed.judge(said, now_s, late=late)
        self.open = [errand for errand in self.open if errand.verdict is None]
        return [*wishes, Ask()] if asks else wishes

    def _say(self, errand: Errand, body: Said, now_s: float) -> Message:
        """State ``body`` above all that is known of any operator."""
        for message in self._observer.replica.messages({OPERATOR}):
            self._voice.outdo(message.stamp)
        said = self._voice.say(body)
        self._observer.take_note(said, now_s)
        errand.said, errand.again_at_s = said, now_s
        return said

    def _said_for_this_run(self, errand: Errand, now_s: float) -> Message | None:
        """What was said; anew, if the brief turns out to be of another run than it was told of."""
        said, brief = errand.said, self._observer.replica.brief
        if said is None or brief is None or not isinstance(said.body, Said):
            return said
        if said.body.run == brief.run:
            return said
        return self._say(errand, replace(said.body, run=brief.run), now_s)

    def _said_apart(self, errand: Errand, said: Message, now_s: float) -> Message:
        """What was said; under another id, if another operator's task has come under the same."""
        body = errand.deed.apart(said) if isinstance(errand.deed, Ordering) else None
        return said if body is None else self._say(errand, body, now_s)

    def next_deadline_s(self) -> float | None:
        """When `step` wants a tick; None while nothing is open."""
        deadlines = [
            min(errand.leave_at_s, errand.again_at_s, errand.ask_at_s) for errand in self.open
        ]
        looks = (errand.deed.next_deadline_s() for errand in self.open)
        return min([*deadlines, *(at_s for at_s in looks if at_s is not None)], default=None)
