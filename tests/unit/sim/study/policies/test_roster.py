"""Policies by name."""

from __future__ import annotations

import subprocess
import sys

import pytest

from sim.study.policies.roster import ROSTER


@pytest.mark.parametrize("name", ROSTER.policies)
def test_every_policy_is_found_under_its_name(name: str) -> None:
    policy = ROSTER.policy(name)

    assert policy.name.partition(":")[0] == name
    assert policy.what


def test_bound_is_found() -> None:
    assert ROSTER.make_bound().name == "clairvoyant"


def test_number_behind_the_colon_is_the_policys_parameter() -> None:
    names = [ROSTER.policy(name).name for name in ("interval:30", "interval:60", "interval")]

    assert names == ["interval:30", "interval:60", "interval:60"]


def test_only_policies_without_the_real_agents_need_ideal_communication() -> None:
    ours = {name for name in ROSTER.policies if not ROSTER.ideal(name)}

    assert ours == {"greedy", "lookahead", "guided", "guided-alone"}
    assert ROSTER.ideal("interval:30")


@pytest.mark.parametrize("name", ["", "gredy", "greedy:3", "interval:x", "interval:0", "interval:"])
def test_unknown_name_has_a_fault_and_no_policy(name: str) -> None:
    assert ROSTER.fault(name) is not None
    with pytest.raises(ValueError, match="no such policy"):
        ROSTER.policy(name)


def test_policies_are_imported_only_when_they_are_asked_for() -> None:
    code = (
        "import sys, sim.study.cli, sim.study.policies.roster\n"
        "heavy = {'numpy', 'agent.core.agent_core', 'distributed', 'rich'}\n"
        "print([m for m in sys.modules if m in heavy])"
    )
    ended = subprocess.run(
        [sys.executable, "-c", code], capture_output=True, text=True, timeout=60, check=True
    )

    assert ended.stdout.strip() == "[]"
