"""Allocation with the field's constraints: energy, windows, due times, lines, zones, wind."""

from swarm.allocation.field.problem import FieldProblem
from swarm.allocation.field.state import FieldState

__all__ = ["FieldProblem", "FieldState"]
