"""Cameras that people fly, by name.

Where a source is QGC the numbers are those of QGroundControl's list of cameras (CameraMetaData).
Others are confirmed by what else is public: the tables of sensors of OpenSfM (opensfm/data), with
which OpenDroneMap works, those of OpenAthena (Theta-Limited/DroneModels), and what cameras write
into their pictures (EXIF). Sensors are nominal: calibrated widths that OpenAthena has are 3 %
smaller for 1-inch sensors and up to 4 % greater for Four Thirds, so the ground in a picture is
known to a few percent.

| name | sensor [mm] | lens [mm] | pixels | source |
|---|---|---|---|---|
| canon-eos-m-22mm | 22.3 × 14.9 | 22 | 5184 × 3456 | QGC |
| canon-s100 | 7.6 × 5.7 | 5.2 | 4000 × 3000 | QGC |
| canon-sx260 | 6.17 × 4.55 | 4.5 | 4000 × 3000 | QGC |
| dji-mavic-2-pro | 13.2 × 8.8 | 10.26 | 5472 × 3648 | OpenAthena, L1D-20c; lens as in its EXIF |
| dji-mavic-3e | 17.3 × 13.0 | 12.29 | 5280 × 3956 | OpenAthena, M3E; lens as in its EXIF |
| dji-phantom-4-pro | 13.2 × 8.8 | 8.8 | 5472 × 3648 | OpenSfM and OpenAthena, FC6310 |
| dji-zenmuse-p1-35mm | 35.9 × 24.0 | 35 | 8192 × 5460 | OpenSfM, ZENMUSEP1 |
| dji-zenmuse-x5s-15mm | 17.3 × 13.0 | 15 | 5280 × 3956 | OpenAthena, FC6520; the lens by its name |
| micasense-rededge-m | 4.8 × 3.6 | 5.5 | 1280 × 960 | QGC, each band |
| ricoh-gr-ii | 23.7 × 15.7 | 18.3 | 4928 × 3264 | QGC |
| sensefly-soda | 13.13 × 8.75 | 10.6 | 5472 × 3648 | EXIF: 4167 pixels per centimetre |
| sony-a6000-16mm | 23.5 × 15.6 | 16 | 6000 × 4000 | QGC |
| sony-qx1-16mm | 23.2 × 15.4 | 16 | 5456 × 3632 | QGC |
| sony-rx1r-ii | 35.9 × 24.0 | 35 | 7952 × 5304 | QGC |

The shutter is taken to be open for a thousandth of a second, as in daylight, and the longer side
of the picture to lie across the flight.
"""

from __future__ import annotations

from collections.abc import Mapping

from swarm.model import Camera

CAMERAS: Mapping[str, Camera] = {
    "canon-eos-m-22mm": Camera(22.3, 14.9, 22.0, 5184, 3456),
    "canon-s100": Camera(7.6, 5.7, 5.2, 4000, 3000),
    "canon-sx260": Camera(6.17, 4.55, 4.5, 4000, 3000),
    "dji-mavic-2-pro": Camera(13.2, 8.8, 10.26, 5472, 3648),
    "dji-mavic-3e": Camera(17.3, 13.0, 12.29, 5280, 3956),
    "dji-phantom-4-pro": Camera(13.2, 8.8, 8.8, 5472, 3648),
    "dji-zenmuse-p1-35mm": Camera(35.9, 24.0, 35.0, 8192, 5460),
    "dji-zenmuse-x5s-15mm": Camera(17.3, 13.0, 15.0, 5280, 3956),
    "micasense-rededge-m": Camera(4.8, 3.6, 5.5, 1280, 960),
    "ricoh-gr-ii": Camera(23.7, 15.7, 18.3, 4928, 3264),
    "sensefly-soda": Camera(13.13, 8.75, 10.6, 5472, 3648),
    "sony-a6000-16mm": Camera(23.5, 15.6, 16.0, 6000, 4000),
    "sony-qx1-16mm": Camera(23.2, 15.4, 16.0, 5456, 3632),
    "sony-rx1r-ii": Camera(35.9, 24.0, 35.0, 7952, 5304),
}
"""Known ones, by name."""


def name_of(camera: Camera) -> str | None:
    """What the list calls a camera of these very numbers; None if none is."""
    return next((name for name, known in CAMERAS.items() if known == camera), None)
