"""A mission of the field flown by real bridges and simulated autopilots, watched all the way.

Twice a second it is looked whether any vehicle is in a zone, is in the air with less than its
reserve, or has started without the word of a person where that is asked for.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace
from functools import partial

from agent.core.agent_core import AgentCore
from agent.core.interface import Landed, Swapped, VehicleReport
from agent.core.path_clearance import PATH_CLEARANCE_M
from agent.core.verticals import Verticals
from agent.vehicle.activity import FlightPhase
from agent.vehicle.config import CommandStyle
from coordinator.operator.readiness import ReadyRequest
from coordinator.operator.requests import OperatorRequest
from sim.autopilot.config import fleet_of
from sim.autopilot.firmware import FirmwareModelName
from sim.autopilot.pilot import Pilot
from sim.world.bridged_vehicle import Equipment
from swarm.model import Base, BaseId, Mission, Task, TaskId, Uav, UavId, Zone, ZoneId
from tests.support.bridged_fleet import BridgedFleet, Sent

RESERVE_FRAC = 0.2
HERD = Zone(ZoneId("herd"), ((90.0, -60.0), (130.0, -60.0), (130.0, 20.0), (90.0, 20.0)))
BARN = Base(BaseId("barn"), (40.0, -40.0, 0.0), swap_s=15.0, slots=1)
PLACES = ((60, 120), (160, 160), (220, 60), (200, -110), (110, -150), (40, -130))
UAVS = ("u0", "u1")
_LOOK_S = 0.5
_LATE_S = 8.0
"""By so much a last leg and a first landing may take longer than anybody knew."""
_LIFTED_M = 0.5
"""Who is higher above the ground is in the air."""


def pasture(endurance_s: float = 170.0) -> Mission:
    """Two UAVs and six tasks round a herd, with batteries for about half of the way."""
    uavs = [
        Uav(
            UavId(name),
            (15.0 * number, 0.0, 0.0),
            10.0,
            acceleration_m_s2=2.5,
            endurance_s=endurance_s,
            reserve_frac=RESERVE_FRAC,
        )
        for number, name in enumerate(UAVS)
    ]
    tasks = [
        Task(TaskId(f"t{number}"), (float(east_m), float(north_m), 0.0), 5.0, service_s=8.0)
        for number, (east_m, north_m) in enumerate(PLACES)
    ]
    return Mission(
        name="pasture",
        horizon_s=900.0,
        uavs=tuple(uavs),
        tasks=tuple(tasks),
        bases=(BARN,),
        zones=(HERD,),
        zone_margin_m=5.0,
    )


class PastureFleet(BridgedFleet):
    """That mission, about to be flown.

    Args:
        flavour: of both autopilots.
        style: how both bridges command.
        by_itself: whether vehicles start again without anybody's word.
        drain: how many times as fast as it should each battery drains.
        mission: flown.
    """

    def __init__(
        self,
        flavour: FirmwareModelName,
        style: CommandStyle,
        *,
        by_itself: bool = True,
        drain: float = 1.0,
        mission: Mission | None = None,
        seed: int = 0,
    ) -> None:
        flown = mission or pasture()
        members = {str(member.uav): member.config for member in fleet_of(flown)}

        def equip(uav: str, equipment: Equipment) -> Equipment:
            config = members[uav]
            assert config.endurance_s is not None
            vehicle = replace(config, endurance_s=config.endurance_s / drain)
            bridge = replace(
                equipment.bridge,
                ready_by_itself=by_itself,
                battery_reserve_frac=RESERVE_FRAC / 2.0,
                zones=flown.zones,
                zone_margin_m=flown.zone_margin_m,
            )
            return replace(equipment, vehicle=vehicle, bridge=bridge)

        super().__init__(
            flavour,
            style,
            change={uav: partial(equip, uav) for uav in members},
            mission=flown,
            seed=seed,
            agent=partial(AgentCore, path_clearance_m=PATH_CLEARANCE_M, verticals=Verticals()),
        )
        self.zones: list[Zone] = list(flown.zones)
        """Where nobody may be from now on."""
        self.unsafe: list[str] = []
        """What should not have been."""
        endurance_s = min(uav.endurance_s or math.inf for uav in flown.uavs)
        self._tolerance_frac = _LATE_S / endurance_s
        self.lowest_frac = 1.0
        """Charge with which anybody was in the air."""
        self._by_itself = by_itself
        self._let_start: set[str] = set()
        self._stood: set[str] = set()
        self._moments: list[
            tuple[str, Callable[[Sent | VehicleReport], bool], float, Callable[[], None]]
        ] = []
        self.on_said = self._hear
        self.at(_LOOK_S, self._look)

    def want(self, at_s: float, wish: OperatorRequest) -> None:
        """Let an operator say that."""
        if isinstance(wish, ReadyRequest):
            self.at(at_s, lambda: self._let_start.add(wish.target))
        self.at(at_s, lambda: self.seats.append(self.world.operate(wish)))

    def once(
        self,
        uav: str,
        said: Callable[[Sent | VehicleReport], bool],
        after_s: float,
        act: Callable[[], None],
    ) -> None:
        """Do that so long after that UAV's bridge has first said such a thing."""
        self._moments.append((uav, said, after_s, act))

    def swaps(self, uav: str) -> int:
        """How often it has got another battery."""
        return sum(isinstance(said, Swapped) for _, said in self.books[uav].reported)

    def pilot(self, uav: str) -> Pilot:
        """Its autopilot, looked at only."""
        return self.vehicles[uav]._machine.pilot

    def is_aloft(self, uav: str) -> bool:
        """Whether its vehicle is in the air."""
        now_s = self.world.queue.now_s()
        return self.pilot(uav).position_enu_m(now_s)[2] > _LIFTED_M

    def assert_safe(self) -> None:
        """Nothing was seen that should not have been."""
        assert self.unsafe == [], "\n".join([*self.unsafe[:5], *self.told()])

    def _hear(self, uav: str, said: Sent | VehicleReport) -> None:
        if isinstance(said, Landed):
            self._stood.add(uav)
            self._let_start.discard(uav)
        for moment in list(self._moments):
            who, holds, after_s, act = moment
            if who == uav and holds(said):
                self._moments.remove(moment)
                self.at(self.world.queue.now_s() + after_s, act)

    def _look(self) -> None:
        now_s = self.world.queue.now_s()
        for uav in self.books:
            pilot = self.pilot(uav)
            place_enu_m, armed = pilot.position_enu_m(now_s), pilot.armed
            if uav in self._stood and armed:
                self._stood.discard(uav)
                if not (self._by_itself or uav in self._let_start):
                    self.unsafe.append(f"{now_s:.1f} s: {uav} started without a word")
            if not self.is_aloft(uav):
                continue
            self._look_aloft(uav, place_enu_m, pilot.battery.remaining_frac(now_s))
        self.at(now_s + _LOOK_S, self._look)

    def _look_aloft(self, uav: str, place_enu_m: tuple[float, float, float], frac: float) -> None:
        import shapely

        now_s = self.world.queue.now_s()
        self.lowest_frac = min(self.lowest_frac, frac)
        if frac < RESERVE_FRAC - self._tolerance_frac:
            self.unsafe.append(f"{now_s:.1f} s: {uav} flies on {frac:.1%}")
        inside = [z.id for z in self.zones if z.shape().contains(shapely.Point(place_enu_m[:2]))]
        if inside:
            self.unsafe.append(f"{now_s:.1f} s: {uav} is in {inside[0]}, at {place_enu_m}")


def in_phase(phase: FlightPhase) -> Callable[[Sent | VehicleReport], bool]:
    """Whether a message was sent in that phase of a bridge."""
    return lambda said: isinstance(said, Sent) and said.phase is phase


def departs(fleet: PastureFleet, uav: str) -> Callable[[Sent | VehicleReport], bool]:
    """Whether a message was sent to a vehicle that is about to leave its base."""
    return lambda said: (
        isinstance(said, Sent) and said.phase is FlightPhase.PREPARING and fleet.swaps(uav) > 0
    )


def is_landed(said: Sent | VehicleReport) -> bool:
    """Whether a vehicle is said to stand at its base."""
    return isinstance(said, Landed)
