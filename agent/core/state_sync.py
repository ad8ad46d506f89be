"""Keep what one agent knows in step with the others: what it hears, and when it asks.

Its knowledge is old at the start, when its link is back and after it was itself held up. Until
everyone has been asked since, and has had the time to answer, it goes on with the task it has and
decides nothing new.
"""

from __future__ import annotations

import math
from collections.abc import Collection, Iterable, Sequence
from statistics import median_high

from agent.core.context import AgentContext, AgentPart
from agent.core.interface import Event
from agent.core.mission_view import MissionChange
from agent.core.tasking import Tasking
from swarm.model.ids import COORDINATOR
from swarm.protocol.events import Ask, MessageReceived, MessagesReceived, PeerSeen
from swarm.protocol.messages import (
    Body,
    Message,
    MissionConfig,
    MissionPhase,
    PlanEpoch,
    Snapshot,
    TaskEdit,
    TaskEntry,
)
from swarm.protocol.registers import without_signers
from swarm.protocol.sync import EVERYONE_UP_TO, MOST_OPEN, QuestionTimer, some_of
from swarm.protocol.timing import Timing, earliest, stretch_of
from swarm.protocol.uav_messages import ClaimPhase, Nearby

_LAST_WORDS = 3
"""How often others are asked again at least what somebody who was lost has said at last."""
_REST = 4.0
"""So many times as long as it took to catch up, who is held up again does not."""
_WORTH_TELLING_S = 0.1
"""A correction of the mission clock by less is the network's."""


