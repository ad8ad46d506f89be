"""A mission that one process acts out on the bus: all that a fleet would say, and nobody flies."""

from __future__ import annotations

import asyncio
from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np

from coordinator.core.publication import mission_config_of, task_entry_of
from swarm.bus.port import Bus
from swarm.model import Mission, UavId
from swarm.model.ids import COORDINATOR
from swarm.model.layers import FlightLayers
from swarm.protocol.encoding import encode
from swarm.protocol.key_space import KeySpace
from swarm.protocol.messages import Body, MissionPhase, PlanEpoch
from swarm.protocol.register_writer import RegisterWriter
from swarm.protocol.timing import Timing
from swarm.protocol.uav_messages import (
    MAX_CANDIDATES,
    AttemptResult,
    Candidate,
    Choice,
    ChoiceBasis,
    Claim,
    ClaimPhase,
    Outcome,
    Status,
    StatusPhase,
)
from swarm.runtime.clock import Clock

MARK = "mark "
"""Begins the note in each status of the first UAV; a number follows."""
SERVED_S = 20.0
"""How long a UAV flies to each task, about."""
_SPEED_M_S = 10.0
_INCARNATION = 1


@dataclass(slots=True)
class _Actor:
    """One UAV."""

    id: UavId
    register_writer: RegisterWriter
    tasks: list[str]
    """Its list, what it has done left out."""
    place_m: list[float]
    until_s: float
    claim: Claim | None = None
    outcome: Outcome | None = None
    choices: int = 0


class ScriptedMission:
    """All that is said of one mission, by one seat on the bus.

    Mission time begins with the first word. Every UAV says ``rate_hz`` statuses per second.
    """

    def __init__(self, mission: Mission, bus: Bus, clock: Clock, rate_hz: float, seed: int) -> None:
        self.marked_s: list[float] = []
        """When each mark was said [s of the clock]."""
        self.said = 0
        """Messages so far."""
        self._mission = mission
        self._bus = bus
        self._clock = clock
        self._zero_s = clock.now_s()
        self._rate_hz = rate_hz
        self._rng = np.random.default_rng(seed)
        self._coordinator = RegisterWriter(mission.name, COORDINATOR, _INCARNATION)
        tasks = [str(task.id) for task in mission.tasks]
        n_uav = len(mission.uavs)
        self._actors = [
            _Actor(
                uav.id,
                RegisterWriter(mission.name, uav.id, _INCARNATION),
                tasks[number::n_uav],
                list(uav.position_enu_m),
                float(self._rng.uniform(0.0, SERVED_S)),
            )
            for number, uav in enumerate(mission.uavs)
        ]
        routes = {str(actor.id): tuple(actor.tasks) for actor in self._actors}
        self._epoch = PlanEpoch(
            1, MissionPhase.RUNNING, "guided", tuple(routes), 0.0, "acted", routes
        )

    def appear(self) -> None:
        """Show everyone's token."""
        keys = KeySpace(self._mission.name)
        for name in (COORDINATOR, *(uav.id for uav in self._mission.uavs)):
            self._bus.declare_token(keys.alive(name))

    def begin(self) -> None:
        """Say what the coordinator says; again and again, as whoever joins late has missed it."""
        mission = self._mission
        bodies: list[Body] = [mission_config_of(mission, FlightLayers(), 1)]
        bodies += [task_entry_of(task, number) for number, task in enumerate(mission.tasks)]
        bodies.append(replace(self._epoch, mission_s=self._now_s()))
        for body in bodies:
            self._say(self._coordinator, body)

    async def run(self) -> None:
        """Say what the fleet says, until cancelled; nobody's turn is the same as another's."""
        announce_s = Timing().announce_s
        loop = asyncio.get_running_loop()
        turns = len(self._actors)
        pause_s = 1.0 / (self._rate_hz * turns)
        begin_s, number = loop.time(), 0
        said_s = {actor.id: -announce_s for actor in self._actors}
        while True:
            actor = self._actors[number % turns]
            self._act(actor)
            if self._now_s() - said_s[actor.id] >= announce_s:
                said_s[actor.id] = self._now_s()
                for body in (actor.claim, actor.outcome):
                    if body is not None:
                        self._say(actor.register_writer, body)
            number += 1
            await asyncio.sleep(max(0.0, begin_s + number * pause_s - loop.time()))

    def _act(self, actor: _Actor) -> None:
        now_s = self._now_s()
        if actor.until_s <= now_s:
            for body in self._next_task(actor, now_s):
                self._say(actor.register_writer, body)
        for axis in (0, 1):
            actor.place_m[axis] += float(self._rng.normal(0.0, _SPEED_M_S / self._rate_hz))
        note = ""
        if actor is self._actors[0]:
            note = f"{MARK}{len(self.marked_s)}"
            self.marked_s.append(self._clock.now_s())
        east_m, north_m, up_m = actor.place_m
        status = Status(
            phase=StatusPhase.FLYING,
            task=None if actor.claim is None else actor.claim.task,
            position_enu_m=(east_m, north_m, up_m),
            velocity_enu_m_s=(_SPEED_M_S, 0.1 * now_s % 1.0, 0.0),
            battery_frac=max(0.0, 1.0 - now_s / 1800.0),
            mission_s=now_s,
            dropped={},
            note=note,
        )
        self._say(actor.register_writer, status)

    def _next_task(self, actor: _Actor, now_s: float) -> Iterator[Body]:
        if actor.claim is not None and actor.claim.task is not None:
            actor.outcome = Outcome(actor.claim.task, AttemptResult.DONE, 1, now_s)
            yield actor.outcome
        actor.until_s = now_s + float(self._rng.uniform(0.5, 1.5)) * SERVED_S
        if not actor.tasks:
            actor.claim = Claim(ClaimPhase.IDLE, None, now_s, 0, now_s)
            yield actor.claim
            return
        task, others = actor.tasks.pop(0), actor.tasks[: MAX_CANDIDATES - 1]
        proposed = Claim(ClaimPhase.PROPOSED, task, now_s, 0, actor.until_s)
        actor.claim = replace(proposed, phase=ClaimPhase.HELD)
        actor.choices += 1
        yield proposed
        yield actor.claim
        yield Choice(
            number=actor.choices,
            task=task,
            left=None,
            chosen_s=now_s,
            epoch=1,
            rule="guided",
            rank=0,
            score=9.0,
            second_score=8.0,
            certificate=False,
            completion_s=actor.until_s,
            candidates=tuple(Candidate(each, 9.0) for each in (task, *others)),
            basis=self._basis(actor, now_s),
        )

    def _basis(self, actor: _Actor, now_s: float) -> ChoiceBasis:
        names = tuple(str(each.id) for each in self._actors)
        east_m, north_m, up_m = actor.place_m
        heads = dict.fromkeys(names[:50], (_INCARNATION, 1))
        return ChoiceBasis(now_s, (east_m, north_m, up_m), 1.0, names[:50], (), (), heads, 1)

    def _say(self, register_writer: RegisterWriter, body: Body) -> None:
        message = register_writer.say(body)
        self._bus.publish(message.key, encode(message), reliable=not isinstance(body, Status))
        self.said += 1

    def _now_s(self) -> float:
        return self._clock.now_s() - self._zero_s
