"""What a survey is worth to who looks at its pictures: coverage, overlaps, sharpness, how many.

Heights are taken to be above flat ground.
"""

from __future__ import annotations

import math
from collections.abc import Collection, Sequence
from dataclasses import dataclass

from swarm.model import Area, AreaId, Mission, Task, TaskId
from swarm.survey.coverage import AreaCoverage


@dataclass(frozen=True, slots=True)
class AreaFacts:
    """One area of a mission, its lines and its pictures. What is not known is None."""

    area: AreaId
    to_cover_m2: float
    """What is to be covered: without holes, and without zones with their margin [m²]."""
    lines: int
    """Of the mission, whoever flies them."""
    length_m: float
    """Of all of them together [m]."""
    apart_m: float
    """Between neighbouring lines at most [m]."""
    picture_m: float | None
    """Between pictures of a line [m]."""
    pictures: int | None
    """That all lines give."""
    sidelap_frac: float | None
    frontlap_frac: float | None
    ground_sample_m: float | None
    """Ground in a pixel [m]."""
    blur_px: float | None
    """Of the fastest UAV's pictures [pixels]."""
    every_s: float | None
    """Between two pictures of the fastest UAV [s]."""
    lines_planned: int
    coverage_planned: float
    """Share of what is to be covered that planned lines cover; within 0..1."""
    lines_flown: int | None
    coverage_flown: float | None
    """Share that flown lines cover; None before a flight."""


def area_facts(
    mission: Mission,
    planned: Collection[TaskId],
    flown: Collection[TaskId] | None = None,
) -> tuple[AreaFacts, ...]:
    """Of every area of ``mission``.

    Args:
        mission: its tasks are those that there are in the end, pop-ups included.
        planned: tasks on any list.
        flown: tasks that were done; a line that was left half way is not. None: nobody has flown.
    """
    on_lists = frozenset(planned)
    done = None if flown is None else frozenset(flown)
    return tuple(_facts(mission, area, on_lists, done) for area in mission.areas)


def _facts(
    mission: Mission,
    area: Area,
    planned: frozenset[TaskId],
    flown: frozenset[TaskId] | None,
) -> AreaFacts:
    coverage = AreaCoverage(area, mission.tasks, mission.zones, mission.zone_margin_m)
    lengths_m = [_length_m(line) for line in coverage.lines.values()]
    speed_m_s = max((uav.speed_m_s for uav in mission.uavs), default=0.0)
    picture_m, camera, height_m = area.picture_m, area.camera, area.height_m
    sees = None if camera is None or height_m is None else (camera, height_m)
    return AreaFacts(
        area=area.id,
        to_cover_m2=coverage.to_cover_m2,
        lines=len(lengths_m),
        length_m=math.fsum(lengths_m),
        apart_m=area.apart_m,
        picture_m=picture_m,
        pictures=None if picture_m is None else pictures(lengths_m, picture_m),
        sidelap_frac=area.sidelap_frac,
        frontlap_frac=area.frontlap_frac,
        ground_sample_m=None if sees is None else sees[0].ground_sample_m(sees[1]),
        blur_px=None if sees is None else sees[0].blur_px(sees[1], speed_m_s),
        every_s=None if picture_m is None or speed_m_s == 0.0 else picture_m / speed_m_s,
        lines_planned=sum(line in planned for line in coverage.lines),
        coverage_planned=coverage.share(planned),
        lines_flown=None if flown is None else sum(line in flown for line in coverage.lines),
        coverage_flown=None if flown is None else coverage.share(flown),
    )


def pictures(lengths_m: Sequence[float], picture_m: float) -> int:
    """How many pictures lines give: one at the beginning of each, then every ``picture_m``."""
    return sum(math.floor(length_m / picture_m + 1e-9) + 1 for length_m in lengths_m)


def _length_m(line: Task) -> float:
    ends = zip(line.path_enu_m, line.path_enu_m[1:], strict=False)
    return math.fsum(math.dist(begin, end) for begin, end in ends)
