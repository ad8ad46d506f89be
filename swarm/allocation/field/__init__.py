"""Allocation with the field's constraints: energy, windows, due times, lines, zones, wind.

What is named here is imported when it is first used: who meets a mission of the field only perhaps
says ``field.FieldProblem``, and loads nothing of it for plain missions.
"""

from __future__ import annotations

from swarm.lazy_names import names_from

TYPE_CHECKING = False  # as typing has it
if TYPE_CHECKING:
    from swarm.allocation.field.problem import FieldProblem
    from swarm.allocation.field.recent import problem_of
    from swarm.allocation.field.state import FieldState
    from swarm.allocation.field.ways import Way, base_node, task_nodes, way_home, way_to

__all__ = [
    "FieldProblem",
    "FieldState",
    "Way",
    "base_node",
    "problem_of",
    "task_nodes",
    "way_home",
    "way_to",
]

if not TYPE_CHECKING:  # a type checker must know no other name
    __getattr__ = names_from(
        __name__,
        {
            "swarm.allocation.field.problem": ("FieldProblem",),
            "swarm.allocation.field.recent": ("problem_of",),
            "swarm.allocation.field.state": ("FieldState",),
            "swarm.allocation.field.ways": ("Way", "base_node", "task_nodes", "way_home", "way_to"),
        },
    )
