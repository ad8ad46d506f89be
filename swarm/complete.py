"""What shells are told to complete an option's value with.

Leaves out: names that only the bus knows (coordinator.operator.completing).
"""

from __future__ import annotations

from collections.abc import Callable

__all__ = ["among"]


def among(*words: str) -> Callable[[str], list[str]]:
    """Completes with those of ``words`` that continue what has been typed."""

    def complete(incomplete: str) -> list[str]:
        return [word for word in words if word.startswith(incomplete)]

    return complete
