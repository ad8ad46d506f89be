"""Random losses and pop-ups for a mission, each from a stream of its own.

Streams are spawned from one seed, so that asking for losses does not change which
tasks pop up: policies can be compared in the same world. Leaves out: random
outcomes, speeds and messages.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from sim.world import Faults
from swarm.model import Mission

__all__ = ["Uncertainty"]


@dataclass(frozen=True, slots=True)
class Uncertainty:
    """How uncertain a mission is.

    Raises:
        ValueError: a probability is outside 0..1.
    """

    loss: float = 0.0
    """Probability that a UAV is lost, at a random moment of the mission."""
    popup: float = 0.0
    """Probability that a task known at the start appears during the mission instead."""

    def __post_init__(self) -> None:
        for name in ("loss", "popup"):
            if not 0.0 <= getattr(self, name) <= 1.0:
                raise ValueError(f"{name} must be within 0..1, not {getattr(self, name)}")

    def draw(self, mission: Mission, span_s: float, seed: int) -> tuple[Mission, Faults]:
        """One world: the mission with its pop-ups, and what gets lost when.

        Args:
            mission: as the scenario says.
            span_s: losses happen within this mission time, pop-ups within its first half [s].
            seed: of all streams.
        """
        losses, popups = (np.random.default_rng(s) for s in np.random.SeedSequence(seed).spawn(2))
        lost = losses.random(len(mission.uavs)) < self.loss
        lost_at_s = losses.uniform(0.0, span_s, len(mission.uavs))
        late = popups.random(len(mission.tasks)) < self.popup
        appears_s = popups.uniform(0.0, 0.5 * span_s, len(mission.tasks))
        tasks = tuple(
            replace(task, appears_s=float(when_s)) if pops and task.appears_s == 0.0 else task
            for task, pops, when_s in zip(mission.tasks, late, appears_s, strict=True)
        )
        faults = Faults(
            {
                uav.id: float(when_s)
                for uav, gone, when_s in zip(mission.uavs, lost, lost_at_s, strict=True)
                if gone
            }
        )
        return replace(mission, tasks=tasks), faults
