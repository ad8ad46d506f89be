"""Who may say what: the generated settings, read as Zenoh reads them, against a table of our own.

The reading follows Zenoh's documentation: what no rule allows is denied, and a rule reaches
whatever its key expressions include.
"""

from __future__ import annotations

import itertools
from typing import Any

import pytest

from swarm.bus.access import access_settings
from swarm.identity import Role, Roster, RosterEntry
from swarm.protocol.encoding import LARGE_LIMIT_BYTES, SMALL_LIMIT_BYTES
from swarm.protocol.key_space import KeySpace
from swarm.protocol.seal import ENVELOPE_BYTES

KEYS = KeySpace("m")
NAMES = {
    "uav1": Role.UAV,
    "uav2": Role.UAV,
    "coordinator": Role.COORDINATOR,
    "coordinator-2": Role.COORDINATOR,
    "router": Role.ROUTER,
    "dashboard": Role.VIEWER,
    "operator": Role.OPERATOR,
    "pilot-2": Role.OPERATOR,
}


def roster(*without: str, generation: int = 1) -> Roster:
    entries = [
        RosterEntry(name, role, generation, bytes(32), 0)
        for name, role in sorted(NAMES.items())
        if name not in without
    ]
    return Roster("m", bytes(16), 1, tuple(entries))


SETTINGS = access_settings(roster())
SAYINGS = {
    "put": (
        KEYS.brief,
        KEYS.plan,
        KEYS.roster,
        KEYS.board("t1"),
        *(key(uav) for uav in ("uav1", "uav2") for key in (KEYS.claim, KEYS.status, KEYS.choice)),
        *(KEYS.outcome(uav, "t1") for uav in ("uav1", "uav2")),
        *(KEYS.near(uav, 0, -1) for uav in ("uav1", "uav2")),
        KEYS.operator("uav1"),
        KEYS.operator("fleet"),
        KEYS.operator_task("t1"),
        "swarm/m/anything",
        "swarm/other/plan",
        "elsewhere",
    )
}
SAYINGS["delete"] = SAYINGS["put"]
SAYINGS["liveliness_token"] = tuple(
    KEYS.alive(name) for name in ("uav1", "uav2", "coordinator", "operator", "dashboard", "x")
)
SAYINGS["declare_queryable"] = tuple(
    KEYS.state(key.rpartition("/")[2]) for key in SAYINGS["liveliness_token"]
)
SAYINGS["reply"] = SAYINGS["declare_queryable"]
HEARINGS = {
    "declare_subscriber": (KEYS.root + "/**", KEYS.claim("*"), "**", "swarm/**", "swarm/other/**"),
    "declare_liveliness_subscriber": (KEYS.alive("*"), "swarm/*/alive/*", "swarm/other/alive/*"),
    "liveliness_query": (KEYS.alive("*"), "**"),
    "query": (KEYS.state("*"), KEYS.state("uav1"), "swarm/*/state/*", "**"),
}


def includes(rule: str, key: str) -> bool:
    """Whether every key that ``key`` stands for is one of those of ``rule``."""
    return _include(rule.split("/"), key.split("/"))


def _include(rule: list[str], key: list[str]) -> bool:
    if rule == ["**"]:
        return True
    if not rule or not key:
        return rule == key
    if key[0] == "**" or rule[0] not in ("*", key[0]):
        return False
    return _include(rule[1:], key[1:])


def passes(settings: dict[str, Any], name: str, flow: str, message: str, key: str) -> bool:
    control = settings["access_control"]
    assert control["enabled"]
    assert control["default_permission"] == "deny"
    rules = {rule["id"]: rule for rule in control["rules"]}
    assert len(rules) == len(control["rules"])
    who = {each["id"] for each in control["subjects"] if name in each["cert_common_names"]}
    return any(
        rules[rule]["permission"] == "allow"
        and flow in rules[rule]["flows"]
        and message in rules[rule]["messages"]
        and any(includes(each, key) for each in rules[rule]["key_exprs"])
        for policy in control["policies"]
        if who & set(policy["subjects"])
        for rule in policy["rules"]
    )


def is_own(name: str, message: str, key: str) -> bool:
    """The table: what each may say."""
    role = NAMES[name]
    if role is Role.ROUTER:
        return key.startswith("swarm/m/")
    if message == "delete":
        return False
    chunks = key.split("/")[2:] if key.startswith("swarm/m/") else []
    lives_as = {Role.UAV: name, Role.COORDINATOR: "coordinator"}.get(role)
    match chunks:
        case ["alive" | "state", who]:
            return who == lives_as
        case ["uav", uav, *_]:
            return role is Role.UAV and uav == name
        case ["brief" | "plan"] | ["board", _]:
            return role is Role.COORDINATOR
        case ["operator", *_]:
            return role is Role.OPERATOR
        case ["roster"]:
            return role in (Role.COORDINATOR, Role.OPERATOR)
    return False


@pytest.mark.parametrize("name", NAMES)
def test_each_may_say_what_is_theirs_and_nothing_else(name: str) -> None:
    for message, keys in SAYINGS.items():
        for key in keys:
            expected = is_own(name, message, key)
            assert passes(SETTINGS, f"{name}@1", "ingress", message, key) == expected, (
                message,
                key,
            )


