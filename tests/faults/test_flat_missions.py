"""Separated missions are flown alike, decided by the plain kernels or by those of the field."""

from __future__ import annotations

from dataclasses import replace
from functools import partial

import pytest

from agent.core.agent_core import AgentCore
from agent.core.field_decision import field_rule_of
from sim.bench.separation import dense_mission
from sim.faults.case import quick_plan
from sim.world.engine import Process
from sim.world.stochastic_world import StochasticWorld
from sim.world.uncertainty import Uncertainty
from swarm.allocation.field import FieldProblem
from swarm.protocol.messages import Message
from swarm.protocol.uav_messages import Claim, Outcome
from tests.support.seeds import seeds


class Overheard(StochasticWorld):
    """Keeps all that UAVs claim and have done."""

    def __init__(self, *args: object, **kwargs: object) -> None:
        self.heard: list[tuple[float, str, Message]] = []
        super().__init__(*args, **kwargs)  # type: ignore[arg-type]  # those of the world

    def said(self, process: Process, message: Message) -> None:
        if isinstance(message.body, Claim | Outcome):
            self.heard.append((self.world.queue.now_s(), process.name, message))
        super().said(process, message)


def flown(seed: int, loss: float, *, in_field: bool) -> Overheard:
    """One mission, decided by plain agents or by those of the field."""
    mission = replace(dense_mission(8, seed, 6.0), name="flat")
    plan = quick_plan(mission, "greedy", seed)
    fate = Uncertainty(loss=loss).draw(mission, max(plan.completion_s.values()), seed)
    make_agent = partial(AgentCore, make_field_rule=partial(field_rule_of)) if in_field else None
    world = Overheard(
        fate,
        lambda *_: plan,
        method="greedy",
        seed=seed,
        coordinator_lost_s=0.0,
        make_agent=make_agent or AgentCore,
    )
    assert world.run()
    return world


@pytest.mark.parametrize("loss", [0.0, 0.3])
@pytest.mark.parametrize("seed", seeds(2, 20))
def test_the_same_words_are_said_at_the_same_times(
    seed: int, loss: float, monkeypatch: pytest.MonkeyPatch
) -> None:
    in_field = flown(seed, loss, in_field=True)
    with monkeypatch.context() as patched:
        patched.setattr(FieldProblem, "from_mission", None)  # nobody makes tables
        plain = flown(seed, loss, in_field=False)

    assert len(plain.heard) > 40
    assert plain.heard == in_field.heard
    nearest_m = plain.world.closest_approach_m()
    assert nearest_m is not None
    assert nearest_m >= 6.0 - 1e-6
