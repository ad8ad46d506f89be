"""Problems of missions that were asked for lately, so that equal ones are made once.

Tables of legs round zones take time, and whoever simulates a fleet asks for the same problem once
for each of its agents. A problem never changes, so one does for all.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Sequence

from swarm.allocation.field.problem import FieldProblem
from swarm.model import Mission

_KEPT = 4

_recent: deque[tuple[Mission, tuple[float, ...] | None, FieldProblem]] = deque(maxlen=_KEPT)


def problem_of(mission: Mission, layers_m: Sequence[float] | None = None) -> FieldProblem:
    """As `FieldProblem.from_mission`; of equal missions and layers the very same."""
    layers = None if layers_m is None else tuple(layers_m)
    for known, known_layers, problem in tuple(_recent):
        if known_layers == layers and known == mission:
            return problem
    problem = FieldProblem.from_mission(mission, layers)
    _recent.append((mission, layers, problem))
    return problem
