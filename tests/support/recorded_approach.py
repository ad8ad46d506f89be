"""How near UAVs came to each other, read from a recording by its documented topics alone.

A second way to the figure that reports, status and dashboard tell: whoever has the mcap package and
the table of topics in coordinator/README.md can do the same. Nothing of ours is imported here.
"""

from __future__ import annotations

import bisect
import itertools
import json
import math
from pathlib import Path
from typing import Any, NamedTuple

from mcap.reader import make_reader

Place = tuple[float, float, float]
AT_A_BASE_M = 20.0
OFF_THE_GROUND_M = 1.0
GAP_S = 5.0
GAP_STATUSES = 10


class Piece(NamedTuple):
    """From one status of a UAV in flight to its next."""

    started: bool
    begin_s: float
    end_s: float
    begin_m: Place
    end_m: Place

    def at(self, at_s: float) -> list[float]:
        """Where it is, evenly flown."""
        share = (at_s - self.begin_s) / (self.end_s - self.begin_s)
        return [a + share * (b - a) for a, b in zip(self.begin_m, self.end_m, strict=True)]


def closest_approach(path: Path) -> tuple[float, tuple[str, str], float | None] | None:
    """Least distance [m] of two UAVs in flight, who, and when [s of mission; None before it]."""
    nearest: tuple[float, tuple[str, str], float | None] | None = None
    ways = _ways(path)
    for one, other in itertools.combinations(sorted(ways), 2):
        ends_s = [piece.end_s for piece in ways[other]]
        for mine in ways[one]:
            for its in ways[other][bisect.bisect_left(ends_s, mine.begin_s) :]:
                if its.begin_s > mine.end_s:
                    break
                if its.started == mine.started:
                    distance_m, at_s = _nearest(mine, its)
                    if nearest is None or distance_m < nearest[0]:
                        nearest = distance_m, (one, other), at_s if mine.started else None
    return nearest


def _nearest(one: Piece, other: Piece) -> tuple[float, float]:
    begin_s, end_s = max(one.begin_s, other.begin_s), min(one.end_s, other.end_s)
    first, last = (
        [a - b for a, b in zip(one.at(at_s), other.at(at_s), strict=True)]
        for at_s in (begin_s, end_s)
    )
    change = [b - a for a, b in zip(first, last, strict=True)]
    square = sum(c * c for c in change)
    share = -sum(a * c for a, c in zip(first, change, strict=True)) / square if square else 0.0
    share = min(1.0, max(0.0, share))
    apart_m = math.hypot(*(a + share * c for a, c in zip(first, change, strict=True)))
    return apart_m, begin_s + share * (end_s - begin_s)


def _ways(path: Path) -> dict[str, list[Piece]]:
    """By UAV, what it flew as far as it told."""
    brief: dict[str, Any] | None = None
    newest: dict[str, tuple[int, int]] = {}
    last: dict[str, tuple[bool, float, Place] | None] = {}
    ways: dict[str, list[Piece]] = {}
    with path.open("rb") as file:
        reader = make_reader(file)
        about = next(data.metadata for data in reader.iter_metadata() if data.name == "peckorder")
        gap_s = max(GAP_S, GAP_STATUSES * json.loads(about["timing"])["status_s"])
        for schema, _, message in reader.iter_messages(log_time_order=False):
            if schema is None or schema.name not in ("peckorder.Brief", "peckorder.Status"):
                continue
            said = json.loads(message.data)
            if schema.name == "peckorder.Brief":
                brief = said["body"]
                continue
            uav, stamp = said["writer"], (said["incarnation"], said["counter"])
            if brief is None or stamp <= newest.get(uav, (0, 0)):
                continue
            newest[uav] = stamp
            fix = _fix(said, brief)
            before, last[uav] = last.get(uav), fix
            if fix is None or before is None:
                continue
            if before[0] == fix[0] and fix[1] <= before[1]:
                last[uav] = before
            elif before[0] == fix[0] and fix[1] - before[1] <= gap_s:
                ways.setdefault(uav, []).append(Piece(fix[0], before[1], fix[1], before[2], fix[2]))
    return ways


def _fix(said: dict[str, Any], brief: dict[str, Any]) -> tuple[bool, float, Place] | None:
    """Whether the mission had started, when and where; None on the ground or not told."""
    body = said["body"]
    spec = next((each for each in brief["uavs"] if each["id"] == said["writer"]), None)
    if body["position_enu_m"] is None or body["phase"] == "home" or spec is None:
        return None
    east_m, north_m, up_m = body["position_enu_m"]
    up_m += spec["layer_m"] if body["layer_m"] is None else body["layer_m"]
    grounds = [spec["position_enu_m"], *(base["position_enu_m"] for base in brief["bases"])]
    for ground in grounds:
        away_m = math.hypot(east_m - ground[0], north_m - ground[1])
        if away_m <= AT_A_BASE_M and up_m <= ground[2] + OFF_THE_GROUND_M:
            return None
    started = body["mission_s"] is not None
    return started, body["mission_s"] if started else said["now_s"], (east_m, north_m, up_m)
