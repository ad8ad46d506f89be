"""Keys: one writer each, and tokens that are recognised as such."""

from __future__ import annotations

import pytest
import zenoh

from swarm.protocol.key_space import ANY_TOKEN, KeySpace, mission_of_token
from swarm.protocol.messages import CommandKind, OperatorCommand
from tests.support.builders import MISSION, brief, done, entry, epoch, held, message, status, uav


def test_keys_are_those_that_access_control_is_written_for() -> None:
    said = [
        (message("coordinator", brief(uav("u0"))), "swarm/test/brief"),
        (message("coordinator", epoch("u0")), "swarm/test/plan"),
        (message("coordinator", entry("t0")), "swarm/test/board/t0"),
        (message("u0", held("t0", 0.0)), "swarm/test/uav/u0/claim"),
        (message("u0", done("t0")), "swarm/test/uav/u0/outcome/t0"),
        (message("u0", status()), "swarm/test/uav/u0/status"),
        (
            message("operator", OperatorCommand("u0", CommandKind.HOLD, 1, "")),
            "swarm/test/operator/u0",
        ),
        (
            message("operator", OperatorCommand("fleet", CommandKind.ABORT, 1, "")),
            "swarm/test/operator/fleet",
        ),
    ]
    for statement, key in said:
        assert statement.key == key


@pytest.mark.parametrize("name", ["", "a/b", "*", "**", "a b", "é", "x" * 65, "$*"])
def test_a_mission_that_is_no_id_has_no_keys(name: str) -> None:
    with pytest.raises(ValueError, match="mission name"):
        KeySpace(name)


def test_the_writer_is_read_off_its_token() -> None:
    keys = KeySpace(MISSION)

    assert keys.writer_of_token(keys.alive("u0")) == "u0"
    assert keys.writer_of_token(keys.alive("coordinator")) == "coordinator"


@pytest.mark.parametrize(
    "key",
    ["", "swarm/test/alive/", "swarm/test/alive", "swarm/test/alive/u0/x", "swarm/other/alive/u0"],
)
def test_other_keys_are_no_tokens(key: str) -> None:
    assert KeySpace(MISSION).writer_of_token(key) is None


def test_a_mission_is_found_by_any_of_its_tokens() -> None:
    assert zenoh.KeyExpr(ANY_TOKEN).includes(KeySpace(MISSION).alive("u0"))
    assert mission_of_token(KeySpace(MISSION).alive("u0")) == MISSION


@pytest.mark.parametrize("key", ["", "swarm/test", "swarm/test/alive/u0/x", "swarm/*/alive/u0"])
def test_other_keys_show_no_mission(key: str) -> None:
    assert mission_of_token(key) is None


def test_a_claim_said_to_one_alone_is_of_the_same_register_and_writer() -> None:
    keys = KeySpace(MISSION)
    alone = keys.claim_to("u0", "u1")

    assert keys.register_of(alone) == keys.claim("u0")
    assert keys.writer_of(alone) == "u0"
    assert not zenoh.KeyExpr(keys.claim("*")).includes(alone)
    assert zenoh.KeyExpr(keys.claim_to("*", "u1")).includes(alone)
    assert not zenoh.KeyExpr(keys.claim_to("*", "u2")).includes(alone)


@pytest.mark.parametrize(
    "key",
    ["", "swarm/test/uav/u0/claim", "swarm/test/uav/u0/claim/u1/x", "swarm/other/uav/u0/claim/u1"],
)
def test_other_keys_are_their_own_registers(key: str) -> None:
    assert KeySpace(MISSION).register_of(key) == key