class StateSync(AgentPart):
    """What one agent takes from the bus.

    Args:
        tasking: hears of it when a task may have opened.
    """

    def __init__(self, context: AgentContext, tasking: Tasking) -> None:
        super().__init__(context)
        self.queries = StateQueries(context.uav, context.timing)
        self._tasking = tasking
        self._answered: set[str] = set()
        self._insisted = False
        self._insists_until_s = -math.inf
        self._left_by: set[str] = set()
        """Who was lost, and what it leaves open is not known for sure yet."""
        self._last_words: dict[str, float] = {}
        """Until when others are asked what those who were lost have said at last [s]."""
        self._echoes: list[Message] = []
        """Heard in the own name, though this life has not said so."""

    def demote_revoked(self, signers: Collection[str]) -> None:
        """See `Replica.demote_revoked`."""
        self._replica.demote_revoked(signers)
        self._echoes = without_signers(signers, self._echoes)

    # -- what is said -----------------------------------------------------------------

    def hear(self, message: Message, now_s: float, arrived_s: float | None = None) -> None:
        """Somebody says so; it came into this process just now, or at ``arrived_s``."""
        writer, body = message.writer, message.body
        if writer == self._uav:
            if self._announcer.is_foreign(message):
                # A twin lives, or word of an earlier life was long under way: ask which.
                if not self._echoes:
                    self.queries.doubt(now_s)
                self._echoes.append(message)
            elif message != self._replica.known(message):
                self._replica.stale += 1
            return
        if self._peers.heard(message, self._replica, now_s):
            self._greet(writer, now_s)
        if not self._machine.acts and self._is_first(body):
            # Whoever answered before did not know the mission; now somebody may know more.
            self.queries.doubt(now_s)
        known = self._replica.epoch_stamp
        self._take_in(message, now_s)
        # What was said before tells what time it is only to whom nothing else does.
        is_word = self._replica.epoch_stamp != known or not self._mission_view.clock.is_set
        if is_word and isinstance(body, PlanEpoch) and body.phase is MissionPhase.RUNNING:
            self._set_clock(body.mission_s, now_s if arrived_s is None else arrived_s, now_s)

    def without_repeated(
        self, event: MessageReceived | MessagesReceived, now_s: float
    ) -> MessagesReceived:
        """What of that something may follow from but that its writer lives.

        Nothing does where another UAV repeats what is known of it, or says where it is, and its
        word counts already.
        """
        news, membership = [], self._peers.membership
        for message in event.messages:
            writer = message.writer
            if writer == COORDINATOR or not membership.is_credible(writer):
                news.append(message)
            elif isinstance(message.body, Nearby):
                membership.heard(writer, now_s)
            elif self._replica.known(message) is message:
                self._peers.heard(message, self._replica, now_s)
            else:
                news.append(message)
        return MessagesReceived(tuple(news), event.arrived_s)

    def learn(self, snapshots: Sequence[Snapshot], now_s: float) -> None:
        """The answers to a question."""
        told = [message for snapshot in snapshots for message in snapshot.messages]
        for message in told + self._echoes:
            if self._replica.known(message) is not message:
                self._take_in(message, now_s)
        self._expect_claimants(now_s)
        self._echoes.clear()
        self._learn_clock(snapshots, now_s)
        somebody_knows = any(isinstance(message.body, MissionConfig) for message in told)
        self.queries.take(now_s, enough=somebody_knows and not self._machine.acts)
        answered = {snapshot.writer for snapshot in snapshots}
        self._answered |= answered & self._peers.membership.present
        for writer in self._left_by:
            claim = self._replica.claims.get(writer)
            self._tasking.consider_diversion("" if claim is None else claim.task or "")
        self._left_by.clear()
        self._ask_for_last_words(now_s)
        if self._lacks_epoch:
            self.queries.doubt(now_s, {COORDINATOR})
        if self.queries.current:
            self._insist(now_s)

    @property
    def _lacks_epoch(self) -> bool:
        """Whether an earlier life has taken something, and who could say in what has not answered.

        Others leave it to the coordinator to tell the epoch. To begin anew would be to leave that.
        """
        claim = self._replica.claims.get(self._uav)
        taken = claim is not None and claim.is_taken
        unheard = COORDINATOR in self._peers.membership.present - self._answered
        return taken and unheard and self._replica.epoch is None and not self._machine.acts

    def _ask_for_last_words(self, now_s: float) -> None:
        """Ask again what those who were lost have said at last.

        Whoever has heard it tells it only once it has missed them, too, and answers get lost; but
        in a crowd some have heard it anyway, and nobody asks so that all would answer.
        """
        for writer, until_s in list(self._last_words.items()):
            claim = self._replica.claims.get(writer)
            left = claim is not None and claim.phase is ClaimPhase.OUT
            back = writer in self._peers.membership.present
            if left or back or now_s >= until_s or self._are_many:
                del self._last_words[writer]
            else:
                self.queries.want(now_s + self._timing.announce_s)

    def _insist(self, now_s: float) -> None:
        """Ask again while somebody is there who has not answered: it may know the newest.

        At the start once; after a link came back until the others' had the time to. Of many only
        some are asked then, and whatever they know is told.
        """
        silent = self._peers.membership.present - self._answered - {self._uav}
        if not silent:
            return
        if not self._machine.acts and not self._insisted:
            self._insisted = True
            self.queries.doubt(now_s, of=silent)
        elif self._machine.acts and now_s < self._insists_until_s and not self._are_many:
            self.queries.doubt(now_s + 2.0 * self._timing.ask_gap_s, of=silent)

    @property
    def _are_many(self) -> bool:
        """Whether there are too many to ask everyone."""
        return len(self._peers.membership.present - {self._uav, COORDINATOR}) >= EVERYONE_UP_TO

    def _catch_up(self, now_s: float) -> None:
        """What the others did meanwhile is unknown, and they may be back later than this one."""
        self._answered.clear()
        self._insists_until_s = now_s + self._timing.relink_grace_s
        self.queries.doubt(now_s)

    def remember(self, memory: Snapshot, now_s: float) -> None:
        """An earlier life of this agent knew so."""
        for message in memory.messages:
            self._take_in(message, now_s)
        self._expect_claimants(now_s)
        self._learn_clock([memory], now_s)

    def yields_to(self, snapshots: Iterable[Snapshot]) -> bool:
        """Whether one of them is of a twin, another process under this name, that keeps the UAV.

        One at work comes before one that learns, which has nothing to tell; of two at work
        the newer stays, of two that learn the older.
        """
        return any(self._yields_to(twin) for twin in snapshots if twin.writer == self._uav)

    def _yields_to(self, twin: Snapshot) -> bool:
        newer = twin.incarnation > self._announcer.incarnation
        if self._machine.acts:
            return bool(twin.messages) and newer
        return bool(twin.messages) or not newer

    def _is_first(self, body: Body) -> bool:
        """Whether nothing was known of the mission in that respect."""
        return (isinstance(body, MissionConfig) and self._replica.brief is None) or (
            isinstance(body, PlanEpoch) and self._replica.epoch is None
        )

    def _take_in(self, message: Message, now_s: float) -> None:
        if message.writer == self._uav:
            if self._machine.acts:
                self._actions += self._announcer.hear_echo(message)
            else:
                self._announcer.remember(message)
            return
        news = self._mission_view.take_in(message)
        if news is None:
            return
        if isinstance(message.body, MissionConfig):
            stretch = stretch_of(len(message.body.uavs))
            self._announcer.stretch(stretch)
            self._peers.membership.stretch(stretch)
        self._peers.stated(message.writer, message.body, now_s)
        if news is MissionChange.APPEARANCE and isinstance(message.body, TaskEntry | TaskEdit):
            self._tasking.consider_diversion(message.body.task)
        if news in (MissionChange.APPEARANCE, MissionChange.OPENING):
            self._awake(now_s)
        elif news is MissionChange.CLAIM:
            self._tasking.peer_claimed(now_s)

    def _expect_claimants(self, now_s: float) -> None:
        """Whose claim is known by hearsay must speak: it may hang since, with a living token."""
        self._peers.membership.expect(self._replica.claims.keys() - {self._uav}, now_s)

    def _set_clock(self, mission_s: float, said_s: float, now_s: float) -> None:
        """The coordinator has said at ``said_s`` or before that it is ``mission_s``."""
        clock = self._mission_view.clock
        was_set, change_s = clock.is_set, clock.hear(mission_s, said_s)
        if not was_set:
            self._awake(now_s)
            self._log("mission runs", mission_s=mission_s)
        elif abs(change_s) >= _WORTH_TELLING_S:
            self._log("mission clock corrected", by_s=change_s, mission_s=mission_s)

    def _learn_clock(self, told: Iterable[Snapshot], now_s: float) -> None:
        """The coordinator's word counts; else one odd clock among many must not set the time.

        The others may all have it of an odd one, so their word sets only what is not known.
        """
        known_s = {each.writer: each.mission_s for each in told if each.mission_s is not None}
        if not known_s or self._replica.epoch is None:
            return
        if (mission_s := known_s.get(COORDINATOR)) is not None:
            self._mission_view.clock.hear(mission_s, now_s)
        elif not self._mission_view.clock.is_set:
            self._mission_view.clock.hear(median_high(known_s.values()), now_s)

    # -- who is there -----------------------------------------------------------------

    def see(self, writer: str, now_s: float) -> None:
        """The token of ``writer`` is there."""
        if writer != self._uav and self._peers.membership.seen(writer, now_s):
            self._greet(writer, now_s)

    def only_meets(self, event: Event, now_s: float) -> bool:
        """Note it, if it is somebody who comes before the mission runs and has said nothing yet.

        Nothing else follows from that, however many come.
        """
        if not isinstance(event, PeerSeen) or self._mission_view.running:
            return False
        if event.writer in self._replica.heads:
            return False
        self.see(event.writer, now_s)
        return True

    def miss(self, writer: str, now_s: float) -> None:
        """The token of ``writer`` has disappeared."""
        if writer != self._uav:
            self._peers.membership.gone(writer, now_s)

    def link(self, up: bool, now_s: float) -> None:
        """The own link came up or went down."""
        self._peers.membership.link(up, now_s)
        self._announcer.link(up)
        if up and self.queries.ever:
            self._catch_up(now_s)
            self._greet_all(now_s)

    def held_up(self, now_s: float) -> None:
        """This process was stopped or starved; what the others did meanwhile is unread."""
        self._peers.membership.held_up(now_s)
        if self.queries.may_catch_up(now_s):
            self._catch_up(now_s)
        self._log("held up")

    def lose(self, now_s: float) -> None:
        """Give up those who have been missing for long enough."""
        for writer, why in self._peers.lost(now_s):
            claim = self._replica.claims.get(writer)
            left = claim is not None and claim.phase is ClaimPhase.OUT
            self._log("left" if left else "lost", writer=writer, why=why)
            self._awake(now_s)
            self.queries.want(now_s)  # others may have heard its last words
            self._left_by.add(writer)
            self._last_words[writer] = now_s + _LAST_WORDS * self._timing.announce_s

    def _greet(self, writer: str, now_s: float) -> None:
        """Somebody is there anew: tell it the own registers, and hear what it may know.

        Who comes for the first time asks by itself: N who come to N would make all of them repeat
        what they have said N times.
        """
        if back := self._peers.back(writer):
            self._log("back", writer=writer)
        if self.queries.ever:
            if back or writer == COORDINATOR or not self._are_many:
                self._greet_all(now_s)
            if back or writer == COORDINATOR:
                self.queries.want(now_s, {writer})

    def _greet_all(self, now_s: float) -> None:
        """Repeat the own registers; what an earlier life said is not this one's to repeat."""
        if self._machine.acts:
            self._actions += self._announcer.greet(now_s)

    def _awake(self, now_s: float) -> None:
        """A task may have opened: everyone who is free decides anew, in sequence order."""
        self._peers.awake(now_s)
        self._tasking.wake(now_s)


