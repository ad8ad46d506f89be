"""An operator's desk: it looks on for as long as anybody cares, and says what the operator wants.

A core beside which the page is fed. It outlives the coordinator, all agents, and the flight:
when a mission of the same name is flown anew, it begins anew with it. Any number of orders are
under way at once, each followed to its verdict. Leaves out: following one
(coordinator.operator.errands), the process (coordinator.dashboard.live), and who may give
orders (coordinator.dashboard.access).
"""

from __future__ import annotations

from collections import deque
from dataclasses import dataclass, replace

from coordinator.dashboard.source import CommandRow, CommandState, Refusal, RefusedError
from coordinator.desertion import deserted
from coordinator.observer import Observer
from coordinator.operator.errands import Errand, Errands, OperatorWish
from coordinator.operator.verdict import Result
from coordinator.status.onlooker import Onlooker
from swarm.config import Timing
from swarm.deadline import earliest
from swarm.events import (
    BusFact,
    Finish,
    Heard,
    Learned,
    LinkChanged,
    Note,
    PeerGone,
    PeerSeen,
    Wish,
)
from swarm.model.ids import OPERATOR
from swarm.wire.messages import Brief, Message

__all__ = ["Desk"]

KEPT_ROWS = 1000


@dataclass(slots=True)
class _Given:
    """An order under way."""

    errand: Errand
    row: CommandRow
    who: str


class Desk:
    """A core that looks on and gives orders.

    Args:
        mission: name of the mission.
        timing: timers, in the seconds of ``now_s``.
        incarnation: wall time in milliseconds.
        patience_s: how long to wait for the effect of an order [s of ``now_s``].
        stays: look on for ever; else until the mission is over and everyone has left.
        first: number of the first order.
    """

    def __init__(
        self,
        mission: str,
        timing: Timing,
        *,
        incarnation: int,
        patience_s: float,
        stays: bool = True,
        first: int = 1,
    ) -> None:
        self.rows: deque[CommandRow] = deque(maxlen=KEPT_ROWS)
        """What was ordered, oldest first."""
        self._mission = mission
        self._timing = timing
        self._incarnation = incarnation
        self._patience_s = patience_s
        self._stays = stays
        self._next = first
        self._tokens: set[str] = set()
        self._given: list[_Given] = []
        self._notes: list[Wish] = []
        self._deserted_at_s: float | None = None
        self._finished = False
        self._onlooker, self._errands = self._begin()

    @property
    def observer(self) -> Observer:
        """What is known of the flight that is on."""
        return self._onlooker.observer

    def start(self, now_s: float) -> list[Wish]:
        """Ask what there is to know."""
        return self._onlooker.start(now_s)

    def step(self, fact: BusFact, now_s: float) -> list[Wish]:
        """Take note of one fact."""
        if self._finished:
            return []
        match fact:
            case PeerSeen(writer):
                self._tokens.add(writer)
            case PeerGone(writer):
                self._tokens.discard(writer)
        wishes = self._begin_anew(now_s) if self._is_flown_anew(fact) else []
        wishes += self._onlooker.step(fact, now_s)
        wishes += self._errands.step(fact, now_s)
        self._follow()
        wishes += self._notes
        self._notes = []
        if self._is_over(now_s):
            self._finished = True
            wishes.append(Finish(0))
        return wishes

    def next_deadline_s(self) -> float | None:
        """When `step` wants a tick; None when it has finished."""
        if self._finished:
            return None
        return earliest(
            self._onlooker.next_deadline_s(), self._errands.next_deadline_s(), self._deserted_at_s
        )

    def give(self, wish: OperatorWish, who: str, now_s: float) -> int:
        """Give an order, which goes out with the next step; its number.

        Args:
            wish: what the operator wants.
            who: asks for it, for the log.
            now_s: now.

        Raises:
            RefusedError: it could not be said.
        """
        errand = self._errands.give(wish, now_s)
        what, verdict = str(wish), errand.verdict
        if verdict is not None:
            self._notes.append(
                Note("order refused", {"what": what, "who": who, "why": verdict.text})
            )
            wrong = verdict.result.is_wrong_input
            text = f"{verdict.result.value}: {verdict.text}" if wrong else verdict.text
            early = verdict.result is Result.UNKNOWN_MISSION
            raise RefusedError(Refusal.TOO_EARLY if early else Refusal.WRONG, text)
        if errand.task is not None and errand.task not in what:
            what = f"{what}: {errand.task}"
        row = CommandRow(self._next, what, CommandState.PENDING, "")
        self._next += 1
        self.rows.append(row)
        self._given.append(_Given(errand, row, who))
        said = {"n": row.n, "what": what, "who": who}
        why = {"reason": wish.reason} if wish.reason else {}
        self._notes.append(Note("order given", said | why))
        return row.n

    # -- what comes of the orders -----------------------------------------------------

    def _follow(self) -> None:
        for given in self._given:
            verdict = given.errand.verdict
            if verdict is not None:
                obeyed = given.errand.obeyed
                self._close(given, verdict.text, CommandState.OBEYED if obeyed else _FAILED)
        self._given = [given for given in self._given if given.row.state is CommandState.PENDING]

    def _close(self, given: _Given, text: str, state: CommandState) -> None:
        before, given.row = given.row, replace(given.row, state=state, result=text)
        if before in self.rows:
            self.rows[self.rows.index(before)] = given.row
        said = {"n": before.n, "what": before.text, "who": given.who, "result": text}
        self._notes.append(Note(f"order {state.value}", said))

    # -- flights ----------------------------------------------------------------------

    def _begin(self) -> tuple[Onlooker, Errands]:
        onlooker = Onlooker(self._mission, self._timing, None, complete=False)
        errands = Errands(
            onlooker.observer,
            incarnation=self._incarnation,
            timing=self._timing,
            patience_s=self._patience_s,
        )
        return onlooker, errands

    def _is_flown_anew(self, fact: BusFact) -> bool:
        """Whether ``fact`` tells of a later flight than the one that is known."""
        known = self.observer.replica.brief
        if known is None:
            return False
        match fact:
            case Heard(message):
                return self._is_later(message, known)
            case Learned(snapshots):
                return any(
                    self._is_later(message, known)
                    for snapshot in snapshots
                    for message in snapshot.messages
                )
            case _:
                return False

    def _is_later(self, message: Message, known: Brief) -> bool:
        if not isinstance(message.body, Brief) or message.body.run == known.run:
            return False
        earlier = self.observer.replica.known(message)
        return earlier is not None and message.stamp > earlier.stamp

    def _begin_anew(self, now_s: float) -> list[Wish]:
        """Know nothing but who is there, and what the operator has said, so as to outdo it."""
        for given in self._given:
            self._close(given, "the mission was begun anew before it took effect", _FAILED)
        self._given = []
        before = self.observer
        self._onlooker, self._errands = self._begin()
        self.observer.replica.join_all(before.replica.messages({OPERATOR}))
        wishes = self._onlooker.start(now_s)
        if before.cut_since_s is not None:
            wishes += self._onlooker.step(LinkChanged(False), now_s)
        for writer in sorted(self._tokens):
            wishes += self._onlooker.step(PeerSeen(writer), now_s)
        return wishes

    def _is_over(self, now_s: float) -> bool:
        if self._stays or not deserted(self.observer):
            self._deserted_at_s = None
            return False
        if self._deserted_at_s is None:
            self._deserted_at_s = now_s + self._timing.relink_grace_s
        return self._deserted_at_s <= now_s


_FAILED = CommandState.NOT_OBEYED
