"""A field of character cells: thin lines below, signs and names on top.

Lines are made of braille dots, two by four to a cell, or of full stops where only
ASCII can be shown. Leaves out: what is drawn (coordinator.view.map_panel).
"""

from __future__ import annotations

from itertools import groupby
from operator import itemgetter

import numpy as np
from rich.text import Text

__all__ = ["Canvas", "Spot"]

Spot = tuple[float, float]
"""Column and row [cells], counted from the middle of the top left cell."""

_BRAILLE = 0x2800
_BITS = ((0x01, 0x08), (0x02, 0x10), (0x04, 0x20), (0x40, 0x80))
"""Braille bit of a dot, by row and column inside its cell."""


class Canvas:
    """Cells to draw on; what lies outside is left out.

    Args:
        width: columns.
        height: rows.
        braille: whether lines may use braille characters.
    """

    def __init__(self, width: int, height: int, *, braille: bool) -> None:
        self.width = width
        self.height = height
        self._braille = braille
        self._signs = [[""] * width for _ in range(height)]
        self._styles = [[""] * width for _ in range(height)]
        self._dots = [[0] * width for _ in range(height)]

    def line(self, begin: Spot, end: Spot, style: str, *, every: int = 1) -> None:
        """Draw from ``begin`` to ``end``, one dot in ``every``."""
        across, down = (2, 4) if self._braille else (1, 1)
        scale, shift = np.array([across, down]), np.array([across - 1, down - 1]) / 2.0
        first = np.array(begin) * scale + shift
        last = np.array(end) * scale + shift
        n_dot = int(np.abs(last - first).max()) + 1
        share = np.arange(0, n_dot + 1, every)[:, None] / n_dot
        for x, y in np.rint(first + share * (last - first)).astype(int).tolist():
            column, row = x // across, y // down
            if 0 <= column < self.width and 0 <= row < self.height:
                self._dots[row][column] |= _BITS[y % down][x % across]
                if not self._signs[row][column]:
                    self._styles[row][column] = style

    def put(self, spot: Spot, sign: str, style: str) -> None:
        """Set one cell, over whatever is there."""
        column, row = _cell(spot)
        if 0 <= column < self.width and 0 <= row < self.height:
            self._signs[row][column], self._styles[row][column] = sign, style

    def name(self, spot: Spot, names: tuple[str, ...], style: str) -> None:
        """Write the first of ``names`` for which there is room beside ``spot``, if any."""
        column, row = _cell(spot)
        for text in names:
            size = len(text)
            for left, top in (
                (column + 1, row),
                (column - size, row),
                (column - size // 2, row - 1),
                (column - size // 2, row + 1),
            ):
                if self._free(left, top, size, owner=(column, row)):
                    for offset, sign in enumerate(text):
                        self.put((left + offset, top), sign, style)
                    return

    def lines(self) -> list[Text]:
        """What has been drawn, row by row."""
        return [self._line(row) for row in range(self.height)]

    def _free(self, left: int, row: int, size: int, owner: tuple[int, int]) -> bool:
        """Whether a word fits there and touches nothing but the sign of its ``owner``."""
        if not (0 <= row < self.height and left >= 0 and left + size <= self.width):
            return False
        around = range(max(0, left - 1), min(self.width, left + size + 1))
        return not any(self._signs[row][x] for x in around if (x, row) != owner)

    def _line(self, row: int) -> Text:
        signs = [
            sign or self._dotted(dots)
            for sign, dots in zip(self._signs[row], self._dots[row], strict=True)
        ]
        styles = self._styles[row].copy()
        for column in range(1, self.width):  # blanks take any style: the fewer runs the faster
            if signs[column] == " ":
                styles[column] = styles[column - 1]
        text = Text(no_wrap=True, end="")
        for style, run in groupby(zip(styles, signs, strict=True), key=itemgetter(0)):
            text.append("".join(sign for _, sign in run), style)
        return text

    def _dotted(self, dots: int) -> str:
        if not dots:
            return " "
        return chr(_BRAILLE + dots) if self._braille else "."


def _cell(spot: Spot) -> tuple[int, int]:
    return round(spot[0]), round(spot[1])