class StateQueries:
    """Whether what the agent ``own`` knows is up to date, when it asks for more, and whom."""

    def __init__(self, own: str, timing: Timing) -> None:
        self.ever = False
        """Whether any question has been answered, be it by nobody."""
        self.current = False
        """Whether one has that was asked since the last doubt."""
        self._asking = QuestionTimer(timing.ask_gap_s, MOST_OPEN)
        self._ask_s = timing.ask_s
        self._again_at_s: float | None = None
        self._outdated = 0
        """Questions without an answer that were asked before the last doubt."""
        self._catching_up_since_s: float | None = None
        """Since when it asks because it was held up."""
        self._rests_until_s = -math.inf
        self._own = own
        self._everyone = False
        self._wanted: set[str] = set()
        """Whom the next question is for at any rate."""
        self._turn = 0

    def want(self, now_s: float, of: Collection[str] = ()) -> None:
        """Others may have news, those ``of`` whom it is wanted above all."""
        self._wanted.update(of)
        self._asking.want(now_s)

    def doubt(self, now_s: float, of: Collection[str] = (), *, everyone: bool = False) -> None:
        """What is known is old: nothing is decided before others have been asked.

        ``everyone`` of them, where what each has said meanwhile may have reached nobody else.
        """
        self.current, self._outdated = False, self._asking.open
        self._everyone |= everyone
        self.want(now_s, of)

    def may_catch_up(self, now_s: float) -> bool:
        """Whether who was held up is to ask what the others did meanwhile; it does then.

        Not who is held up again while it does, or soon after if that has taken long: a process that
        has too much to do would only ask, decide nothing, and give the others more to do.
        """
        if self._catching_up_since_s is not None or now_s < self._rests_until_s:
            return False
        self._catching_up_since_s = now_s
        return True

    def take(self, now_s: float, *, enough: bool) -> None:
        """Answers have come; ``enough`` if they are up to date whenever they were asked for."""
        self.ever = True
        self.current |= enough or self._asking.open > self._outdated == 0
        if self.current and self._catching_up_since_s is not None:
            self._rests_until_s = now_s + _REST * (now_s - self._catching_up_since_s)
            self._catching_up_since_s = None
        self._asking.answered()
        self._outdated = max(0, self._outdated - 1)

    def questions(self, now_s: float, *, lacking: bool, present: Collection[str] = ()) -> list[Ask]:
        """The question that is due, if any; of many who are ``present`` it is for some.

        Like a doubt, what is ``lacking`` and only others can tell is asked for again and again.
        """
        if self.current and not lacking:
            self._again_at_s = None
        elif self._again_at_s is not None and self._again_at_s <= now_s:
            if self._asking.is_full:
                self._again_at_s = now_s + self._ask_s
            else:
                self._asking.want(now_s)
                self._again_at_s = None  # until that question has been asked
        self._asking.stretch = stretch_of(len(present))
        if not self._asking.due(now_s):
            return []
        if lacking or not self.current:
            self._again_at_s = now_s + self._ask_s
        asked = () if self._everyone else some_of(self._own, present, self._wanted, self._turn)
        self._everyone, self._turn = False, self._turn + 1
        self._wanted.clear()
        return [Ask(asked)]

    def next_deadline_s(self) -> float | None:
        """When `questions` will next have one."""
        return earliest(self._asking.next_deadline_s(), self._again_at_s)
