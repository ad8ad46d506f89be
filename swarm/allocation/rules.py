"""Decision rules: how a UAV whose turn it is chooses its next task.

Pure functions of the shared state; ties go to the smaller task index. The work is done by
compiled kernels. Leaves out: whose turn it is (`swarm.allocation.lower_level`) and the
priority sequence.
"""

from __future__ import annotations

from dataclasses import dataclass

from swarm.allocation.lower_level import Decision, Rule, TeamState
from swarm.allocation.problem import IntArray, Problem
from swarm.kernels.lower_level import EXACT_TASKS, GREEDY, LOOKAHEAD, RuleCode, decide, valued

__all__ = ["EXACT_TASKS", "RULE_NAMES", "KernelRule", "Rule", "rule_by_name"]

_CODES: dict[str, RuleCode] = {"greedy": GREEDY, "lookahead": LOOKAHEAD}
RULE_NAMES = tuple(_CODES)


@dataclass(frozen=True, slots=True)
class KernelRule:
    """Greedy (eq. 7): the open task with the largest p·S·m·(D − t). Or lookahead (eq. 6, 8): the
    first task of the UAV's own best complete tour of all tasks open to it.

    Lookahead is exact up to `EXACT_TASKS` tasks, and where Theorem 5 settles it; a heuristic's tour
    beyond.
    """

    name: str
    code: RuleCode

    def decide(
        self, problem: Problem, state: TeamState, rank: IntArray, uav: int
    ) -> Decision | None:
        """The next task of ``uav``; ``rank`` plays no part."""
        del rank
        fields = decide(problem.kernel, state, uav, self.code)
        return None if fields is None else Decision(*fields)

    def valued(
        self, problem: Problem, state: TeamState, uav: int, most: int
    ) -> tuple[tuple[int, float], ...]:
        """Tasks with their scores, the one it decides on first; so many at the most."""
        return tuple(valued(problem.kernel, state, uav, self.code, most))


def rule_by_name(name: str) -> KernelRule:
    """The rule of this name.

    Raises:
        ValueError: there is no such rule.
    """
    if name not in _CODES:
        raise ValueError(f"rule must be one of {', '.join(RULE_NAMES)}, not {name!r}")
    return KernelRule(name, _CODES[name])
