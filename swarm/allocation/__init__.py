"""Allocation as pure functions: objective, lower level, decision rules, certificate."""

from swarm.allocation.lower_level import (
    Decision,
    Rule,
    TeamState,
    decisions,
    next_decision,
    rank_of,
    run,
)
from swarm.allocation.objective import evaluate, executed_objective
from swarm.allocation.problem import Problem
from swarm.allocation.rules import RULE_NAMES, rule_by_name

__all__ = [
    "RULE_NAMES",
    "Decision",
    "Problem",
    "Rule",
    "TeamState",
    "decisions",
    "evaluate",
    "executed_objective",
    "next_decision",
    "rank_of",
    "rule_by_name",
    "run",
]
