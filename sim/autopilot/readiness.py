"""What a vehicle still lacks before it may fly, as a function of the time since boot."""

from __future__ import annotations

import math
from enum import Enum

from sim.autopilot.config import Delays
from sim.autopilot.flight import FlightMode
from sim.world.motion import Point


class PowerUpStage(Enum):
    """Something that has just become ready."""

    BOOTED = "booted"
    SENSORS = "sensors"
    ORIGIN = "origin"
    POSITION = "position"


_BY_GPS = frozenset({PowerUpStage.ORIGIN, PowerUpStage.POSITION})


class Readiness:
    """Power-up as a sequence of stages with fixed delays.

    States follow from the stages that were passed, not from the clock, so that
    what is reported changes exactly when the change is announced.
    """

    def __init__(self, delays: Delays, boot_s: float) -> None:
        self.boot_s = boot_s
        """When power came on [s]."""
        self._ahead: list[tuple[float, PowerUpStage]] = [
            (boot_s + delays.boot_s, PowerUpStage.BOOTED),
            (boot_s + delays.sensors_s, PowerUpStage.SENSORS),
            (boot_s + delays.origin_s, PowerUpStage.ORIGIN),
            (boot_s + delays.position_s, PowerUpStage.POSITION),
        ]
        self._passed: set[PowerUpStage] = set()
        self.last_fix_enu_m: Point | None = None
        """Where the receiver lost the satellites [m]; None while it sees them."""
        self._gps_lost_s = boot_s
        self.defect: str | None = None
        """What a check found that keeps the vehicle from arming, if any."""

    @property
    def gps_lost(self) -> bool:
        """Whether the receiver has lost the satellites."""
        return self.last_fix_enu_m is not None

    @property
    def booted(self) -> bool:
        """Whether the autopilot is initialised."""
        return PowerUpStage.BOOTED in self._passed

    @property
    def has_origin(self) -> bool:
        """Whether GPS has a fix, so that the vehicle tells where it is."""
        return PowerUpStage.ORIGIN in self._passed

    @property
    def has_position(self) -> bool:
        """Whether the position estimate is good enough to navigate by."""
        return PowerUpStage.POSITION in self._passed and not self.gps_lost

    def lost_s(self, now_s: float) -> float:
        """How long there has been no position [s]; 0 while there is, inf if there never was."""
        if PowerUpStage.POSITION not in self._passed:
            return math.inf
        return now_s - self._gps_lost_s if self.gps_lost else 0.0

    def lose_gps(self, last_fix_enu_m: Point, now_s: float) -> None:
        """See no satellites from now on; stages that need them wait."""
        self.last_fix_enu_m = last_fix_enu_m
        self._gps_lost_s = now_s

    def regain_gps(self, now_s: float) -> None:
        """See them again; stages that need them are as much later as that took."""
        if self.last_fix_enu_m is not None:
            self.last_fix_enu_m = None
            lost_s = now_s - self._gps_lost_s
            self._ahead = [
                (due_s + lost_s if stage in _BY_GPS else due_s, stage)
                for due_s, stage in self._ahead
            ]

    def deadline_s(self) -> float | None:
        """When the next stage is due [s]; None once all are passed, or while GPS lacks."""
        if not self._ahead or (self.gps_lost and self._ahead[0][1] in _BY_GPS):
            return None
        return self._ahead[0][0]

    def advance(self) -> PowerUpStage:
        """Pass the next stage, of which there must be one."""
        if not self._ahead:
            raise ValueError("no stage is left to pass")
        _, stage = self._ahead.pop(0)
        self._passed.add(stage)
        return stage

    def obstacle(self, mode: FlightMode) -> str | None:
        """Why ``mode`` can't be armed, in the autopilot's words; None when it can."""
        if not self.booted:
            return "System not initialised"
        if PowerUpStage.SENSORS not in self._passed:
            return "Accels inconsistent"
        if mode.needs_position and not self.has_position:
            return "Need Position Estimate"
        return self.defect
