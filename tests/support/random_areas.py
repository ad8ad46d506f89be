"""Areas and zones drawn at random: dented outlines, holes, zones across borders."""

from __future__ import annotations

import numpy as np

from swarm.model import Area, AreaId, Zone, ZoneId
from swarm.model.rings import Ring


def random_area(rng: np.random.Generator, **given: object) -> tuple[Area, tuple[Zone, ...], float]:
    """An area of some hundred metres, zones about it, and their margin [m]."""
    outline = ring(rng, 300.0)
    holes: tuple[Ring, ...] = ()
    if rng.random() < 0.5:
        holes = (tuple((0.3 * east_m, 0.3 * north_m) for east_m, north_m in outline),)
    zones = [
        Zone(ZoneId(f"z{number}"), ring(rng, 80.0, off_m=250.0))
        for number in range(rng.integers(0, 4))
    ]
    if rng.random() < 0.3:
        keep = ring(rng, 350.0, off_m=50.0)
        zones.append(Zone(ZoneId("keep"), keep, inclusive=True))
    margin_m = float(rng.choice([0.0, 3.0, 15.0]))
    asked = {"spacing_m": float(rng.uniform(8.0, 60.0)), "max_line_m": 150.0} | given
    area = Area(AreaId("a"), outline, 10.0, holes, **asked)  # type: ignore[arg-type]
    return area, tuple(zones), margin_m


def ring(rng: np.random.Generator, radius_m: float, off_m: float = 0.0) -> Ring:
    """Corners between a third of ``radius_m`` and all of it from a place that lies inside.

    That place is no further from the origin than ``off_m`` to each side.
    """
    middle_m = rng.uniform(-off_m, off_m, 2)
    corners = int(rng.integers(4, 11))
    angles_rad = (np.arange(corners) + rng.uniform(0.1, 0.9, corners)) * (2.0 * np.pi / corners)
    radii_m = rng.uniform(radius_m / 3.0, radius_m, corners)
    points_m = np.stack([np.cos(angles_rad), np.sin(angles_rad)], axis=1) * radii_m[:, None]
    return tuple((east_m, north_m) for east_m, north_m in (points_m + middle_m).tolist())
