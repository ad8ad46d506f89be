"""An agent that died on its way to a task, and what its next life is told and does."""

from __future__ import annotations

from dataclasses import replace

from agent.core.interface import (
    Action,
    Prepare,
)
from swarm.protocol.events import (
    Publish,
)
from swarm.protocol.messages import Message, TaskEntry
from swarm.protocol.timing import Timing
from swarm.protocol.uav_messages import ClaimPhase, Status
from tests.support.builders import entry, held, uav
from tests.support.lone_agent import (
    LoneAgent,
)

NEAR, FAR = entry("near", east_m=10.0), entry("far", east_m=20.0, number=1)
PREPARE = Prepare((0.0, 0.0, 10.0), 1.0, ground_up_m=0.0)
RESUME = replace(PREPARE, resume=True)
LEFT = replace(RESUME, left_in_air=True)
"""What is ordered of a vehicle that an earlier life had in the air."""
HELD = held("near", 0.0, 0, 10.0)
AT_ONCE = Timing(announce_s=2.0, silence_s=5.0, pause_s=1e6)
"""Timers as they are, but for a process that never hangs."""


def crashed(
    *tasks: TaskEntry, others: int = 0, at_s: float = 4.0, timing: Timing | None = None
) -> LoneAgent:
    """The earlier life of ``u0``, on its way to the first of ``tasks`` when it died."""
    uavs = [uav(f"u{n}") for n in range(others + 1)]
    agent = LoneAgent(*uavs) if timing is None else LoneAgent(*uavs, timing=timing)
    agent.fly_to(*(tasks or (NEAR, FAR)))
    agent.start_mission()
    agent.run_until(at_s)
    assert (agent.task, agent.phase) == ("near", ClaimPhase.HELD)
    return agent


def registers(actions: list[Action]) -> list[Message]:
    """What was published, but for status."""
    published = [action.message for action in actions if isinstance(action, Publish)]
    return [message for message in published if not isinstance(message.body, Status)]
