"""What one agent takes from the bus: registers, answers, who is there, and words in its own name.

It keeps the others informed in turn, and asks them when they may know more. Leaves out:
what follows for the vehicle (agent.core), for tasks (agent.tasking).
"""

from __future__ import annotations

import math
from collections.abc import Collection, Iterable, Sequence
from statistics import median_high

from agent.events import Action
from agent.learning import Learning
from agent.peers import Peers
from agent.picture import News, Picture
from agent.speech import Speech
from agent.tasking import Tasking
from swarm.config import Timing
from swarm.events import Note
from swarm.model.ids import COORDINATOR
from swarm.state.registers import Replica, without_signers
from swarm.wire.messages import Body, Brief, ClaimPhase, Epoch, EpochPhase, Message, Snapshot

__all__ = ["Hearing"]

_WORTH_TELLING_S = 0.1
"""A correction of the mission clock by less is the network's."""


class Hearing:
    """The ear of the agent of ``uav``.

    Args:
        uav: id of the UAV.
        replica: the shared registers.
        picture: the mission.
        peers: the others.
        speech: what this agent says.
        tasking: hears of it when a task may have opened.
        timing: timers.
    """

    def __init__(
        self,
        uav: str,
        replica: Replica,
        picture: Picture,
        peers: Peers,
        speech: Speech,
        tasking: Tasking,
        timing: Timing,
    ) -> None:
        self.learning = Learning(timing)
        self.at_work = False
        """Whether this life has begun to act; until then, words in its name are of an earlier."""
        self._uav = uav
        self._replica = replica
        self._picture = picture
        self._peers = peers
        self._speech = speech
        self._tasking = tasking
        self._timing = timing
        self._answered: set[str] = set()
        self._insisted = False
        self._insists_until_s = -math.inf
        self._left_open = False
        """Whether somebody was lost, and what it leaves open is not known for sure yet."""
        self._echoes: list[Message] = []
        """Heard in the own name, though this life has not said so."""

    def disown(self, signers: Collection[str]) -> None:
        """See `Replica.disown`."""
        self._replica.disown(signers)
        self._echoes = without_signers(signers, self._echoes)

    # -- what is said -----------------------------------------------------------------

    def hear(self, message: Message, now_s: float) -> list[Action]:
        """Somebody says so just now."""
        writer, body = message.writer, message.body
        if writer == self._uav:
            if self._speech.is_foreign(message):
                # A twin lives, or word of an earlier life was long under way: ask which.
                if not self._echoes:
                    self.learning.doubt(now_s)
                self._echoes.append(message)
            elif message != self._replica.known(message):
                self._replica.stale += 1
            return []
        actions = (
            self._greet(writer, now_s) if self._peers.heard(message, self._replica, now_s) else []
        )
        if not self.at_work and self._is_first(body):
            # Whoever answered before did not know the mission; now somebody may know more.
            self.learning.doubt(now_s)
        known = self._replica.epoch_stamp
        actions += self._take_in(message, now_s)
        # What was said before tells what time it is only to whom nothing else does.
        is_word = self._replica.epoch_stamp != known or not self._picture.knows_time
        if is_word and isinstance(body, Epoch) and body.phase is EpochPhase.RUNNING:
            actions += self._set_clock(body.mission_s, now_s)
        return actions

    def learn(self, snapshots: Sequence[Snapshot], now_s: float) -> list[Action]:
        """The answers to a question."""
        actions, told = list[Action](), list[Message]()
        for snapshot in snapshots:
            told += snapshot.messages
        for message in told + self._echoes:
            if self._replica.known(message) is not message:
                actions += self._take_in(message, now_s)
        self._expect_claimants(now_s)
        self._echoes.clear()
        self._learn_clock(snapshots, now_s)
        somebody_knows = any(isinstance(message.body, Brief) for message in told)
        self.learning.take(enough=somebody_knows and not self.at_work)
        answered = {snapshot.writer for snapshot in snapshots}
        self._answered |= answered & self._peers.membership.present
        if self._left_open:
            self._left_open = False
            self._tasking.tempt()
        if self.learning.current:
            self._insist(now_s)
        return actions

    def _insist(self, now_s: float) -> None:
        """Ask again while somebody is there who has not answered: it may know the newest.

        At the start once; after a link came back until the others' had the time to.
        """
        silent = self._peers.membership.present - self._answered - {self._uav}
        if not silent:
            return
        if not self.at_work and not self._insisted:
            self._insisted = True
            self.learning.doubt(now_s)
        elif self.at_work and now_s < self._insists_until_s:
            self.learning.doubt(now_s + 2.0 * self._timing.ask_gap_s)

    def _catch_up(self, now_s: float) -> None:
        """What the others did meanwhile is unknown, and they may be back later than this one."""
        self._answered.clear()
        self._insists_until_s = now_s + self._timing.relink_grace_s
        self.learning.doubt(now_s)

    def remember(self, memory: Snapshot, now_s: float) -> list[Action]:
        """An earlier life of this agent knew so."""
        actions = [a for message in memory.messages for a in self._take_in(message, now_s)]
        self._expect_claimants(now_s)
        self._learn_clock([memory], now_s)
        return actions

    def yields_to(self, snapshots: Iterable[Snapshot]) -> bool:
        """Whether one of them is of a twin, another process under this name, that keeps the UAV.

        One at work comes before one that learns, which has nothing to tell; of two at work
        the newer stays, of two that learn the older.
        """
        return any(self._yields_to(twin) for twin in snapshots if twin.writer == self._uav)

    def _yields_to(self, twin: Snapshot) -> bool:
        newer = twin.incarnation > self._speech.incarnation
        if self.at_work:
            return bool(twin.messages) and newer
        return bool(twin.messages) or not newer

    def _is_first(self, body: Body) -> bool:
        """Whether nothing was known of the mission in that respect."""
        return (isinstance(body, Brief) and self._replica.brief is None) or (
            isinstance(body, Epoch) and self._replica.epoch is None
        )

    def _take_in(self, message: Message, now_s: float) -> list[Action]:
        if message.writer == self._uav:
            if self.at_work:
                return [*self._speech.hear_echo(message)]
            self._speech.remember(message)
            return []
        news = self._picture.take_in(message)
        if news is None:
            return []
        self._peers.stated(message.writer, message.body, now_s)
        if news is News.APPEARANCE:
            self._tasking.tempt()
        if news in (News.APPEARANCE, News.OPENING):
            self._awake(now_s)
        elif news is News.CLAIM:
            self._tasking.peer_claimed(now_s)
        return []

    def _expect_claimants(self, now_s: float) -> None:
        """Whose claim is known by hearsay must speak: it may hang since, with a living token."""
        self._peers.membership.expect(self._replica.claims.keys() - {self._uav}, now_s)

    def _set_clock(self, mission_s: float, now_s: float) -> list[Action]:
        """The coordinator has just said that it is ``mission_s``."""
        change_s = self._picture.hear_time(mission_s, now_s)
        if change_s is None:
            self._awake(now_s)
            return [Note("mission runs", {"mission_s": mission_s})]
        if abs(change_s) < _WORTH_TELLING_S:
            return []
        return [Note("mission clock corrected", {"by_s": change_s, "mission_s": mission_s})]

    def _learn_clock(self, told: Iterable[Snapshot], now_s: float) -> None:
        """The coordinator's word counts; else one odd clock among many must not set the time.

        The others may all have it of an odd one, so their word sets only what is not known.
        """
        known_s = {each.writer: each.mission_s for each in told if each.mission_s is not None}
        if not known_s or self._replica.epoch is None:
            return
        if (mission_s := known_s.get(COORDINATOR)) is not None:
            self._picture.hear_time(mission_s, now_s)
        elif not self._picture.knows_time:
            self._picture.hear_time(median_high(known_s.values()), now_s)

    # -- who is there -----------------------------------------------------------------

    def see(self, writer: str, now_s: float) -> list[Action]:
        """The token of ``writer`` is there."""
        if writer == self._uav or not self._peers.membership.seen(writer, now_s):
            return []
        return self._greet(writer, now_s)

    def miss(self, writer: str, now_s: float) -> None:
        """The token of ``writer`` has disappeared."""
        if writer != self._uav:
            self._peers.membership.gone(writer, now_s)

    def link(self, up: bool, now_s: float) -> list[Action]:
        """The own link came up or went down."""
        self._peers.membership.link(up, now_s)
        if not up or not self.learning.ever:
            return []
        self._catch_up(now_s)
        return self._announce(now_s)

    def held_up(self, now_s: float) -> list[Action]:
        """This process was stopped or starved; what the others did meanwhile is unread."""
        self._peers.membership.held_up(now_s)
        self._catch_up(now_s)
        return [Note("held up")]

    def lose(self, now_s: float) -> list[Action]:
        """Give up those who have been missing for long enough."""
        actions: list[Action] = []
        for writer, why in self._peers.lost(now_s):
            claim = self._replica.claims.get(writer)
            left = claim is not None and claim.phase is ClaimPhase.OUT
            actions.append(Note("left" if left else "lost", {"writer": writer, "why": why}))
            self._awake(now_s)
            self.learning.want(now_s)  # others may have heard its last words
            self._left_open = True
        return actions

    def _greet(self, writer: str, now_s: float) -> list[Action]:
        """Somebody is there anew: tell it the own registers, and hear what it may know."""
        actions, back = list[Action](), self._peers.back(writer)
        if back:
            actions.append(Note("back", {"writer": writer}))
        if self.learning.ever:
            actions += self._announce(now_s)
            if back or writer == COORDINATOR:
                self.learning.want(now_s)
        return actions

    def _announce(self, now_s: float) -> list[Action]:
        """Repeat the own registers; what an earlier life said is not this one's to repeat."""
        return [*self._speech.announce(now_s)] if self.at_work else []

    def _awake(self, now_s: float) -> None:
        """A task may have opened: everyone who is free decides anew, in sequence order."""
        self._peers.awake(now_s)
        self._tasking.wake(now_s)
