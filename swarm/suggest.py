"""What a mistyped name probably meant, in the words of a fault's remedy.

Leaves out: names in scenario files (swarm.scenario.findings), which may be many.
"""

from __future__ import annotations

from collections.abc import Iterable
from difflib import get_close_matches

__all__ = ["instead"]


def instead(name: str, names: Iterable[str], what: str = "choose one of") -> str:
    """The remedy for a ``name`` that is none of ``names``: the nearest one, then all.

    Args:
        name: as it was typed.
        names: that there are.
        what: introduces them.
    """
    known = [str(each) for each in names]
    close = get_close_matches(name, known, n=1)
    choices = f"{what} {', '.join(known)}"
    return f"did you mean {close[0]!r}? {choices[:1].upper()}{choices[1:]}" if close else choices
