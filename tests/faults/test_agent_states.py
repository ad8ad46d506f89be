"""Which states agents come into when whole fleets fly under random faults."""

from __future__ import annotations

from collections import Counter

import pytest

from agent.core.states import TRANSITIONS, AgentState, AgentStateMachine, Trigger
from sim.faults.case import play
from sim.faults.generator import random_case

SEEDS = (0, 8, 130, 203, 2_000_031, 2_000_084)
"""In these operators hold UAVs, once until the mission is over, and a lost claim is recovered; in
the last two UAVs visit bases, and wait above and beside them for slots and for tasks to open."""
NOT_IN_A_SOAK = {AgentState.RETURNING, AgentState.OUT, AgentState.LEFT, AgentState.YIELDED}
"""Only a vehicle with a will of its own or a second agent brings these about; see the storms of
tests/unit/agent/core and the bridged fleets here."""


def test_a_soak_reaches_every_state_that_ideal_vehicles_can_lead_to(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    taken: Counter[tuple[AgentState, Trigger, AgentState]] = Counter()
    take = AgentStateMachine.take

    def noting(machine: AgentStateMachine, trigger: Trigger) -> bool:
        before = machine.state
        went = take(machine, trigger)
        if went:
            taken[before, trigger, machine.state] += 1
        return went

    monkeypatch.setattr(AgentStateMachine, "take", noting)

    for seed in SEEDS:
        assert play(random_case(seed)).broken is None

    reached = {AgentState.SYNCING} | {after for _, _, after in taken}
    assert reached == set(AgentState) - NOT_IN_A_SOAK
    assert all(TRANSITIONS[before][trigger] is after for before, trigger, after in taken)
