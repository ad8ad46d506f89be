"""How near vehicles came to the ground in flight, looked at all along their tracks."""

from __future__ import annotations

import math
from collections.abc import Mapping

import numpy as np

from sim.world.flown_path import MotionPiece
from sim.world.track import Track
from swarm.model.terrain import Terrain

_EVERY_S = 0.05
_MOST = 20_000
"""Looks at one piece."""


def lowest_clearance(tracks: Mapping[str, Track], terrain: Terrain | None) -> float | None:
    """Least height above the ground [m]; None if nobody was in the air, or without a terrain.

    Ideal vehicles take off and land in no time, so all of their flight counts.

    Args:
        tracks: by UAV.
        terrain: the ground.
    """
    pieces = [piece for track in tracks.values() for piece in track.pieces()]
    if terrain is None or not pieces:
        return None
    from swarm.allocation.legs.ground import ground_of

    places_m = np.concatenate([_places_m(piece) for piece in pieces])
    ground_m = ground_of(terrain).up_m(np.ascontiguousarray(places_m[:, :2]))
    return float((places_m[:, 2] - ground_m).min())


def _places_m(piece: MotionPiece) -> np.ndarray[tuple[int, ...], np.dtype[np.float64]]:
    """(n, 3) places of one piece, its ends included [m]."""
    lasts_s = piece.end_s - piece.begin_s if math.isfinite(piece.end_s) else 0.0
    count = min(_MOST, 2 + int(lasts_s / _EVERY_S))
    at_s = np.linspace(0.0, lasts_s, count)[:, None]
    velocity, acceleration = piece.velocity_enu_m_s, piece.acceleration_enu_m_s2
    moved_m = at_s * (np.array(velocity) + 0.5 * at_s * np.array(acceleration))
    places_m: np.ndarray[tuple[int, ...], np.dtype[np.float64]] = piece.place_enu_m + moved_m
    return places_m
