"""A camera that looks straight down: what a picture shows, from how high and how sharp.

After P. R. Wolf, B. A. Dewitt and B. E. Wilkinson, Elements of Photogrammetry, 4th ed. 2014,
chapters 6 (scale of a vertical picture) and 18 (overlap and spacing). The ground is flat here.
"""

from __future__ import annotations

import math
from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class Camera:
    """Sensor and lens, by their numbers.

    Raises:
        ValueError: a size, length or time is not > 0.
    """

    sensor_width_mm: float
    """Longer side of the sensor [mm]."""
    sensor_height_mm: float
    """Shorter side of the sensor [mm]."""
    focal_length_mm: float
    """Of the lens itself [mm], not what would show as much on 35 mm film."""
    image_width_px: int
    """Pixels along `sensor_width_mm`."""
    image_height_px: int
    """Pixels along `sensor_height_mm`."""
    landscape: bool = True
    """Whether `sensor_width_mm` lies across the direction of flight; else along it."""
    exposure_s: float = 0.001
    """How long it takes light in for a picture [s]."""

    def __post_init__(self) -> None:
        for name in (
            "sensor_width_mm",
            "sensor_height_mm",
            "focal_length_mm",
            "image_width_px",
            "image_height_px",
            "exposure_s",
        ):
            number = getattr(self, name)
            if not (math.isfinite(number) and number > 0.0):
                raise ValueError(f"{name} of a camera must be > 0, not {number}")

    def footprint_m(self, height_m: float) -> tuple[float, float]:
        """Ground in a picture from ``height_m`` above it: across and along the flight [m].

        Sides of the sensor times height ÷ focal length, similar triangles.
        """
        scale = height_m / self.focal_length_mm
        across_mm, along_mm = self.sensor_width_mm, self.sensor_height_mm
        if not self.landscape:
            across_mm, along_mm = along_mm, across_mm
        return across_mm * scale, along_mm * scale

    def ground_sample_m(self, height_m: float) -> float:
        """Ground in one pixel from ``height_m`` above it [m]; the coarser of both directions."""
        scale = height_m / self.focal_length_mm
        return scale * max(
            self.sensor_width_mm / self.image_width_px,
            self.sensor_height_mm / self.image_height_px,
        )

    def blur_px(self, height_m: float, speed_m_s: float) -> float:
        """How far the ground moves on the picture while it is exposed [pixels]."""
        return speed_m_s * self.exposure_s / self.ground_sample_m(height_m)
