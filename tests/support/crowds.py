"""What many writers say at once, so that it meets; and the replica of whoever hears it."""

from __future__ import annotations

from dataclasses import replace

from hypothesis import strategies as st

from swarm.model.ids import COORDINATOR, OPERATOR
from swarm.protocol.messages import CommandKind, Message, OperatorCommand, Stamp
from swarm.protocol.registers import Replica
from tests.support.builders import (
    IDLE,
    MISSION,
    OUT,
    brief,
    done,
    entry,
    epoch,
    held,
    order,
    proposed,
    status,
    uav,
)

# Few stamps and contents, so that many statements meet of the same age, or with other contents.
few_stamps = st.builds(Stamp, st.integers(0, 2), st.integers(0, 2))
claims_and_outcomes = st.sampled_from(
    [IDLE, OUT, proposed("t0", 1.0), held("t0", 1.0), held("t1", 2.0), done("t0"), done("t1")]
)
briefs_and_tasks = st.sampled_from(
    [
        brief(uav("u0")),
        brief(uav("u0"), uav("u1", t0=0.5)),
        replace(brief(uav("u0")), run=2),
        epoch("u0", "u1"),
        epoch("u1", "u0"),
        entry("t0"),
        entry("t0", value=7.0),
        entry("t1"),
    ]
)
orders_and_commands = st.sampled_from(
    [
        order("t0"),
        order("t0", withdrawn=True),
        order("t0", run=2, value=3.0),
        order("t2"),
        order("t2", run=2),
        OperatorCommand("u0", CommandKind.HOLD, 1, ""),
    ]
)
statements = st.one_of(
    st.builds(Message, st.just(MISSION), st.just(OPERATOR), few_stamps, orders_and_commands),
    st.builds(Message, st.just(MISSION), st.just(COORDINATOR), few_stamps, briefs_and_tasks),
    st.builds(
        Message,
        st.just(MISSION),
        st.sampled_from(["u0", "u1", "u2"]),
        few_stamps,
        claims_and_outcomes | st.just(status()),
    ),
)
crowds = st.lists(statements, max_size=12)


def joined(said: list[Message]) -> Replica:
    replica = Replica()
    for statement in said:
        replica.join(statement)
    return replica
