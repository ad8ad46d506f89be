"""One flight to one place, by a mission that ends at home.

Arrival is the vehicle's own position and speed, as with any leg, but only while the
verified mission's target is what it flies to. A vehicle that never comes to rest there, as
in strong wind, has arrived too if it says that it reached the item and is near. Leaves out:
the mission itself (agent.mavlink.standing_mission).
"""

from __future__ import annotations

from collections.abc import Sequence

from agent.mavlink.commands import CommandEnded
from agent.mavlink.config import BridgeConfig
from agent.mavlink.leg import Approach, Nearness
from agent.mavlink.messages import Outbound
from agent.mavlink.standing_mission import StandingMission

__all__ = ["MissionLeg"]

Point = tuple[float, float, float]


class MissionLeg:
    """A target that stands on the vehicle, or is on its way there.

    Args:
        target_enu_m: where to stop [m; mission origin].
        stay_s: how long the UAV is going to stay there [s].
        speed_m_s: cruise ground speed.
        config: radius, speed and patience.
        mission: the vehicle's.
    """

    def __init__(
        self,
        target_enu_m: Point,
        stay_s: float,
        speed_m_s: float,
        config: BridgeConfig,
        mission: StandingMission,
    ) -> None:
        self._target_enu_m = target_enu_m
        self._stay_s = stay_s
        self._speed_m_s = speed_m_s
        self._mission = mission
        self._approach = Approach(target_enu_m, config)
        self._given_up: str | None = None
        self._arrived = False

    @property
    def arrived(self) -> bool:
        """The vehicle was seen to stop at the target, or says that it reached it."""
        return self._arrived or self._mission.reached

    @property
    def failure(self) -> str | None:
        """Why the target could not be put in force or reached; None while it may."""
        return self._given_up or self._mission.failure

    @property
    def stopped(self) -> str | None:
        """None: who stops a vehicle changes its mode."""
        return None

    def start(self, now_s: float) -> Sequence[Outbound]:
        """Put the target in force, in place of whatever stands on the vehicle."""
        return self._mission.fly_to(self._target_enu_m, self._stay_s, self._speed_m_s, now_s)

    def on_ended(self, ended: CommandEnded) -> None:
        """Nothing: the mission takes the outcomes of its commands itself."""

    def ignored(self, text: str) -> None:
        """Nothing: a mission is taken as a whole, or not."""

    def on_position(
        self, position_enu_m: Point, velocity_enu_m_s: Point, now_s: float
    ) -> Sequence[Outbound]:
        """Judge arrival."""
        if self.arrived or not self._mission.is_flown:
            return []
        match self._approach.judge(position_enu_m, velocity_enu_m_s, now_s):
            case Nearness.ARRIVED:
                self._arrived = True
            case Nearness.STALLED:
                self._mission.restart(now_s)
            case Nearness.GIVEN_UP:
                self._given_up = self._approach.complaint
            case Nearness.UNDERWAY:
                pass
        return []
