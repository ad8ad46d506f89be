"""How near two vehicles came to each other in flight, in closed form between pieces of motion."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from sim.world.flown_path import MotionPiece
from sim.world.motion import Point
from sim.world.track import Track

FloatArray = npt.NDArray[np.float64]

_AT_ONCE = 100_000
"""Pieces of two vehicles that are looked at together."""
_WINDOWS = 64
"""Of time, in each of which a box holds all places of a vehicle."""
_ROUNDED_M = 1e-6
"""What is left to rounding before two are taken to be farther apart than others [m]."""


@dataclass(frozen=True, slots=True)
class TrueApproach:
    """Two vehicles at the instant at which they are nearest."""

    distance_m: float
    """In all three dimensions."""
    at_s: float
    uavs: tuple[str, str]
    places_enu_m: tuple[Point, Point]
    """Where each of them was [m; mission origin]."""


def closest_approach(
    tracks: dict[str, Track], since_s: float = 0.0, until_s: float = math.inf
) -> TrueApproach | None:
    """Of all pairs the nearest, both in the air; None if never two were.

    While both accelerate evenly the square of their distance is a polynomial of degree four, so its
    least value is at an end or at a root of a cubic one. Of equals the first pair and instant.
    Pairs whose boxes are farther apart at all times than others have come are not looked at.

    Args:
        tracks: by UAV.
        since_s: what was before is left out [s].
        until_s: what comes later, alike [s].
    """
    flown = {uav: track.pieces(since_s, until_s) for uav, track in tracks.items()}
    uavs = [uav for uav, pieces in flown.items() if pieces]
    boxes_m = _boxes_m([flown[uav] for uav in uavs])
    nearest: TrueApproach | None = None
    for row, one in enumerate(uavs):
        apart_m = _apart_m(boxes_m, row)
        for other, least_m in zip(uavs[row + 1 :], apart_m, strict=True):
            if nearest is None or least_m < nearest.distance_m:
                nearest = _nearer(nearest, (one, other), (flown[one], flown[other]))
    return nearest


def _boxes_m(flown: Sequence[Sequence[MotionPiece]]) -> FloatArray:
    """(2, n, k, 3) the least and the greatest coordinates of n vehicles in k windows of time [m].

    The last window has no end, as whoever flies then rests. Infinite where one is not there.
    """
    boxes_m = np.full((2, len(flown), _WINDOWS, 3), math.inf)
    boxes_m[1] = -math.inf
    times_s = [time_s for pieces in flown for piece in pieces for time_s in _times_s(piece)]
    if not times_s:
        return boxes_m
    edges_s = np.linspace(min(times_s), max(times_s), _WINDOWS + 1)
    for row, pieces in enumerate(flown):
        begin_s = np.array([[piece.begin_s] for piece in pieces])
        end_s = np.array([[min(piece.end_s, edges_s[-1])] for piece in pieces])
        first_s = np.maximum(begin_s, edges_s[:-1])
        last_s = np.minimum(end_s, edges_s[1:])
        place, velocity, acceleration = _motion(pieces, begin_s[:, 0])[:, :, None]
        first, last = (first_s - begin_s)[:, :, None], (last_s - begin_s)[:, :, None]
        with np.errstate(divide="ignore", invalid="ignore"):
            turns = np.nan_to_num(-velocity / acceleration, posinf=0.0, neginf=0.0)
        turns = np.clip(turns, first, np.maximum(first, last))
        at_s = np.stack(np.broadcast_arrays(first, last, turns))
        at_m = place + at_s * (velocity + 0.5 * at_s * acceleration)
        is_there = (first_s <= last_s)[:, :, None]
        boxes_m[0, row] = np.where(is_there, at_m.min(axis=0), math.inf).min(axis=0)
        boxes_m[1, row] = np.where(is_there, at_m.max(axis=0), -math.inf).max(axis=0)
    return boxes_m


def _times_s(piece: MotionPiece) -> Iterable[float]:
    return (time_s for time_s in (piece.begin_s, piece.end_s) if time_s < math.inf)


def _apart_m(boxes_m: FloatArray, row: int) -> list[float]:
    """Of all vehicles after that one, how far from it each is at all times at least [m]."""
    low_m, high_m = boxes_m[:, row + 1 :]
    gap_m = np.maximum(low_m - boxes_m[1, row], boxes_m[0, row] - high_m)
    least2 = (np.maximum(gap_m, 0.0) ** 2).sum(axis=2).min(axis=1)
    apart_m: list[float] = (np.sqrt(least2) - _ROUNDED_M).tolist()
    return apart_m


def _nearer(
    nearest: TrueApproach | None,
    uavs: tuple[str, str],
    flown: tuple[Sequence[MotionPiece], Sequence[MotionPiece]],
) -> TrueApproach | None:
    """The nearest that these two have come, if nobody has come nearer before."""
    common = list(_common(*flown))
    for first in range(0, len(common), _AT_ONCE):
        distance_m, at_s, number = _nearest(common[first : first + _AT_ONCE])
        if nearest is None or distance_m < nearest.distance_m:
            mine, its, _, _ = common[first + number]
            places_m = mine.position_enu_m(at_s), its.position_enu_m(at_s)
            nearest = TrueApproach(distance_m, at_s, uavs, places_m)
    return nearest


def _common(
    ones: Sequence[MotionPiece], others: Sequence[MotionPiece]
) -> Iterable[tuple[MotionPiece, MotionPiece, float, float]]:
    """Pieces of both that overlap, with the beginning and the end of that; both in order."""
    one, other = 0, 0
    while one < len(ones) and other < len(others):
        mine, its = ones[one], others[other]
        begin_s, end_s = max(mine.begin_s, its.begin_s), min(mine.end_s, its.end_s)
        if begin_s <= end_s and begin_s < math.inf:
            yield mine, its, begin_s, end_s
        if mine.end_s <= its.end_s:
            one += 1
        else:
            other += 1


def _nearest(
    common: Sequence[tuple[MotionPiece, MotionPiece, float, float]],
) -> tuple[float, float, int]:
    """Least distance [m] of two that are there at the same time, when [s], and which two."""
    begin_s = np.array([begin for _, _, begin, _ in common])
    lasts_s = np.array([0.0 if end == math.inf else end - begin for _, _, begin, end in common])
    place, velocity, acceleration = _motion([mine for mine, _, _, _ in common], begin_s) - _motion(
        [its for _, its, _, _ in common], begin_s
    )
    # d² = |p + v t + a t²/2|², its slope half: p·v + (v² + p·a) t + 1.5 v·a t² + a²/2 t³.
    slope = np.stack(
        [
            0.5 * (acceleration * acceleration).sum(axis=1),
            1.5 * (velocity * acceleration).sum(axis=1),
            (velocity * velocity).sum(axis=1) + (place * acceleration).sum(axis=1),
            (place * velocity).sum(axis=1),
        ]
    )
    candidates_s = np.concatenate([np.zeros((1, len(common))), lasts_s[None], _roots(slope)])
    candidates_s = np.clip(candidates_s, 0.0, lasts_s)
    since_s = candidates_s[:, :, None]
    offset_m = place + since_s * (velocity + 0.5 * since_s * acceleration)
    distance_m = np.sqrt((offset_m * offset_m).sum(axis=2))
    best = np.unravel_index(distance_m.T.argmin(), distance_m.T.shape)
    row, number = int(best[1]), int(best[0])
    at_s = float(begin_s[number] + candidates_s[row, number])
    return float(distance_m[row, number]), at_s, number


def _motion(pieces: Sequence[MotionPiece], at_s: FloatArray) -> FloatArray:
    """(3, n, 3) places, velocities and accelerations of n pieces at n instants."""
    place = np.array([piece.place_enu_m for piece in pieces])
    velocity = np.array([piece.velocity_enu_m_s for piece in pieces])
    acceleration = np.array([piece.acceleration_enu_m_s2 for piece in pieces])
    since_s = (at_s - np.array([piece.begin_s for piece in pieces]))[:, None]
    return np.stack(
        [
            place + since_s * (velocity + 0.5 * since_s * acceleration),
            velocity + since_s * acceleration,
            acceleration,
        ]
    )


def _roots(cubic: FloatArray) -> FloatArray:
    """(3, n) real roots of (4, n) polynomials, highest power first; 0 where there are fewer.

    What is no real root is harmless too: a place on the way is never nearer than the nearest.
    """
    cubed, squared, linear, constant = cubic
    roots = np.zeros((3, cubic.shape[1]))
    curved = cubed > 1e-12 * (np.abs(squared) + np.abs(linear) + np.abs(constant))
    straight = ~curved & (linear > 0.0)
    roots[0, straight] = -constant[straight] / linear[straight]
    if curved.any():
        monic = cubic[1:, curved] / cubed[curved]
        companion = np.zeros((monic.shape[1], 3, 3))
        companion[:, 0, :] = -monic.T
        companion[:, 1, 0] = companion[:, 2, 1] = 1.0
        roots[:, curved] = np.linalg.eigvals(companion).real.T
    return roots
