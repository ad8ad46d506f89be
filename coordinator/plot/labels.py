"""Names written beside their places on a map, where they hide least.

Leaves out: what is named (coordinator.plot.figure).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from matplotlib.axes import Axes

    from swarm.allocation.problem import BoolArray, FloatArray

_DIRECTIONS = tuple(
    (float(np.cos(angle)), float(np.sin(angle)))
    for angle in np.radians([0, 90, 180, 270, 45, 315, 135, 225, 22, 158, 202, 338])
)
_GAPS_POINTS = (1.5, 5.0, 10.0, 17.0)
_LABEL_COST, _MARKER_COST, _LINE_COST, _OUTSIDE_COST = 100.0, 40.0, 3.0, 60.0


@dataclass(frozen=True, slots=True)
class Label:
    """A name to write near a point."""

    text: str
    point_m: tuple[float, float]
    """Where the point is, in the axes' data [m]."""
    radius_points: float
    """How far its marker reaches [points]."""
    bold: bool


def place_labels(axes: Axes, labels: Sequence[Label], size_points: float) -> list[FloatArray]:
    """Write ``labels`` on ``axes``, whose layout must be settled and whose lines must be drawn.

    Each tries a ring of places around its point, nearest first, and takes the one that hides least
    of other names and of the map.

    Returns:
        Per label, the box it takes as (left, bottom, right, top) [pixels].
    """
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.patheffects import withStroke

    figure = axes.get_figure(root=True)
    if figure is None or not labels:
        return []
    FigureCanvasAgg(figure)  # measures text in the pixels of a picture
    pixels = figure.dpi / 72.0
    points = axes.transData.transform([label.point_m for label in labels])
    reach = np.array([label.radius_points for label in labels])[:, None] * pixels
    markers = np.hstack([points - reach, points + reach])
    trail = _trail(axes)
    frame = np.array(axes.get_window_extent().extents)
    placed: list[FloatArray] = []
    for label, point, marker_reach in zip(labels, points, reach[:, 0], strict=True):
        text = axes.annotate(
            label.text,
            label.point_m,
            xytext=(0.0, 0.0),
            textcoords="offset points",
            ha="center",
            va="center",
            fontsize=size_points,
            fontweight="bold" if label.bold else "normal",
            color="#1a1a1a",
            zorder=6,
            path_effects=[withStroke(linewidth=2.0, foreground="white")],
        )
        extent = text.get_window_extent()
        half = np.array([extent.width, extent.height]) / 2.0
        best_cost, best_offset, best_box = np.inf, np.zeros(2), np.zeros(4)
        for gap in _GAPS_POINTS:
            for direction in _DIRECTIONS:
                # the box touches a circle around the point from outside
                offset = np.array(direction) * (marker_reach + gap * pixels + half)
                box = np.concatenate([point + offset - half, point + offset + half])
                cost = 0.4 * gap + _cost(box, placed, markers, trail, frame)
                if cost < best_cost:
                    best_cost, best_offset, best_box = cost, offset, box
        text.set_position(tuple(best_offset / pixels))
        placed.append(best_box)
    return placed


def _cost(
    box: FloatArray,
    placed: Sequence[FloatArray],
    markers: FloatArray,
    trail: FloatArray,
    frame: FloatArray,
) -> float:
    cost = _MARKER_COST * float(_overlaps(box, markers).sum())
    if placed:
        cost += _LABEL_COST * float(_overlaps(box, np.array(placed)).sum())
    if (box[:2] < frame[:2]).any() or (box[2:] > frame[2:]).any():
        cost += _OUTSIDE_COST
    inside = (trail >= box[:2]).all(axis=1) & (trail <= box[2:]).all(axis=1)
    return cost + _LINE_COST * min(5.0, float(inside.sum()) / 4.0)


def _overlaps(box: FloatArray, others: FloatArray) -> BoolArray:
    reaches = (box[:2] < others[:, 2:]) & (box[2:] > others[:, :2])
    return np.logical_and(reaches[:, 0], reaches[:, 1])


def _trail(axes: Axes) -> FloatArray:
    """Points every few pixels along all lines [pixels]."""
    parts = [np.empty((0, 2))]
    for line in axes.get_lines():
        corners = axes.transData.transform(np.column_stack(line.get_data()))
        for begin, end in pairwise(corners):
            steps = max(2, int(np.hypot(*(end - begin)) / 3.0))
            parts.append(begin + np.linspace(0.0, 1.0, steps)[:, None] * (end - begin))
    return np.concatenate(parts)
