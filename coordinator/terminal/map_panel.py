"""The map of a running mission in character cells, north up, true to scale.

Cells are taken to be twice as high as wide. Lines are made of braille dots, two by four to a cell,
or of full stops where only ASCII can be shown.
"""

from __future__ import annotations

import math
from itertools import groupby, pairwise
from operator import itemgetter
from typing import TYPE_CHECKING

import numpy as np
from rich.text import Text

from coordinator.mission_view.presentation import BAD, Signs, uav_colour
from coordinator.mission_view.scene import Scene, TaskView
from coordinator.mission_view.uav_state import UavView
from swarm.model.rings import Ring
from swarm.protocol.board import TaskState
from swarm.separation.straight_pieces import still_ahead

if TYPE_CHECKING:
    from coordinator.mission_view.ways import MapPath

Spot = tuple[float, float]
"""Column and row [cells], counted from the middle of the top left cell."""


_BRAILLE = 0x2800
_BITS = ((0x01, 0x08), (0x02, 0x10), (0x04, 0x20), (0x40, 0x80))
"""Braille bit of a dot, by row and column inside its cell."""


class Canvas:
    """Cells to draw on; what lies outside is left out."""

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


_CELL_ASPECT = 2.0
"""Height of a character cell over its width."""
_MARGIN = 3
"""Columns kept free left and right of the outermost places, for names."""
_ROOM_FOR_PATHS = 12
"""Cells per task from which on flown paths are drawn without a muddle."""
_ROOM_FOR_PLANS = 30
"""Cells per task from which on planned paths are drawn as well."""
_ROOM_PER_LETTER = 6
"""Cells per task and letter of its name from which on tasks are named."""


_ZONE = "red"
"""Style of the borders of zones."""
_AREA = "dim green"
"""Style of the borders of areas to cover."""
Point = tuple[float, float, float]


def ideal_width(scene: Scene, height: int) -> int:
    """Columns, frame included, that the map fills at ``height`` rows."""
    east_m, north_m = _extent_m(scene)
    rows = max(1, height - 4)
    if north_m <= 0.0:
        return 10_000
    return math.ceil(east_m / north_m * rows * _CELL_ASPECT) + 2 * _MARGIN + 3


def map_panel(scene: Scene, width: int, height: int, signs: Signs) -> list[Text]:
    """The map in its frame: ``height`` lines of ``width`` cells."""
    columns, rows = width - 2, height - 2
    canvas = Canvas(columns, rows, braille=signs.braille)
    view = _View(scene, columns, rows)
    room = columns * rows / max(1, len(scene.tasks))
    _draw_areas(canvas, view, scene)
    _draw_zones(canvas, view, scene)
    _draw_paths(canvas, view, scene, room)
    for base in scene.mission.bases:
        canvas.put(view.spot(base.position_enu_m), signs.base, "bold")
    tasks = [task for task in scene.tasks if task.state is not TaskState.WITHDRAWN]
    for task in sorted(tasks, key=_weight):
        canvas.put(view.spot(task.position_enu_m), *_task_look(task, signs))
    # Names of UAVs come first, and the UAVs themselves over all but where two are about to meet.
    for uav in scene.uavs:
        canvas.put(view.spot(uav.place_enu_m), *_uav_look(uav, signs))
    for conflict in scene.conflicts:
        (east_m, north_m, up_m), (to_east_m, to_north_m, _) = conflict.places_enu_m
        middle = 0.5 * (east_m + to_east_m), 0.5 * (north_m + to_north_m), up_m
        canvas.put(view.spot(middle), signs.conflict, BAD)
    meeting = scene.about_to_meet
    for uav in sorted(scene.uavs, key=lambda uav: not (uav.troubled or uav.id in meeting)):
        style = _uav_look(uav, signs)[1]
        canvas.name(view.spot(uav.place_enu_m), (uav.id, uav.short), style)
    longest = max((len(task.id) for task in tasks), default=0)
    if room >= _ROOM_PER_LETTER * (longest + 2):
        for task in tasks:
            canvas.name(view.spot(task.position_enu_m), (task.id,), "dim")
        for base in scene.mission.bases:
            canvas.name(view.spot(base.position_enu_m), (base.id,), "dim")
    return _framed(canvas.lines(), columns, view.m_per_column, signs)


