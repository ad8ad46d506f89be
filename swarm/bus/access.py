"""What each identity may say on the bus, as the settings by which Zenoh enforces it.

A pure function of the roster. Routers use it for their clients and for each other, peers of a
mesh for their neighbours; a client needs none, as only routers' certificates serve. Whoever
is in no rule says and hears nothing. What is said is checked again in every process
(swarm.protocol.seal).
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import Any, Final

from swarm.identity.roster import Role, Roster, RosterEntry
from swarm.model.ids import COORDINATOR
from swarm.protocol.encoding import LARGE_LIMIT_BYTES, SMALL_LIMIT_BYTES
from swarm.protocol.key_space import KeySpace
from swarm.protocol.seal import ENVELOPE_BYTES

_LISTEN: Final = (
    "declare_subscriber",
    "declare_liveliness_subscriber",
    "liveliness_query",
)
_HEAR: Final = (
    "put",
    "query",
    "reply",
    "liveliness_token",
    "declare_subscriber",
    "declare_queryable",
    "declare_liveliness_subscriber",
    "liveliness_query",
)
_EVERYTHING: Final = (*_HEAR, "delete")

STATUS_HZ: Final = 200.0
"""Of each UAV's status, of which the newest counts; said 5 times a second, and 10 ms apart at
least (measured, 10 UAVs and 60 tasks at 20 times the pace)."""
CHOICE_HZ: Final = 200.0
"""Of each UAV's choices, one for each decision; lost ones are missed by nobody who flies."""
NEARBY_HZ: Final = 200.0
"""Of what each UAV says to those near it: 4 a second of mission time while somebody is near."""
QUESTIONS_HZ: Final = 50.0
"""Of questions to everybody, by each neighbour; honest ones are 0.2 s apart."""
QUESTION_BYTES: Final = 1 << 20
"""Of a question: it carries a number for each writer that is known of."""


def access_settings(roster: Roster) -> dict[str, Any]:
    """Settings of Zenoh, by name, that let everyone of ``roster`` say what is theirs to say.

    Registers may come in bursts and must not get lost, so how many there are of them is not
    limited here: what Zenoh limits is the time between any two messages under one rule.
    """
    keys = KeySpace(roster.mission)
    return {
        "access_control": _control(roster, keys),
        "downsampling": _rates(roster, keys),
        "low_pass_filter": _sizes(keys),
    }


def _control(roster: Roster, keys: KeySpace) -> dict[str, Any]:
    everyone = [entry.common_name for entry in roster.entries]
    everything = f"{keys.root}/**"
    rules = [
        _rule("listen", "ingress", _LISTEN, [everything]),
        _rule("ask", "ingress", ["query"], [keys.state("*")]),
        _rule("hear", "egress", _HEAR, [everything]),
    ]
    policies = [{"rules": ["listen", "ask", "hear"], "subjects": everyone}]
    for owner, subjects, puts, name in _writers(roster.entries, keys):
        says = [_rule(f"{owner} says", "ingress", ["put"], puts)]
        if name is not None:
            state = keys.state(name)
            says += [
                _rule(f"{owner} lives", "ingress", ["liveliness_token"], [keys.alive(name)]),
                _rule(f"{owner} answers", "ingress", ["declare_queryable", "reply"], [state]),
            ]
        rules += says
        policies.append({"rules": [rule["id"] for rule in says], "subjects": subjects})
    routers = _of_role(roster.entries, Role.ROUTER)
    if routers:
        carry = [
            _rule("carry in", "ingress", [*_EVERYTHING], [everything]),
            _rule("carry out", "egress", [*_EVERYTHING], [everything]),
        ]
        rules += carry
        policies.append({"rules": [rule["id"] for rule in carry], "subjects": routers})
    return {
        "enabled": True,
        "default_permission": "deny",
        "rules": rules,
        "subjects": [{"id": name, "cert_common_names": [name]} for name in everyone],
        "policies": policies if everyone else [],
    }


def _writers(
    entries: Sequence[RosterEntry], keys: KeySpace
) -> Iterable[tuple[str, list[str], list[str], str | None]]:
    """Who writes: a word for it, common names, keys to put on, and the name it lives by."""
    for entry in entries:
        if entry.role is Role.UAV:
            mine = f"{keys.root}/uav/{entry.name}/**"
            yield f"uav {entry.name}", [entry.common_name], [mine], entry.name
    coordinators = _of_role(entries, Role.COORDINATOR)
    if coordinators:
        plans = [keys.brief, keys.plan, keys.board("*"), keys.roster]
        yield "coordinator", coordinators, plans, COORDINATOR
    operators = _of_role(entries, Role.OPERATOR)
    if operators:
        yield "operator", operators, [f"{keys.root}/operator/**", keys.roster], None


def _of_role(entries: Iterable[RosterEntry], role: Role) -> list[str]:
    return [entry.common_name for entry in entries if entry.role is role]


def _rule(name: str, flow: str, messages: Iterable[str], keys: list[str]) -> dict[str, Any]:
    return {
        "id": name,
        "permission": "allow",
        "flows": [flow],
        "messages": list(messages),
        "key_exprs": keys,
    }


def _rates(roster: Roster, keys: KeySpace) -> list[dict[str, Any]]:
    """How often each may say what may get lost.

    Zenoh counts by rule and neighbour. Another router is the neighbour by which the words of
    many come, so each UAV has rules of its own; a question does not tell who asks, so with
    several routers it is each process that limits how many it answers.
    """
    uavs = [entry.name for entry in roster.entries if entry.role is Role.UAV]
    rates = [(keys.status(uav), STATUS_HZ) for uav in uavs]
    rates += [(keys.choice(uav), CHOICE_HZ) for uav in uavs]
    rates += [(keys.near(uav, "*", "*"), NEARBY_HZ) for uav in uavs]
    limits = [_limit("news", "put", rates)] if rates else []
    if len(_of_role(roster.entries, Role.ROUTER)) < 2:
        limits.append(_limit("questions", "query", [(keys.state("*"), QUESTIONS_HZ)]))
    return limits


def _limit(name: str, message: str, rates: Iterable[tuple[str, float]]) -> dict[str, Any]:
    return {
        "id": name,
        "messages": [message],
        "flows": ["ingress"],
        "rules": [{"key_expr": key_expr, "freq": freq_hz} for key_expr, freq_hz in rates],
    }


def _sizes(keys: KeySpace) -> list[dict[str, Any]]:
    """How long what is said may be; any process would drop what is longer."""
    small = [keys.claim("*"), keys.claim_to("*", "*"), keys.status("*"), keys.near("*", "*", "*")]
    small += [keys.outcome("*", "*"), keys.calibration("*"), f"{keys.root}/operator/**"]
    large = [f"{keys.root}/**"]
    return [
        _size("small", "put", small, SMALL_LIMIT_BYTES + ENVELOPE_BYTES),
        _size("large", "put", large, LARGE_LIMIT_BYTES + ENVELOPE_BYTES),
        _size("questions", "query", [keys.state("*")], QUESTION_BYTES),
    ]


def _size(name: str, message: str, keys: list[str], limit_bytes: int) -> dict[str, Any]:
    return {
        "id": name,
        "messages": [message],
        "flows": ["ingress"],
        "key_exprs": keys,
        "size_limit": limit_bytes,
    }
