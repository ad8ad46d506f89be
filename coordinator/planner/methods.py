"""Names of the planning methods, for who offers them without planning anything."""

from __future__ import annotations

__all__ = ["METHODS", "ONLINE_METHODS"]

METHODS = ("greedy", "lookahead", "guided", "exact")
ONLINE_METHODS = ("greedy", "lookahead", "guided")
"""Those whose rule agents can follow by themselves."""
