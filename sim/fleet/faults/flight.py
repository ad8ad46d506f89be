"""A mission flown by real processes while faults are done to them, and the verdict on it.

Puts together a run (sim.fleet.run), relays on its links (sim.fleet.faults.relay), a recorder
(sim.fleet.faults.recorder) and the checks of its recording (sim.fleet.faults.checks).
"""

from __future__ import annotations

import contextlib
import re
from collections.abc import AsyncIterator, Callable, Collection
from dataclasses import dataclass

from sim.faults.message_log import MessageLog
from sim.fleet.faults.checks import (
    CompletedVisit,
    ProcessDown,
    Trouble,
    agreement_s,
    disagreements,
    message_logs,
    rivalries,
    visits,
)
from sim.fleet.faults.recorder import RECORDER, BusRecorder, recorder_seats
from sim.fleet.faults.relay import RelayNetwork
from sim.fleet.layout import LaunchOptions
from sim.fleet.run import Run, RunResult, open_run
from swarm.model import Mission
from swarm.protocol.messages import Message
from swarm.runtime.clock import SystemClock

CUT = "the network"
LEFT = "left its task"
TURN_LINE = re.compile(r'event="turns aside" .*\btask=(\S+)')
"""What an agent's log says when it leaves a task in flight for one that has opened."""
DONE_LINE = re.compile(r'event="task done".* task=(\S+)')


@dataclass(frozen=True, slots=True)
class ChaosVerdict:
    """What came of a flight under faults."""

    flight: RunResult
    faults: tuple[str, ...]
    """Invariants that did not hold, in words; none when all is well."""
    visits: tuple[CompletedVisit, ...]
    """Visits that ended done, as recorded; duplicates included."""
    messages: tuple[Message, ...]
    """What was said, as heard at the first seat."""
    agreement_s: float
    """Longest time from a healing to agreement on all claims [wall s]."""
    lines: tuple[tuple[str, str], ...]
    """Everything the processes have logged: name and line."""

    @property
    def duplicates(self) -> int:
        """Recorded visits to tasks that had been done."""
        return len(self.visits) - len({visit.task for visit in self.visits})


class ChaosFlight:
    """A flight to which faults are done; made by `open_chaos_flight`."""

    def __init__(
        self, run: Run, network: RelayNetwork, recorder: BusRecorder, lines: list[tuple[str, str]]
    ) -> None:
        self.run = run
        self.network = network
        self.recorder = recorder
        self.lines = lines
        """Everything the processes have logged so far: name and line."""
        self._clock = SystemClock()
        self._fates: list[ProcessDown] = []
        self._troubles: list[Trouble] = []
        self._begun_s: dict[str, float] = {}
        self._heard_all = True

    @property
    def done(self) -> int:
        """Tasks done so far, as far as the observer knows."""
        return len(self.run.mission_state.result().done)

    async def until(self, condition: Callable[[], bool], what: str, limit_s: float = 60.0) -> None:
        """Wait for ``condition``; see `Run.until`."""
        await self.run.until(condition, limit_s=limit_s, what=what)

    async def until_done(self, count: int) -> None:
        """Wait until so many tasks are done."""
        await self.until(lambda: self.done >= count, f"{count} tasks done")

    async def kill(self, name: str) -> None:
        """End a process at once."""
        self._heard_all &= name not in self.run.launch.layout.routers
        await self.run.launch.child(name).kill()
        self._silence(name)

    async def restart(self, name: str) -> None:
        """Start a killed process anew."""
        await self.run.launch.restart(name)
        self._end_trouble(name)

    def pause(self, name: str) -> None:
        """Let a process hang."""
        self._heard_all = False
        self.run.launch.child(name).pause()
        self._silence(name)

    def resume(self, name: str) -> None:
        """Let it go on."""
        self.run.launch.child(name).resume()
        self._end_trouble(name)

    def isolate(self, group: Collection[str]) -> None:
        """Cut ``group`` off; see `RelayNetwork.isolate`."""
        self._heard_all = False
        self._begun_s.setdefault(CUT, self._clock.now_s())
        self.network.isolate(group)

    def heal(self) -> None:
        """End all cuts."""
        self.network.heal()
        self._end_trouble(CUT)

    def _silence(self, name: str) -> None:
        self._fates.append(ProcessDown(self._clock.now_s(), name))
        self._begun_s[name] = self._clock.now_s()

    def _end_trouble(self, name: str) -> None:
        begun_s = self._begun_s.pop(name, self._clock.now_s())
        self._troubles.append(Trouble(begun_s, self._clock.now_s()))

    def verdict(self) -> ChaosVerdict:
        """Check everything; complete once all processes are gone."""
        flight = self.run.flight()
        entries = self.recorder.entries
        found = rivalries(entries, flight.mission_state.mission.name, self._fates)
        told = message_logs(entries)
        seen = visits(told)
        return ChaosVerdict(
            flight=flight,
            faults=(
                *self._broken_rules(told),
                *self._lost_outcomes(flight),
                *self._miscounted(flight, seen),
                *disagreements(found, self._troubles),
            ),
            visits=tuple(seen),
            messages=tuple(self.recorder.messages()),
            agreement_s=max((agreement_s(found, each) for each in self._troubles), default=0.0),
            lines=tuple(self.lines),
        )

    def _broken_rules(self, told: list[MessageLog]) -> set[str]:
        """Broken rules of the messages; who has not heard all knows not why a task was left.

        That a UAV turned aside for what had opened is sure to be in its log; its choice, which
        says so too, may be lost.
        """
        turned = {
            f"{who} left {m[1]} " for who, line in self.lines if (m := TURN_LINE.search(line))
        }
        broken = [each for message_log in told for each in message_log.broken]
        return {
            str(each)
            for each in broken
            if each.invariant != LEFT
            or (self._heard_all and not each.text.startswith(tuple(turned)))
        }

    def _lost_outcomes(self, flight: RunResult) -> list[str]:
        """Tasks a UAV says it has done, of which the fleet knows nothing in the end."""
        said = {(m[1], who) for who, line in self.lines if (m := DONE_LINE.search(line))}
        done = set(flight.result.done)
        return [f"{task} is lost, though {who} did it" for task, who in said if task not in done]

    def _miscounted(self, flight: RunResult, seen: list[CompletedVisit]) -> list[str]:
        recorded = len(seen) - len({visit.task for visit in seen})
        told = flight.result.duplicate_visits
        return [] if told >= recorded else [f"{recorded} duplicate visits, {told} in the report"]


@contextlib.asynccontextmanager
async def open_chaos_flight(
    mission: Mission, options: LaunchOptions, *, relayed: bool = False, seed: int = 0
) -> AsyncIterator[ChaosFlight]:
    """Start to fly ``mission``; do faults to it, then `ChaosFlight.run` ``.finish()``.

    With ``relayed`` there is a relay on every link, so that links can be degraded and cut;
    ``seed`` is of their chance.
    """
    lines: list[tuple[str, str]] = []
    async with contextlib.AsyncExitStack() as stack:
        network = await stack.enter_async_context(RelayNetwork(seed=seed))
        run = await stack.enter_async_context(
            open_run(
                mission,
                options,
                on_log=lambda name, line: lines.append((name, line)),
                through=network.through if relayed else None,
                observers=(RECORDER,),
            )
        )
        recorder = await stack.enter_async_context(
            BusRecorder(mission.name, recorder_seats(run.launch.layout), SystemClock())
        )
        yield ChaosFlight(run, network, recorder, lines)
