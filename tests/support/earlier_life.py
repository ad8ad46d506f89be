"""What an earlier life of the coordinator has left behind: with the agents, and in its memory."""

from __future__ import annotations

from collections.abc import Iterable

from coordinator.core.publication import mission_config_of, task_entry_of
from swarm.model import Mission
from swarm.model.ids import COORDINATOR
from swarm.protocol.messages import Body, Message, PlanEpoch, Snapshot
from tests.support.builders import MISSION, epoch, held, message, mission, task, uav
from tests.support.lone_coordinator import LAYERS, LoneCoordinator

U0, U1 = uav("u0"), uav("u1")
T0, T1 = task("t0", 5.0), task("t1", 9.0)
POPUP = task("popup", 7.0, appears_s=30.0)
FLOWN = mission([U0, U1], [T0, T1, POPUP])
OLD_LIFE, RUN = 500, 400
EXTRA = task_entry_of(task("extra", 3.0), 9)
"""Posted by an operator: no scenario knows it."""


def registers(*more: Body, flown: Mission = FLOWN, life: int = OLD_LIFE) -> list[Message]:
    """What an earlier life of the coordinator has said: brief, two tasks, ``more``."""
    posted = [task_entry_of(t, n) for n, t in enumerate(flown.tasks) if t.appears_s == 0.0]
    bodies = [mission_config_of(flown, LAYERS, RUN), *posted, *more]
    return [message(COORDINATOR, body, n, life) for n, body in enumerate(bodies, 1)]


def running(mission_s: float = 0.0, number: int = 3) -> PlanEpoch:
    return epoch("u1", "u0", number=number, mission_s=mission_s)


def answer(
    messages: Iterable[Message], mission_s: float | None = None, uav_: str = "u0"
) -> Snapshot:
    """An agent's answer: what it remembers of the coordinator, and its own claim."""
    claim = message(uav_, held("t0", 1.0), 8)
    return Snapshot(MISSION, uav_, 7, mission_s, (*messages, claim))


def memory(*more: Body, mission_s: float | None = None) -> Snapshot:
    """What the earlier life had kept."""
    return Snapshot(MISSION, COORDINATOR, OLD_LIFE, mission_s, tuple(registers(*more)))


def resumed(mission_s: float = 20.0, *more: Body, flown: Mission = FLOWN) -> LoneCoordinator:
    """A new life that learns of the running mission from an agent."""
    known = registers(running(mission_s - 1.0), *more)
    return LoneCoordinator(flown, answers=[answer(known, mission_s)], incarnation=600)


def twin(incarnation: int, *messages: Message, mission_s: float | None = None) -> Snapshot:
    return Snapshot(MISSION, COORDINATOR, incarnation, mission_s, messages)
