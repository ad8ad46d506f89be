"""How many words a decision of UAVs that keep apart takes: those that all of the fleet hear."""

from __future__ import annotations

from collections import Counter
from collections.abc import Collection

import pytest

from sim.bench.separation import dense_mission
from sim.faults.case import quick_plan
from sim.world.network import IdealNetwork, Node
from sim.world.simulation import simulate_mission
from sim.world.uncertainty import Uncertainty
from swarm.model.ids import COORDINATOR
from swarm.protocol.messages import Message
from swarm.protocol.uav_messages import Choice, Claim, ClaimPhase


class Words:
    """Counts what is new in claims, by what it tells."""

    def __init__(self) -> None:
        self.told: Counter[str] = Counter()
        self._before: dict[str, Claim] = {}

    def hear(self, message: Message, to: Collection[str] | None) -> None:
        if isinstance(message.body, Choice):
            self.told["decision"] += 1
        if not isinstance(message.body, Claim) or message.writer == COORDINATOR:
            return
        if to is not None:
            self.told["grant to some"] += 1
            return
        claim, before = message.body, self._before.get(message.writer)
        self._before[message.writer] = claim
        if before is None or claim == before:
            return
        assert claim.way is not None
        assert before.way is not None
        departs = claim.way.flies and not before.way.flies and claim.way.number == before.way.number
        holds = claim.phase is ClaimPhase.HELD is not before.phase
        if claim.task is not None and claim.task != before.task:
            self.told["decides"] += 1
        elif holds:
            self.told["holds as it departs" if departs else "holds alone"] += 1
        elif claim.phase is ClaimPhase.HELD:
            self.told["else, with a task"] += 1
        else:
            self.told["else"] += 1


N_UAV = 16
"""More than layers, so that somebody else keeps the air of each."""


def test_all_hear_two_words_of_each_decision(monkeypatch: pytest.MonkeyPatch) -> None:
    words, publish = Words(), IdealNetwork.publish

    def heard(
        self: IdealNetwork, sender: Node, message: Message, to: Collection[str] | None = None
    ) -> None:
        words.hear(message, to)
        publish(self, sender, message, to)

    monkeypatch.setattr(IdealNetwork, "publish", heard)
    flown = simulate_mission(
        dense_mission(N_UAV, 1, 6.0),
        method="greedy",
        seed=1,
        uncertainty=Uncertainty(),
        planner=quick_plan,
    )

    told, decisions = words.told, words.told["decision"]
    assert not flown.result.open
    assert decisions >= 5 * N_UAV
    assert told["grant to some"] > decisions
    assert told["decides"] == pytest.approx(decisions, abs=2)
    assert told["holds as it departs"] > 0.9 * told["decides"]
    assert told["holds as it departs"] + told["holds alone"] <= told["decides"]
    assert told["else, with a task"] < 0.1 * decisions + N_UAV
    assert told["else"] < 7 * N_UAV
