"""The asyncio shell that all processes on the bus share: it runs one pure core.

It decodes what the bus brings, steps the core, publishes what the core says, answers queries with
the core's snapshot and ticks at the core's deadlines. On a bus with keys it says and believes only
what is signed, and puts newer rosters in force. Actions that only one kind of process knows
it leaves to ``execute``.
"""

from __future__ import annotations

import asyncio
import math
from collections import deque
from collections.abc import Callable, Collection, Iterable, Mapping, Sequence
from functools import partial
from typing import Generic, Protocol, TypeVar

from swarm import __version__
from swarm.bus.admission import AdmissionControl
from swarm.bus.port import Bus, BusEvent, LinkDown, LinkUp, Query, Sample, TokenGone, TokenSeen
from swarm.protocol.codec import Codec
from swarm.protocol.events import (
    Ask,
    Cell,
    CommonEvent,
    Finish,
    KeysReplaced,
    LinkChanged,
    LogLine,
    MessageReceived,
    MessagesReceived,
    PeerGone,
    PeerSeen,
    Publish,
    PublishLast,
    Save,
    SnapshotsReceived,
    Stop,
    Tick,
    TuneIn,
)
from swarm.protocol.key_space import KeySpace
from swarm.protocol.messages import (
    Message,
    MissionConfig,
    SignedRoster,
    Snapshot,
    Stamp,
    roster_message,
)
from swarm.protocol.timing import PRESETS, UNSTRETCHED_UAVS, LinkKind
from swarm.protocol.uav_messages import News
from swarm.runtime.clock import Clock, elapsed_s
from swarm.runtime.drop_count import DropCount
from swarm.runtime.joining import gathered_keys
from swarm.runtime.log import get_logger
from swarm.runtime.state_exchange import StateExchange, draw_nonce
from swarm.runtime.turns import Alarm, SharedProcess

TURN = 20
"""Events from the bus between two looks at everything else."""
GATHER_S = 0.1
"""In a large fleet: wall time between two looks at what has come of claims, outcomes and board.
With the time that a router collects them, less than claims may be contested on any network."""
GATHER_SETTLED_S = 0.5
"""The same while nothing follows from them at once."""

E_contra = TypeVar("E_contra", contravariant=True)
A_co = TypeVar("A_co", covariant=True)
E = TypeVar("E")
A = TypeVar("A")


class Core(Protocol[E_contra, A_co]):
    """What a shell asks of a core."""

    def start(self, now_s: float) -> Sequence[A_co]:
        """What to do first."""

    def step(self, event: E_contra, now_s: float) -> Sequence[A_co]:
        """React to one event."""

    def next_deadline_s(self) -> float | None:
        """When the core wants a tick at the latest."""


