"""Points on a command line: ``--path 0,0 200,0 200,80``, as many as there are.

An option takes one word, or one with spaces; here all words that follow it and look like a point
are its own, negative ones too.
"""

from __future__ import annotations

import math
import re
from collections.abc import Iterator, Sequence
from typing import Any, Final

from typer.core import TyperCommand

from swarm.runtime.errors import Fault, InputError

OF_POINTS: Final = ("--path", "--path-deg", "--polygon", "--polygon-deg")
"""Options that take several."""
_POINT = re.compile(r"[-+]?[0-9.][^\s,]*(,[-+]?[^\s,]+){1,2}")


class PointsCommand(TyperCommand):
    """A command with such an option."""

    def parse_args(self, ctx: Any, args: list[str]) -> list[str]:
        """Make one word of each option's points before the rest is read as ever."""
        return super().parse_args(ctx, list(gathered(args)))


def gathered(args: Sequence[str]) -> Iterator[str]:
    """``args``, the points after an option of points in one word with it."""
    words = list(args)
    while words:
        word = words.pop(0)
        option, equals, first = word.partition("=")
        if option not in OF_POINTS:
            yield word
            continue
        points = [first] if equals else []
        while words and _POINT.fullmatch(words[0]):
            points.append(words.pop(0))
        if not points:  # what follows is no point: told of by whoever reads it
            yield word
            continue
        yield f"{option}={' '.join(points)}"


def points_of(option: str, text: str, *, in_degrees: bool) -> tuple[tuple[float, ...], ...]:
    """The points in the value of ``option``: two numbers each, in metres maybe a third for up.

    Raises:
        InputError: one is no point, or too far away.
    """
    return tuple(_point(option, n, word, in_degrees) for n, word in enumerate(text.split(), 1))


def _point(option: str, number: int, word: str, in_degrees: bool) -> tuple[float, ...]:
    example = "metres east, north and maybe up, such as 120,80"
    if in_degrees:
        example = "latitude and longitude, such as 47.3981,8.5470"
    try:
        numbers = tuple(float(part) for part in word.split(","))
    except ValueError:
        numbers = ()
    whole = len(numbers) == 2 or (len(numbers) == 3 and not in_degrees)
    if not whole or not all(map(math.isfinite, numbers)):
        place = f"point {number}"
        raise InputError(Fault(option, place, f"{word!r} is no place", f"give {example}"))
    return numbers
