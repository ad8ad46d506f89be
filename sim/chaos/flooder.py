"""A process with valid keys that floods the bus: ``python -m sim.chaos.flooder``, told by `Orders`.

Half of what it says is on its own keys, about itself and freshly signed; half is on others',
by every `Trick`. Besides, it asks everybody again and again. It says nothing of its own that
would be a reason to fly otherwise: what it floods with is meant to cost time and memory.
Leaves out: what others make of it (sim.chaos.insider_flood).
"""

from __future__ import annotations

import asyncio
import contextlib
import json
import sys
from collections import Counter
from collections.abc import Iterator
from dataclasses import asdict, dataclass
from pathlib import Path

import numpy as np

from sim.chaos.insider import Insider
from swarm.bus.config import BusConfig, ClientTopology
from swarm.bus.port import Bus, Sample
from swarm.bus.zenoh_bus import open_zenoh_bus
from swarm.clock import SystemClock
from swarm.identity import load_identity
from swarm.process import leave
from swarm.wire.codec import encode
from swarm.wire.keys import Keys
from swarm.wire.messages import Claim, ClaimPhase, Message, Outcome, Result, Stamp
from swarm.wire.question import encode_question
from swarm.wire.seal import Seal

__all__ = ["Orders", "Sent", "main"]

READY = "ready"
TURN_S = 0.01
KEPT = 4000
"""Statements signed beforehand: nobody signs as fast as it floods."""
ANSWER_S = 0.5


@dataclass(frozen=True, slots=True)
class Orders:
    """What it is told, as JSON."""

    keys: str
    """Its folder."""
    routers: tuple[str, ...]
    mission: str
    others: tuple[str, ...]
    tasks: tuple[str, ...]
    rate_hz: float
    questions_hz: float
    seed: int


@dataclass(frozen=True, slots=True)
class Sent:
    """What it has done, as JSON."""

    own: int
    """Messages on its own keys."""
    others: int
    """Messages on others' keys."""
    unsent: int
    """Messages of both that never left its own process."""
    questions: int
    answers: int
    seconds: float

    @property
    def rate_hz(self) -> float:
        """Messages that left it per second."""
        return (self.own + self.others - self.unsent) / max(self.seconds, 1e-9)


def main(words: list[str]) -> int:
    """Flood until standard input ends; one JSON line when ready, and one at the end."""
    told = json.loads(words[0])
    orders = Orders(
        **{**told, **{name: tuple(told[name]) for name in ("routers", "others", "tasks")}}
    )
    _tell(json.dumps(asdict(asyncio.run(_work(orders)))))
    return 0


async def _work(orders: Orders) -> Sent:
    identity = load_identity(Path(orders.keys))
    config = BusConfig(ClientTopology(orders.routers), identity=identity)
    bus = await open_zenoh_bus(config)
    if bus.seal is None:
        raise ValueError("there is no seal without keys")
    try:
        flooder = _Flooder(bus, bus.seal, orders)
        _tell(READY)
        loop = asyncio.get_running_loop()
        told = loop.run_in_executor(None, sys.stdin.readline)
        await told  # how to begin
        over = loop.run_in_executor(None, sys.stdin.read)
        sent = await flooder.flood_until(over)
        return Sent(**{**asdict(sent), "unsent": bus.unsent})
    finally:
        bus.close()


def _tell(line: str) -> None:
    sys.stdout.write(f"{line}\n")
    sys.stdout.flush()


class _Flooder:
    def __init__(self, bus: Bus, seal: Seal, orders: Orders) -> None:
        self._bus = bus
        self._seal = seal
        self._orders = orders
        self._keys = Keys(orders.mission)
        rng = np.random.default_rng(orders.seed)
        self._insider = Insider(orders.mission, seal, orders.others, orders.tasks, rng)
        self._own = self._about_itself()
        self._lies = [self._insider.lie() for _ in range(KEPT // 10)]
        self._count: Counter[str] = Counter()
        self._questions: set[asyncio.Task[None]] = set()
        bus.subscribe(f"{self._keys.root}/**")
        bus.declare_token(self._keys.alive(seal.name))

    async def flood_until(self, over: asyncio.Future[str]) -> Sent:
        clock, orders = SystemClock(), self._orders
        begin_s = clock.now_s()
        said = asked = 0
        while not over.done():
            now_s = clock.now_s() - begin_s
            while said < orders.rate_hz * now_s:
                self._say(said)
                said += 1
            while asked < orders.questions_hz * now_s:
                self._ask()
                asked += 1
            self._overhear()
            await asyncio.sleep(TURN_S)
        seconds = clock.now_s() - begin_s
        for task in self._questions:
            task.cancel()
        await asyncio.gather(*self._questions, return_exceptions=True)
        count = self._count
        return Sent(count["own"], count["others"], 0, asked, count["answers"], seconds)

    def _say(self, number: int) -> None:
        if number % 2:
            lie = self._lies[number // 2 % len(self._lies)]
            self._bus.publish(lie.key, lie.payload)
            self._count["others"] += 1
        else:
            key, payload = self._own[number // 2 % KEPT]
            self._bus.publish(key, payload)
            self._count["own"] += 1

    def _overhear(self) -> None:
        """Record what the others say and have some of it among the lies."""
        heard = [event for event in self._bus.inbox.take() if isinstance(event, Sample)]
        for event in heard[-20:]:
            self._insider.overhear(event.key, event.payload)
        for place in range(0, len(self._lies), 40):
            self._lies[place] = self._insider.lie()

    def _ask(self) -> None:
        task = asyncio.get_running_loop().create_task(self._question())
        self._questions.add(task)
        task.add_done_callback(self._questions.discard)

    async def _question(self) -> None:
        number = self._count["asked"] = self._count["asked"] + 1
        question = encode_question({}, number.to_bytes(16, "big"), self._seal)
        with contextlib.suppress(asyncio.CancelledError):
            answers = await self._bus.query(self._keys.state("*"), question, timeout_s=ANSWER_S)
            self._count["answers"] += len(answers)

    def _about_itself(self) -> list[tuple[str, bytes]]:
        """Outcomes of tasks that there are not, and a claim that never stays the same."""
        return [(said.key, self._seal.wrap(encode(said))) for said in self._statements()]

    def _statements(self) -> Iterator[Message]:
        for number in range(KEPT):
            stamp = Stamp(1, number + 1)
            claim = Claim(ClaimPhase.OUT, None, float(number), 0, 0.0)
            outcome = Outcome(f"nowhere-{number}", Result.DONE, 1, 1.0)
            body = outcome if number % 2 else claim
            yield Message(self._orders.mission, self._seal.name, stamp, body)


if __name__ == "__main__":
    leave(main(sys.argv[1:]))
