"""The best assignment of rows to columns: who takes which of some tasks, one each.

Shortest augmenting paths, one for each row, in the form of D. F. Crouse, On implementing 2D
rectangular assignment algorithms, 2016, doi:10.1109/TAES.2016.140952. Of equal assignments it
finds the one that SciPy finds, which planning took it from before; SciPy alone is as large as all
else that a coordinator needs.
"""

from __future__ import annotations

import numpy as np

from swarm.allocation.problem import FloatArray, IntArray


def best_assignment(scores: FloatArray) -> dict[int, int]:
    """Columns by row, as many as there can be, with the largest sum of scores.

    Args:
        scores: (n_row, n_column), finite.
    """
    n_row, n_column = scores.shape
    if n_row > n_column:
        return dict(sorted((row, column) for column, row in best_assignment(scores.T).items()))
    cost = -np.ascontiguousarray(scores)
    row_price, column_price = np.zeros(n_row), np.zeros(n_column)
    column_of = np.full(n_row, -1, dtype=np.int64)
    row_of = np.full(n_column, -1, dtype=np.int64)
    for row in range(n_row):
        length, before, reached, end = _shortest_path(cost, row, row_price, column_price, row_of)
        # Prices stay such that no pair is a bargain, and those that are assigned cost nothing.
        others = row_of[reached]
        row_price[row] += length[end]
        row_price[others] += length[end] - length[reached]
        column_price[reached] -= length[end] - length[reached]
        column = end
        while True:
            by = int(before[column])
            row_of[column] = by
            column_of[by], column = column, int(column_of[by])
            if by == row:
                break
    return dict(enumerate(column_of.tolist()))


def _shortest_path(
    cost: FloatArray,
    row: int,
    row_price: FloatArray,
    column_price: FloatArray,
    row_of: IntArray,
) -> tuple[FloatArray, IntArray, IntArray, int]:
    """From ``row`` to the nearest column that nobody has.

    Returns:
        (n_column,) length of the way to each column; (n_column,) the row before it on that way;
        the columns that were reached before the last one; and the last one.
    """
    n_column = len(column_price)
    length, before = np.full(n_column, np.inf), np.full(n_column, -1, dtype=np.int64)
    left = np.arange(n_column - 1, -1, -1)
    reached: list[int] = []
    so_far = 0.0
    while True:
        there = so_far + cost[row, left] - row_price[row] - column_price[left]
        nearer = there < length[left]
        length[left[nearer]] = there[nearer]
        before[left[nearer]] = row
        ways = length[left]
        so_far = float(ways.min())
        nearest = (ways == so_far).nonzero()[0]
        free = nearest[row_of[left[nearest]] < 0]
        if len(free):
            return length, before, np.array(reached, dtype=np.int64), int(left[free[-1]])
        place = int(nearest[0])
        column = int(left[place])
        reached.append(column)
        row = int(row_of[column])
        left[place] = left[-1]
        left = left[:-1]