class _View:
    """Where places in the plane lie on the canvas."""

    def __init__(self, scene: Scene, columns: int, rows: int) -> None:
        points = _points_m(scene)
        self._west_m = min(east_m for east_m, _ in points)
        self._north_m = max(north_m for _, north_m in points)
        east_m, north_m = _extent_m(scene)
        margin = min(_MARGIN, (columns - 1) // 4)
        across = max(1, columns - 1 - 2 * margin)
        down = max(1, rows - 1)
        self.m_per_column = max(east_m / across, north_m / down / _CELL_ASPECT) or 1.0
        m_per_row = self.m_per_column * _CELL_ASPECT
        self._left = (columns - 1 - east_m / self.m_per_column) / 2.0
        self._top = (rows - 1 - north_m / m_per_row) / 2.0
        self._right_most, self._lowest = columns - 1, rows - 1

    def spot(self, point_enu_m: Point) -> Spot:
        """Its cell; what lies outside the map is drawn at its edge."""
        column, row = self.beyond((point_enu_m[0], point_enu_m[1]))
        return min(max(column, 0.0), self._right_most), min(max(row, 0.0), self._lowest)

    def beyond(self, point_enu_m: tuple[float, float]) -> Spot:
        """Its cell, be it outside the map."""
        column = self._left + (point_enu_m[0] - self._west_m) / self.m_per_column
        return column, self._top + (self._north_m - point_enu_m[1]) / self.m_per_column / (
            _CELL_ASPECT
        )


def _points_m(scene: Scene) -> list[tuple[float, float]]:
    """All starts, bases and tasks, also those nobody knows yet: the map must not jump."""
    starts = [uav.position_enu_m[:2] for uav in scene.mission.uavs]
    bases = [base.position_enu_m[:2] for base in scene.mission.bases]
    tasks = [
        point[:2]
        for task in scene.mission.tasks
        for point in task.path_enu_m or (task.position_enu_m,)
    ]
    return [*starts, *bases, *tasks] or [(0.0, 0.0)]


def _extent_m(scene: Scene) -> tuple[float, float]:
    east_m, north_m = zip(*_points_m(scene), strict=True)
    return max(east_m) - min(east_m), max(north_m) - min(north_m)


def _draw_areas(canvas: Canvas, view: _View, scene: Scene) -> None:
    for area in scene.mission.areas:
        for ring in (area.polygon_enu_m, *area.holes_enu_m):
            _draw_ring(canvas, view, ring, _AREA)


def _draw_zones(canvas: Canvas, view: _View, scene: Scene) -> None:
    for zone in scene.mission.zones:
        for ring in (zone.polygon_enu_m, *zone.holes_enu_m):
            _draw_ring(canvas, view, ring, _ZONE)


def _draw_ring(canvas: Canvas, view: _View, ring: Ring, style: str) -> None:
    """A border; what of it lies outside the map is left out."""
    for first, last in pairwise((*ring, ring[0])):
        canvas.line(view.beyond(first), view.beyond(last), style)


def _draw_paths(canvas: Canvas, view: _View, scene: Scene, room: float) -> None:
    places = {task.id: task.position_enu_m for task in scene.tasks}
    for task in scene.tasks:
        for first, last in pairwise(task.path_enu_m):
            canvas.line(view.spot(first), view.spot(last), "dim", every=3)
    _draw_ways(canvas, view, scene, room)
    straight = [uav for uav in scene.uavs if uav.ways is None]
    for uav in straight:
        if room < _ROOM_FOR_PLANS or uav.troubled:
            continue
        faint = f"dim {uav_colour(uav.number)}"
        ahead = [task for task in uav.planned if task != uav.task and task in places]
        begin = places.get(uav.task, uav.place_enu_m) if uav.task else uav.place_enu_m
        stops = [begin, *(places[task] for task in ahead)]
        for first, last in pairwise(stops):
            canvas.line(view.spot(first), view.spot(last), faint, every=4)
    for uav in straight:
        if room >= _ROOM_FOR_PATHS:
            stops = [uav.start_enu_m, *(places[task] for task in uav.flown if task in places)]
            if uav.busy or uav.troubled:
                stops.append(uav.place_enu_m)
            for first, last in pairwise(stops):
                canvas.line(view.spot(first), view.spot(last), uav_colour(uav.number))
        if uav.task is not None and uav.task in places:
            target = view.spot(places[uav.task])
            canvas.line(view.spot(uav.place_enu_m), target, uav_colour(uav.number), every=2)


def _draw_ways(canvas: Canvas, view: _View, scene: Scene, room: float) -> None:
    """Ways in the field: ahead and home below what was flown, and what is flown now on top."""
    if all(uav.ways is None for uav in scene.uavs):
        return

    def draw(path: MapPath, style: str, every: int) -> None:
        for first, last in pairwise(path):
            canvas.line(view.beyond(first), view.beyond(last), style, every=every)

    for uav in scene.uavs:
        if uav.ways is not None and room >= _ROOM_FOR_PLANS and not uav.troubled:
            draw(uav.ways.ahead, f"dim {uav_colour(uav.number)}", 4)
    for uav in scene.uavs:
        if uav.ways is None:
            continue
        east_m, north_m, _ = uav.place_enu_m
        left = still_ahead(uav.ways.leg, (east_m, north_m))
        if room >= _ROOM_FOR_PATHS:
            draw(uav.ways.flown, uav_colour(uav.number), 1)
            begun = uav.ways.leg[: len(uav.ways.leg) + 1 - len(left)]
            draw((*begun, (east_m, north_m)), uav_colour(uav.number), 1)
        if uav.ways.leg and not uav.troubled:
            draw(left, uav_colour(uav.number), 2)


def _weight(task: TaskView) -> int:
    """Where tasks share a cell, the one with the most to tell is seen."""
    if task.state is TaskState.DONE:
        return 0
    return 2 if task.taken or task.state is TaskState.FAILED else 1


def _task_look(task: TaskView, signs: Signs) -> tuple[str, str]:
    sign = signs.task(task.stands)
    if task.state is TaskState.FAILED:
        return sign, BAD
    return sign, "bold" if task.uav is None else f"bold {uav_colour(task.uav)}"


def _uav_look(uav: UavView, signs: Signs) -> tuple[str, str]:
    if uav.troubled:
        return signs.uav_lost, BAD
    return signs.uav, f"bold {uav_colour(uav.number)}"


def _framed(lines: list[Text], columns: int, m_per_column: float, signs: Signs) -> list[Text]:
    top_left, top_right, bottom_left, bottom_right = signs.corners
    frame = "dim"
    caption = " map, north up "
    caption = caption if columns >= len(caption) + 2 else ""
    above = Text(f"{top_left}{signs.horizontal}{caption}", frame, no_wrap=True, end="")
    above.append(signs.horizontal * (columns - 1 - len(caption)) + top_right)
    scale = _scale_bar(columns, m_per_column, signs)
    below = Text(bottom_left, frame, no_wrap=True, end="")
    below.append(signs.horizontal * (columns - 1 - len(scale)) + scale + signs.horizontal)
    below.append(bottom_right)
    side = Text(signs.vertical, frame, no_wrap=True, end="")
    return [
        above,
        *(Text.assemble(side, line, side, no_wrap=True, end="") for line in lines),
        below,
    ]


def _scale_bar(columns: int, m_per_column: float, signs: Signs) -> str:
    """A round distance and the length it has on the map."""
    longest_m = m_per_column * max(1, columns // 4)
    power = 10.0 ** math.floor(math.log10(longest_m))
    fitting = (step * power for step in (1.0, 2.0, 5.0) if step * power <= longest_m)
    round_m = max(fitting, default=power)
    cells = max(2, round(round_m / m_per_column))
    left, right = signs.scale
    text = f" {round_m:g} m {left}{signs.horizontal * (cells - 2)}{right} "
    return text if len(text) <= columns - 2 else ""