class Shell(Generic[E, A]):
    """Runs one core on one bus until it finishes.

    Args:
        core: decides.
        bus: open; closed by whoever opened it.
        clock: gives ``now_s``.
        mission: mission name.
        name: writer id of this process.
        from_bus: makes the core's event of a fact from the bus.
        execute: carries out an action that is not common to all processes.
        snapshot: answers a query; None for a process that answers none.
        whole: answers one who wants all that is known; by default as ``snapshot``.
        known: digest of the registers the core knows; answers to it leave those out, and
            its own answers what the asker knows.
        register: of what the core knows, the statement on a key; None where there is none.
        left_out: how many registers the core has had no room for so far.
        save: keeps the core's memory, given ``now_s``; None to keep nothing.
        answer_s: how long a question waits for the slowest answer [wall s].
        context: what every note of the core is logged with, besides its own fields.
        draw_nonce: makes the nonce of a question, see swarm.protocol.sync.
        together: makes the core's event of several messages that came one after the other. With
            it the shell of a large fleet is not woken by each claim, outcome, task of the
            board and word of somebody near: it looks now and then, and before it decides anything
            by itself. None for a core that wants to hear each when it comes.
        settled: whether nothing would follow at once from what others claim.
        pressing_s: see `Alarm`; by default nothing can wait.
        runs_since: in a large fleet of which it shares a process, is told before each step since
            when that has run without a stop; what came on the bus meanwhile has been heard.
        crowd: see `StateExchange`.
        shared: what it has in common with others in this process; None for one that is alone there.
    """

    def __init__(
        self,
        core: Core[E, A],
        bus: Bus,
        clock: Clock,
        *,
        mission: str,
        name: str,
        from_bus: Callable[[CommonEvent], E],
        execute: Callable[[A], None],
        snapshot: Callable[[float], Snapshot] | None,
        whole: Callable[[float], Snapshot] | None = None,
        known: Callable[[], Mapping[str, int]] = dict,
        register: Callable[[str], Message | None] = lambda _: None,
        left_out: Callable[[], int] = int,
        save: Callable[[float], None] | None = None,
        answer_s: float = PRESETS[LinkKind.NORMAL].answer_s,
        context: Callable[[], Mapping[str, object]] = dict,
        draw_nonce: Callable[[], bytes] = draw_nonce,
        together: Callable[[MessagesReceived], E] | None = None,
        settled: Callable[[], bool] = lambda: True,
        pressing_s: Callable[[], float | None] = lambda: -math.inf,
        runs_since: Callable[[float], None] = lambda _: None,
        crowd: Callable[[Collection[str]], Sequence[str]] | None = None,
        shared: SharedProcess | None = None,
    ) -> None:
        self._core = core
        self._bus = bus
        self._clock = clock
        self._mission = mission
        self._keys = KeySpace(mission)
        self._seal = bus.seal
        self._codec = Codec(mission, bus.seal, None if shared is None else shared.messages)
        admission = self._admission = AdmissionControl(self._keys, bus.seal, clock.now_s)
        bus.inbox.admits = admission.admits
        self._log = get_logger(name, mission=mission)
        self._questions = StateExchange(
            bus,
            clock,
            self._codec,
            mission=mission,
            name=name,
            snapshot=snapshot,
            whole=whole,
            known=known,
            answer_s=answer_s,
            draw_nonce=draw_nonce,
            crowd=crowd,
        )
        self._from_bus = from_bus
        self._execute = execute
        self._register = register
        self._drops = DropCount(bus.inbox, admission, left_out, self._codec.dropped, self._log)
        self._save = save
        self._context = context
        self._loop = asyncio.get_running_loop()
        self._done: asyncio.Future[int] = self._loop.create_future()
        self._asking: set[asyncio.Task[None]] = set()
        self._together = together
        self._settled = settled
        self._turns = None if shared is None else shared.turns
        self._runs_since = runs_since
        self._alarm = Alarm(clock, self._turns, pressing_s, self._look)
        self._put_off: E | None = None
        """What the core is to hear when it has its turn."""
        self._gathering: asyncio.TimerHandle | None = None
        """Rings when it is time to look; None in small fleets."""
        self._gathered_s = 0.0
        """When it looked last, in the loop's time."""
        self._unread: deque[BusEvent] = deque()
        self._heard: list[Message] = []
        """What the core is still to hear of what was read."""
        self._events: deque[E] = deque()
        self._busy = False
        self._told_newer: set[str] = set()
        self._cells: frozenset[Cell] = frozenset()
        """Of the sky, whose traffic is heard."""
        self._briefed: Stamp | None = None
        """Of the newest brief that was heard."""

    @property
    def dropped(self) -> Mapping[str, int]:
        """Messages dropped so far, by reason."""
        self._drops.take()
        return self._codec.dropped

    async def run(self) -> int:
        """Run the core to its end; its exit status."""
        reader = self._loop.create_task(self._hear())
        reader.add_done_callback(self._fail)
        try:
            self._guard(self._start)
            return await self._done
        finally:
            tasks = [reader, *self._asking]
            for task in tasks:
                task.cancel()
            await asyncio.gather(*tasks, return_exceptions=True)
            self._alarm.ring_at(None)
            if self._gathering is not None:
                self._gathering.cancel()

    def step(self, event: E) -> None:
        """Step the core and carry out what it wants; call from the loop's thread.

        An event that comes up while another is being dealt with follows it.
        """
        put_off, self._put_off = self._put_off, None
        if put_off is not None:
            self._events.append(put_off)
        self._step(event)

    def _step(self, event: E) -> None:
        self._events.append(event)
        if not self._busy:
            self._guard(self._step_all)

    def _step_all(self) -> None:
        if self._turns is not None and self._gathering is not None:
            self._runs_since(self._turns.runs_since_s(self._clock))
        while self._events and not self._done.done():
            for action in self._core.step(self._events.popleft(), self._clock.now_s()):
                self._carry_out(action)

    def suit_fleet(self, n_uav: int) -> None:
        """From now on hear as suits a fleet of that size; call from the loop's thread."""
        if self._together is not None and self._gathering is None and n_uav > UNSTRETCHED_UAVS:
            for key_expr in gathered_keys(self._keys):
                self._bus.subscribe(key_expr, latest=True, gathered=True)
            self._gathering = self._loop.call_later(GATHER_S, self._gather)
            for cell in self._cells:
                self._hear_near(cell)

    def gather(self) -> None:
        """Let the core hear now what has come; call before something that it may decide by."""
        if self._gathering is not None and not self._done.done():
            self._gathered_s = self._loop.time()
            self._bus.gather()
            self._unread.extend(self._bus.inbox.take())
            self._read(len(self._unread))

    def fail(self, fault: BaseException) -> None:
        """End `run` with ``fault``."""
        if not self._done.done():
            self._done.set_exception(fault)

    def _start(self) -> None:
        self._log.info("begins", release=__version__)
        for action in self._core.start(self._clock.now_s()):
            self._carry_out(action)
        if self._seal is not None:  # what is in its folder is as if it had been heard
            roster, signed = self._seal.roster, self._seal.signed_roster
            said = roster_message(self._mission, roster.version, signed)
            self._events.append(self._from_bus(MessageReceived(said)))
        self._step_all()

    def _heed(self, messages: Iterable[Message], *, answers: bool = False) -> None:
        """Put a newer roster in force; who told an older one is told the newer."""
        seal, told = self._seal, False
        if seal is None:
            return
        for message in messages:
            if not isinstance(message.body, SignedRoster):
                continue
            behind = message.stamp.incarnation < seal.roster.version
            if behind and answers and not told and seal.may_publish_roster:
                newest = seal.roster.version, seal.signed_roster
                self._publish(roster_message(self._mission, *newest))
                told = True  # once, however often the answer repeats an old one
            before = seal.roster
            try:
                news = seal.put_in_force(message.body.signed)
            except OSError as fault:
                news, reason = True, fault.strerror or str(fault)
                self._log.warning(
                    "cannot keep the newer roster", reason=reason, file=fault.filename
                )
            if not news:
                continue
            replaced = seal.roster.replaced_since(before)
            gone = [name for name in sorted(replaced) if seal.roster.entry(name) is None]
            self._log.info(
                "newer roster in force", version=seal.roster.version, without=", ".join(gone)
            )
            if replaced:
                self.step(self._from_bus(KeysReplaced(replaced)))
            for name in gone:  # a token cannot be signed: it counts no longer
                self.step(self._from_bus(PeerGone(name)))
            if not seal.is_in_force:  # nobody believes it any more, so it takes no further part
                self.step(self._from_bus(Stop("its keys were revoked or replaced", believed=False)))

    def _guard(self, act: Callable[[], None]) -> None:
        """Act and reschedule; a bug ends the process rather than half of it."""
        self._busy = True
        try:
            act()
            self._reschedule()
        except Exception as fault:  # noqa: BLE001 - top of the process: run() raises it
            self.fail(fault)
        finally:
            self._busy = False

    def _carry_out(self, action: A) -> None:
        match action:
            case Publish(message):
                self._publish(message, action.keys)
            case PublishLast(make):
                self._publish(make())
            case Ask(of):
                task = self._loop.create_task(self._ask(of))
                self._asking.add(task)
                task.add_done_callback(self._asking.discard)
                task.add_done_callback(self._fail)
            case Save():
                if self._save is not None:
                    self._save(self._clock.now_s())
            case TuneIn(cells):
                self._tune_in(cells)
            case LogLine(text, fields):
                self._log.info(text, **{**self._context(), **fields})
            case Finish(status):
                if not self._done.done():
                    self._done.set_result(status)
            case _:
                self._execute(action)

    def _publish(self, message: Message, keys: Sequence[str] | None = None) -> None:
        reliable = not isinstance(message.body, News)
        packed = self._codec.pack(message)
        if packed is not None:
            for key in (message.key,) if keys is None else keys:
                self._bus.publish(key, packed, reliable=reliable)

    def _tune_in(self, cells: frozenset[Cell]) -> None:
        """Hear what is said in these cells, of each UAV the newest, and in no others."""
        for cell in sorted(cells - self._cells):
            self._hear_near(cell)
        for east, north in sorted(self._cells - cells):
            self._bus.unsubscribe(self._keys.near("*", east, north))
        self._cells = cells

    def _hear_near(self, cell: Cell) -> None:
        key_expr = self._keys.near("*", *cell)
        self._bus.subscribe(key_expr, latest=True, gathered=self._gathering is not None)

    def _reschedule(self) -> None:
        self._alarm.ring_at(None if self._done.done() else self._core.next_deadline_s())

    def step_in_turn(self, event: E) -> None:
        """Step the core with ``event`` and what is due, once others in this process had their turn.

        At once if that presses, and before whatever it is stepped with next but words of others.
        Of several events that wait for their turn it hears the last; call from the loop's thread.
        """
        self._put_off = event
        self._alarm.ring()

    def _look(self) -> None:
        """Hear what has come, then what was put off, or see to what is due."""
        if self._done.done():
            return
        self.gather()
        put_off, self._put_off = self._put_off, None
        if put_off is not None:
            self._step(put_off)
        elif self.is_due:
            self._step(self._from_bus(Tick()))
        else:  # what was gathered has seen to it, or the timer was early
            self._guard(lambda: None)

    @property
    def is_due(self) -> bool:
        """Whether the core wants a tick by now."""
        deadline_s = self._core.next_deadline_s()
        return deadline_s is not None and deadline_s <= self._clock.now_s()

    def _gather(self) -> None:
        """Take what has come into the inbox, if that was not done since, and look again later."""
        now_s, wait_s = self._loop.time(), GATHER_SETTLED_S if self._settled() else GATHER_S
        if self._gathered_s + wait_s <= now_s:
            self._gathered_s = now_s
            self._bus.gather()
        self._gathering = self._loop.call_at(self._gathered_s + wait_s, self._gather)

    def _fail(self, task: asyncio.Task[None]) -> None:
        if not task.cancelled() and (fault := task.exception()):
            self.fail(fault)

    async def _hear(self) -> None:
        while True:
            await self._bus.inbox.wait()
            self._unread.extend(self._bus.inbox.take())
            if not self._unread:  # it was gathered meanwhile
                continue
            if self._turns is not None:
                await self._turns.mine()
            self._drops.take()
            while self._unread:
                self._read(TURN)
                if self._unread:  # the vehicle must not wait for a flood of words
                    await asyncio.sleep(0)

    def _arrived_s(self, sample: Sample) -> float:
        """When it came, in the core's time; dozens of others of this process may have heard it."""
        ago_s = 0.0 if sample.arrived_s is None else self._loop.time() - sample.arrived_s
        return self._clock.now_s() - elapsed_s(self._clock, max(0.0, ago_s))

    def _read(self, most: int) -> None:
        """Let the core hear the oldest that it has not, so many at most."""
        for _ in range(min(most, len(self._unread))):
            event = self._unread.popleft()
            if isinstance(event, Sample):
                message = self._message(event)
                if message is not None and self._gathering is None:
                    self.step(self._from_bus(MessageReceived(message, self._arrived_s(event))))
                elif message is not None:
                    self._heard.append(message)
                    if event.key == self._keys.plan:  # by which the time of the mission is known
                        self._tell_heard(self._arrived_s(event))
            elif (fact := self._fact(event)) is not None:
                self._tell_heard()
                self.step(self._from_bus(fact))
        self._tell_heard()

    def _tell_heard(self, last_arrived_s: float | None = None) -> None:
        if self._heard and self._together is not None:
            heard, self._heard = self._heard, []
            self._step(self._together(MessagesReceived(tuple(heard), last_arrived_s)))

    def _tell_newer(self) -> None:
        """Tell people once of each kind: it is no fault to be of another release."""
        for kind in self._codec.newer - self._told_newer:
            self._told_newer.add(kind)
            self._log.info("a newer release says more than this one understands", kind=kind)

    def _message(self, sample: Sample) -> Message | None:
        """What was said, if it is to be believed."""
        known = self._register(self._keys.register_of(sample.key))
        message = self._codec.decode(sample.key, sample.payload, known)
        if message is None:
            return None
        self._tell_newer()
        if isinstance(message.body, SignedRoster):
            self._tell_heard()  # what came before was said before
            self._heed([message])
        elif isinstance(message.body, MissionConfig):
            self._expect([message])
        return message

    def _fact(self, event: BusEvent) -> CommonEvent | None:
        match event:
            case TokenSeen(key) if (writer := self._keys.writer_of_token(key)) is not None:
                self._questions.there.add(writer)
                return PeerSeen(writer)
            case TokenGone(key):
                writer = self._keys.writer_of_token(key)
                self._questions.there.discard(writer or "")
                return None if writer is None else PeerGone(writer)
            case LinkUp():
                return LinkChanged(True)
            case LinkDown():
                return LinkChanged(False)
            case Query(reply=reply, payload=payload):
                self._questions.answer(reply, payload)
        return None

    def _expect(self, messages: Iterable[Message]) -> None:
        """Let no made-up names shut out whom a brief names."""
        for message in messages:
            body, stamp = message.body, message.stamp
            if isinstance(body, MissionConfig) and (self._briefed is None or stamp > self._briefed):
                self._briefed = stamp
                self._admission.fleet = frozenset(uav.id for uav in body.uavs)
                self.suit_fleet(len(body.uavs))

    async def _ask(self, of: Sequence[str]) -> None:
        heed = partial(self._heed, answers=True)
        learned = await self._questions.ask(heed, of)
        self._expect(message for snapshot in learned for message in snapshot.messages)
        self.step(self._from_bus(SnapshotsReceived(learned)))
