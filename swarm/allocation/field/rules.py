"""Rules that heed the field's constraints, by the names that plans and epochs call them."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from swarm.allocation.field.problem import FieldProblem
from swarm.kernels.field import (
    FIELD_GREEDY,
    FIELD_LOOKAHEAD,
    FIELD_NEAREST,
    FIELD_VALUE_PER_TIME,
    FieldRuleCode,
)

FIELD_RULES: Mapping[str, FieldRuleCode] = {
    "greedy": FIELD_GREEDY,
    "lookahead": FIELD_LOOKAHEAD,
}
"""Rules that decide item by item."""
FIELD_INDEX_RULES: Mapping[str, FieldRuleCode] = {
    "nearest": FIELD_NEAREST,
    "value-per-time": FIELD_VALUE_PER_TIME,
}
"""Rules that studies compare them with; no plan is made by them."""
GUIDED = "guided"
"""Follows the whole team's lists, which are searched anew at every decision."""


def item_lists(problem: FieldProblem, routes: Mapping[str, Sequence[str]]) -> list[list[int]]:
    """Task ids by UAV as (n_uav,) lists of items, lines forwards; what is unknown is left out."""
    columns: dict[str, int] = {task: index for index, task in enumerate(problem.task_ids)}
    return [
        [2 * columns[task] for task in routes.get(uav, ()) if task in columns]
        for uav in problem.uav_ids
    ]
