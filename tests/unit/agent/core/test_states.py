"""The agent's states: what is documented is what is allowed, and nothing else."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

from agent.core.states import (
    FROM_OUTSIDE,
    STATUS_PHASE,
    TERMINAL,
    TRANSITIONS,
    AgentState,
    AgentStateMachine,
    Trigger,
)

README = (Path(__file__).parents[4] / "agent" / "README.md").read_text(encoding="utf-8")
PAIRS = [(state, trigger) for state in AgentState for trigger in Trigger]

Edge = tuple[AgentState, Trigger, AgentState]


def in_state(state: AgentState) -> tuple[AgentStateMachine, list[tuple[AgentState, Trigger]]]:
    """A machine in that state, and what it will tell of as impossible."""
    told: list[tuple[AgentState, Trigger]] = []
    machine = AgentStateMachine(lambda *impossible: told.append(impossible))
    machine.state = state
    return machine, told


def taken() -> set[Edge]:
    """Every transition that the machine makes."""
    edges = set()
    for state, trigger in PAIRS:
        machine, _ = in_state(state)
        if machine.take(trigger):
            edges.add((state, trigger, machine.state))
    return edges


def drawn() -> set[Edge]:
    """Every transition in the picture of agent/README.md; one of a group is one of each in it."""
    [picture] = re.findall(r"```mermaid\n(.*?)```", README, re.DOTALL)
    groups: dict[str, set[str]] = {}
    for name, body in re.findall(r"state (\w+) \{(.*?)\}", picture, re.DOTALL):
        groups[name] = {word for word in re.findall(r"\w+", body) if word in AgentState.__members__}
    edges = set()
    for source, target, triggers in re.findall(r"(\w+) --> (\w+): ([\w, ]+)", picture):
        for trigger in triggers.split(", "):
            for state in groups.get(source, {source}):
                edges.add((AgentState[state], Trigger[trigger], AgentState[target]))
    return edges


def test_the_picture_in_the_readme_is_the_table() -> None:
    # It would be crossed by an arrow from everywhere, so one sentence says this.
    superseded = {
        (state, Trigger.SUPERSEDED, AgentState.YIELDED) for state in set(AgentState) - TERMINAL
    }

    assert drawn() | superseded == taken()
    assert not drawn() & superseded


def test_the_words_in_the_readme_are_those_of_the_code() -> None:
    rows = dict(re.findall(r"^\| `([A-Z_]+)` \| (.*) \|$", README, re.MULTILINE))

    states = {s.name: f"{STATUS_PHASE[s].value} | {s.value}" for s in AgentState}
    assert rows == states | {trigger.name: trigger.value for trigger in Trigger}


def test_every_state_can_be_reached_and_left_but_for_the_last_ones() -> None:
    reached = {AgentState.SYNCING}
    while more := {TRANSITIONS[s][t] for s in reached for t in TRANSITIONS[s]} - reached:
        reached |= more

    assert reached == set(AgentState)
    assert {AgentState.HOME, AgentState.LEFT, AgentState.YIELDED} == TERMINAL


@pytest.mark.parametrize(("state", "trigger"), PAIRS)
def test_what_the_table_does_not_know_changes_nothing_and_is_told_if_it_is_its_own(
    state: AgentState, trigger: Trigger
) -> None:
    machine, told = in_state(state)
    known = trigger in TRANSITIONS[state]

    assert machine.allows(trigger) == known
    assert machine.take(trigger) == known
    assert machine.state is TRANSITIONS[state].get(trigger, state)
    assert told == ([] if known or trigger in FROM_OUTSIDE else [(state, trigger)])


def test_a_state_is_found_among_others_without_python_code() -> None:
    """Each step looks for it some twenty times."""
    assert vars(AgentState)["__hash__"] is object.__hash__
