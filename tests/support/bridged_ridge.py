"""A mission over hills flown by real bridges and simulated autopilots, looked at from the ground.

Ten times a second it is looked how high every vehicle in flight is above the ground, and above the
line that it flies.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace
from functools import partial

from agent.core.agent_core import AgentCore
from agent.core.interface import GoTo
from agent.core.path_clearance import PATH_CLEARANCE_M
from agent.core.verticals import Verticals
from agent.vehicle.config import CommandStyle
from sim.autopilot.config import fleet_of
from sim.autopilot.firmware import FirmwareModelName
from sim.world.bridged_vehicle import Equipment
from swarm.allocation.legs.ground import ground_of
from swarm.model import Mission, TaskId
from tests.support.bridged_fleet import BridgedFleet

LOOK_S = 0.1
UPRIGHT_M = 12.0
"""Who is no farther from where vehicles stand may take off or land."""
ENDS_M = 10.0
"""At the ends of lines vehicles come from their layers, and leave for them."""


class RidgeFleet(BridgedFleet):
    """A mission with a terrain, about to be flown.

    Args:
        flavour: of all autopilots.
        style: how all bridges command.
        mission: flown.
        guard: whether bridges know the ground.
    """

    def __init__(
        self,
        flavour: FirmwareModelName,
        style: CommandStyle,
        mission: Mission,
        *,
        guard: bool = True,
    ) -> None:
        assert mission.terrain is not None
        members = {str(member.uav): member.config for member in fleet_of(mission)}

        def equip(uav: str, equipment: Equipment) -> Equipment:
            bridge = replace(
                equipment.bridge,
                ready_by_itself=True,
                zones=mission.zones,
                terrain=mission.terrain if guard else None,
            )
            return replace(equipment, vehicle=members[uav], bridge=bridge)

        super().__init__(
            flavour,
            style,
            change={uav: partial(equip, uav) for uav in members},
            mission=mission,
            agent=partial(AgentCore, path_clearance_m=PATH_CLEARANCE_M, verticals=Verticals()),
        )
        self._ground = ground_of(mission.terrain)
        places = [uav.position_enu_m for uav in mission.uavs]
        places += [base.position_enu_m for base in mission.bases]
        self._stands = [place[:2] for place in places]
        self._lines = {task.id: task for task in mission.tasks if task.path_enu_m}
        self.lowest_m = math.inf
        """Least height above the ground that was seen in flight."""
        self.lowest_at: tuple[object, ...] = ()
        self.line_heights_m: dict[str, list[float]] = {}
        """By line, heights above the ground less what was asked for."""
        self.when_seen: Callable[[str, tuple[float, float, float]], None] = lambda _uav, _at: None
        """Is told where every vehicle is in flight."""
        self.at(LOOK_S, self._look)

    def _look(self) -> None:
        now_s = self.world.queue.now_s()
        for uav in self.books:
            pilot = self.vehicles[uav]._machine.pilot
            place = pilot.position_enu_m(now_s)
            upright = any(math.dist(place[:2], stand) <= UPRIGHT_M for stand in self._stands)
            if pilot.flight.on_ground or upright:
                continue
            above_m = place[2] - self._ground.one_up_m(*place[:2])
            if above_m < self.lowest_m:
                self.lowest_m, self.lowest_at = above_m, (round(now_s, 1), uav, place)
            self._look_along(uav, place, above_m)
            self.when_seen(uav, place)
        self.at(now_s + LOOK_S, self._look)

    def _look_along(self, uav: str, place: tuple[float, float, float], above_m: float) -> None:
        order = self.books[uav].ordered[-1][1]
        if not isinstance(order, GoTo) or not order.trigger_m:
            return
        task = self._lines[TaskId(order.task or "")]
        ends = task.path_enu_m[0][:2], task.path_enu_m[-1][:2]
        if task.height_m is None or min(math.dist(place[:2], end) for end in ends) <= ENDS_M:
            return
        self.line_heights_m.setdefault(task.id, []).append(above_m - task.height_m)