@pytest.mark.parametrize("name", NAMES)
def test_everyone_hears_all_of_the_mission_and_nothing_of_others(name: str) -> None:
    for message, keys in HEARINGS.items():
        for key in keys:
            expected = key.startswith("swarm/m/")
            assert passes(SETTINGS, f"{name}@1", "ingress", message, key) == expected, (
                message,
                key,
            )
    everything = {**SAYINGS, **HEARINGS}
    del everything["delete"]
    for message, keys in everything.items():
        for key in keys:
            expected = includes("swarm/m/**", key)
            assert passes(SETTINGS, f"{name}@1", "egress", message, key) == expected, (message, key)


@pytest.mark.parametrize(
    ("settings", "name"),
    [
        (SETTINGS, "uav1@2"),
        (SETTINGS, "uav1"),
        (SETTINGS, ""),
        (SETTINGS, "stranger@1"),
        (access_settings(roster(generation=2)), "uav1@1"),
        (access_settings(roster("uav1")), "uav1@1"),
        (access_settings(roster("router")), "router@1"),
        (access_settings(Roster("m", bytes(16), 1, ())), "uav1@1"),
    ],
)
def test_who_is_not_in_the_roster_says_and_hears_nothing(
    settings: dict[str, Any], name: str
) -> None:
    for flow, messages in itertools.product(("ingress", "egress"), ({**SAYINGS, **HEARINGS},)):
        for message, keys in messages.items():
            assert not any(passes(settings, name, flow, message, key) for key in keys)


def test_each_uavs_news_has_a_limit_of_its_own_and_registers_have_none() -> None:
    limits = {
        (message, rule["key_expr"]): rule["freq"]
        for limit in SETTINGS["downsampling"]
        for message in limit["messages"]
        for rule in limit["rules"]
    }

    for uav in ("uav1", "uav2"):
        assert limits["put", KEYS.status(uav)] >= 50.0
        assert limits["put", KEYS.choice(uav)] >= 50.0
    limited = [key for message, key in limits if message == "put"]
    registers = (KEYS.claim("uav1"), KEYS.outcome("uav1", "t1"), KEYS.plan, KEYS.board("t1"))
    assert not any(includes(rule, key) for rule in limited for key in registers)
    assert limits["query", KEYS.state("*")] >= 20.0


def test_questions_by_way_of_another_router_are_not_limited_as_if_one_asked_them() -> None:
    two = Roster(
        "m",
        bytes(16),
        1,
        tuple(RosterEntry(name, Role.ROUTER, 1, bytes(32), 0) for name in ("router", "router-2")),
    )

    assert all("query" not in limit["messages"] for limit in access_settings(two)["downsampling"])


@pytest.mark.parametrize(
    ("message", "key", "longest"),
    [
        ("put", KEYS.claim("uav1"), SMALL_LIMIT_BYTES + ENVELOPE_BYTES),
        ("put", KEYS.claim_to("uav1", "uav2"), SMALL_LIMIT_BYTES + ENVELOPE_BYTES),
        ("put", KEYS.status("uav1"), SMALL_LIMIT_BYTES + ENVELOPE_BYTES),
        ("put", KEYS.outcome("uav1", "t1"), SMALL_LIMIT_BYTES + ENVELOPE_BYTES),
        ("put", KEYS.operator("fleet"), SMALL_LIMIT_BYTES + ENVELOPE_BYTES),
        ("put", KEYS.operator_task("t1"), SMALL_LIMIT_BYTES + ENVELOPE_BYTES),
        ("put", KEYS.choice("uav1"), LARGE_LIMIT_BYTES + ENVELOPE_BYTES),
        ("put", KEYS.plan, LARGE_LIMIT_BYTES + ENVELOPE_BYTES),
        ("put", KEYS.roster, LARGE_LIMIT_BYTES + ENVELOPE_BYTES),
    ],
)
def test_what_is_longer_than_any_process_reads_is_not_passed_on(
    message: str, key: str, longest: int
) -> None:
    sizes = [
        each["size_limit"]
        for each in SETTINGS["low_pass_filter"]
        if message in each["messages"] and any(includes(rule, key) for rule in each["key_exprs"])
    ]

    assert min(sizes) == longest


def test_large_fleet_takes_few_rules_each() -> None:
    fleet = tuple(RosterEntry(f"uav{n:03}", Role.UAV, 1, bytes(32), 0) for n in range(200))

    control = access_settings(Roster("m", bytes(16), 1, fleet))["access_control"]

    assert len(control["rules"]) <= 3 * 200 + 5
    assert len(control["policies"]) == 200 + 1


@pytest.mark.parametrize(
    ("rule", "key", "expected"),
    [
        ("a/**", "a/b/c", True),
        ("a/**", "a/**", True),
        ("a/*", "a/**", False),
        ("a/*", "a/b", True),
        ("a/*", "a/*", True),
        ("a/b", "a/*", False),
        ("a/**", "b/c", False),
        ("a/*", "a/b/c", False),
        ("a/b/*", "a/b", False),
    ],
)
def test_the_reading_of_rules_is_right(rule: str, key: str, *, expected: bool) -> None:
    assert includes(rule, key) == expected
