"""What a command says to the person before it, beside what it was asked for.

Leaves out: errors (swarm.cli prints them) and logs (swarm.log).
"""

from __future__ import annotations

import sys

__all__ = ["checked", "say"]


def say(text: str) -> None:
    """One line on standard error."""
    print(f"swarm: {text}", file=sys.stderr, flush=True)


def checked() -> int:
    """Where a command with --check ends: it would begin now; the exit status."""
    say("these options are right")
    return 0
