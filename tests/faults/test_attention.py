"""What an agent only remembers of the words of others would have changed nothing it does."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from agent.core.attention import Attention
from sim.world.engine import Process
from sim.world.stochastic_world import StochasticWorld
from sim.world.uncertainty import Uncertainty
from swarm.protocol.messages import Message
from swarm.protocol.uav_messages import Claim, Outcome
from tests.support.fleet_builders import plan_for, random_mission
from tests.support.seeds import seeds

TROUBLED = Uncertainty(loss=0.3, popup=0.3, outcomes=True, withdrawals_per_min=2.0)
LOSSY = replace(TROUBLED, message_loss=0.1, jitter_s=0.05, delay_s=0.02)


class Listened(StochasticWorld):
    """Keeps all that is said."""

    def __init__(self, *args: object, **kwargs: object) -> None:
        self.heard: list[tuple[float, str, Message]] = []
        super().__init__(*args, **kwargs)  # type: ignore[arg-type]  # those of the world

    def said(self, process: Process, message: Message) -> None:
        self.heard.append((self.world.queue.now_s(), process.name, message))
        super().said(process, message)


def flown(uncertainty: Uncertainty, seed: int) -> list[tuple[float, str, Message]]:
    rng = np.random.default_rng(seed)
    mission = random_mission(rng, n_uav=6, n_task=30)
    method = "guided" if seed % 2 else "greedy"
    plan = plan_for(mission, method, seed)
    fate = uncertainty.draw(mission, max(plan.completion_s.values()), seed)
    world = Listened(fate, lambda *_: plan, method=method, seed=seed)
    assert world.run()
    return world.heard


@pytest.mark.parametrize("uncertainty", [TROUBLED, LOSSY], ids=["ideal", "lossy"])
@pytest.mark.parametrize("seed", seeds(4, 40))
def test_thinking_of_everything_leads_to_the_same_words_at_the_same_times(
    seed: int, uncertainty: Uncertainty, monkeypatch: pytest.MonkeyPatch
) -> None:
    remembered: list[int] = []
    only_remembers, may_read_later = Attention.only_remembers, Attention.may_read_later

    def counted(self: Attention, event: object, now_s: float) -> bool:
        only = only_remembers(self, event, now_s)  # type: ignore[arg-type]  # as it is called
        remembered.append(only and bool(event.messages))  # type: ignore[attr-defined]  # likewise
        return only

    def waits(self: Attention, message: Message, now_s: float) -> bool:
        may_wait = may_read_later(self, message, now_s)
        remembered.append(may_wait)
        return may_wait

    with monkeypatch.context() as patched:
        patched.setattr(Attention, "only_remembers", counted)
        patched.setattr(Attention, "may_read_later", waits)
        heard = flown(uncertainty, seed)
    assert sum(remembered) > 100
    with monkeypatch.context() as patched:
        patched.setattr(Attention, "_busy_with", lambda _: None)
        assert flown(uncertainty, seed) == heard
    assert any(isinstance(message.body, Claim | Outcome) for _, _, message in heard)
