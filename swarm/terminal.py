"""What a command says to the person before it, beside what it was asked for.

Leaves out: errors (swarm.cli prints them) and logs (swarm.log).
"""

from __future__ import annotations

import sys

__all__ = ["say"]


def say(text: str) -> None:
    """One line on standard error."""
    print(f"swarm: {text}", file=sys.stderr, flush=True)
