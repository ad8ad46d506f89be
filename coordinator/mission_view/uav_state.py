"""How each UAV of a mission stands: what it does, for how long, where, and how well it is heard.

Whoever shows, measures or records a UAV reads it from here.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING

from coordinator.mission_view.mission_state import MissionState
from swarm.model import BaseId, TaskId, UavId
from swarm.protocol.calibration import AS_BRIEFED, FlightRates, flight_rates
from swarm.protocol.uav_messages import BaseStage, Claim, ClaimPhase, Status, StatusPhase

if TYPE_CHECKING:
    from coordinator.mission_view.ways import UavWays

Point = tuple[float, float, float]
LOST = "lost"
STARTING = "starting"
ABSENT = "absent"
LOW_BATTERY_FRAC = 0.2
"""A battery with less is marked wherever it is shown."""
_UNREADY = (STARTING, StatusPhase.LEARNING, StatusPhase.PREPARING)
_BUSY = (StatusPhase.FLYING, StatusPhase.SERVING)
_GONE_FOR_GOOD = (LOST, StatusPhase.RETURNING, StatusPhase.HOME, StatusPhase.OUT)
"""What is no less true of a UAV that nothing is heard of any more."""
_VISITS = {
    BaseStage.APPROACHING: "to base",
    BaseStage.WAITING: "waiting",
    BaseStage.LANDED: "swapping",
    BaseStage.PARKED: "parked",
}
"""What a UAV does on a visit to a base, in a word."""
_PHASES = {ClaimPhase.OUT: StatusPhase.OUT, ClaimPhase.PAUSED: StatusPhase.HOLDING}
"""What a UAV does that claims nothing, where it is not idle."""


@dataclass(frozen=True, slots=True)
class UavState:
    """What is known of one UAV."""

    id: UavId
    does: str
    """`StatusPhase`, or lost, or starting, as it was last known."""
    task: TaskId | None
    """The one it has taken, as it was last known."""
    completion_s: float | None
    """Predicted completion of that task, or when it is ready at a base [s of mission]."""
    eta_s: float | None
    """The same from now."""
    claim: ClaimPhase | None
    there: bool
    """Whether it is believed to be there."""
    told_enu_m: Point | None
    """Where it is [m; mission origin] without its height layer; None until it has told."""
    layer_m: float
    """How much higher than that place it is: its layer, or 0 where it is out of it."""
    velocity_enu_m_s: Point | None
    battery_frac: float | None
    note: str
    rates: FlightRates
    """How it flies, by what it has measured."""
    link_age_s: float | None
    """Since it last said something [s of the observer's clock]; None when it never has."""
    silent_s: float | None
    """The same where it is there, and that is long."""
    dropped: Mapping[str, int]
    """Messages its agents have dropped in all their lives, by reason."""
    base: BaseId | None
    """To which it flies, or where it stands, as it was last known."""
    stage: BaseStage | None
    """How far that visit is."""
    sortie_end_s: float | None
    """By when it must have landed, its reserve kept [s of mission]; None: endless, not told, or on
    the ground."""
    sortie_left_s: float | None
    """How long that is from now [s of mission]."""
    swaps: int
    """How often it has landed for another battery."""

    @property
    def visit(self) -> str | None:
        """What it does about a base, in a word; None if nothing."""
        if self.stage is None or self.troubled or not self.there:
            return None
        changing = self.claim in (ClaimPhase.PROPOSED, ClaimPhase.HELD) and self.task is None
        if self.stage is BaseStage.LANDED and not changing:
            return "at base"  # its battery is full
        return _VISITS[self.stage]

    @property
    def goal(self) -> str | None:
        """The task or base that it has taken."""
        return self.task or self.base

    @property
    def now_does(self) -> str:
        """What it does as far as that can be known now: absent where it is not there."""
        return self.does if self.there or self.does in _GONE_FOR_GOOD else ABSENT

    @property
    def now_task(self) -> TaskId | None:
        """Its task; none where it is not there."""
        return self.task if self.there else None

    @property
    def now_completion_s(self) -> float | None:
        """When its task is done; none where it is not there."""
        return self.completion_s if self.there else None

    @property
    def now_eta_s(self) -> float | None:
        """When that is done, from now [s of mission]."""
        return self.eta_s if self.there else None

    @property
    def in_layer_enu_m(self) -> Point | None:
        """Where it is, in its height layer [m; mission origin].

        Agents tell it without the layer, as if all flew at the height of their tasks.
        """
        if self.told_enu_m is None:
            return None
        east_m, north_m, up_m = self.told_enu_m
        return east_m, north_m, up_m + self.layer_m

    @property
    def battery_low(self) -> bool:
        """Whether its charge is to be watched."""
        return self.battery_frac is not None and self.battery_frac < LOW_BATTERY_FRAC

    @property
    def troubled(self) -> bool:
        """Whether it is gone or takes no part."""
        return self.does in (LOST, StatusPhase.OUT)

    @property
    def unready(self) -> bool:
        """Whether it is not at its start yet."""
        return self.does in _UNREADY

    @property
    def busy(self) -> bool:
        """Whether it is on its way to a task or serves it."""
        return self.does in _BUSY


@dataclass(frozen=True, slots=True)
class UavView(UavState):
    """One UAV in a picture, beside the others."""

    short: str
    """What tells its id from the others."""
    number: int
    """Place in the fleet, from 0."""
    flown: tuple[TaskId, ...]
    """Tasks it has done, in order."""
    planned: tuple[TaskId, ...]
    """Tasks its list has for it that are not over yet, nor taken by others."""
    start_enu_m: Point
    ways: UavWays | None = None
    """Its ways in the field; None of a plain mission, where all are straight."""

    @property
    def place_enu_m(self) -> Point:
        """Where it is drawn [m; mission origin], without its height layer."""
        return self.start_enu_m if self.told_enu_m is None else self.told_enu_m


class FleetStates:
    """Of all UAVs of a mission at one moment; what concerns all is looked up once."""

    def __init__(self, mission_state: MissionState, now_s: float) -> None:
        brief = mission_state.replica.brief
        self._layers_m = {} if brief is None else {uav.id: uav.layer_m for uav in brief.uavs}
        self._rates = flight_rates(mission_state.replica)
        self._dropped = mission_state.dropped
        self._mission_s = mission_state.mission_s(now_s)
        self._mission_state = mission_state
        self._now_s = now_s

    def of(self, uav: str) -> UavState:
        """How that one stands."""
        mission_state = self._mission_state
        status, claim = mission_state.statuses.get(uav), mission_state.replica.claims.get(uav)
        heard_s = mission_state.heard_s.get(uav)
        does, task = _activity(mission_state, uav, status, claim)
        completion_s = eta_s = left_s = None
        if claim is not None and self._mission_s is not None:
            if task is not None or (claim.base is not None and claim.is_taken):
                completion_s = claim.completion_s
                eta_s = completion_s - self._mission_s
            if claim.sortie_end_s is not None:
                left_s = max(0.0, claim.sortie_end_s - self._mission_s)
        return UavState(
            id=UavId(uav),
            does=does,
            task=task,
            completion_s=completion_s,
            eta_s=eta_s,
            claim=None if claim is None else claim.phase,
            there=uav in mission_state.present,
            told_enu_m=None if status is None else status.position_enu_m,
            layer_m=self._layers_m.get(uav, 0.0)
            if status is None or status.layer_m is None
            else status.layer_m,
            velocity_enu_m_s=None if status is None else status.velocity_enu_m_s,
            battery_frac=None if status is None else status.battery_frac,
            note="" if status is None else status.note,
            rates=self._rates.get(uav, AS_BRIEFED),
            link_age_s=None if heard_s is None else self._now_s - heard_s,
            silent_s=mission_state.silent_s(uav, self._now_s),
            dropped=self._dropped.get(uav, {}),
            base=None if claim is None or claim.base is None else BaseId(claim.base),
            stage=None if claim is None else claim.stage,
            sortie_end_s=None if claim is None else claim.sortie_end_s,
            sortie_left_s=left_s,
            swaps=mission_state.flights.swaps(uav),
        )


def _activity(
    mission_state: MissionState, uav: str, status: Status | None, claim: Claim | None
) -> tuple[str, TaskId | None]:
    """What a UAV does, and the task it has taken."""
    does: str = STARTING if status is None else status.phase
    task = None if claim is None or claim.task is None else TaskId(claim.task)
    if uav in mission_state.lost and uav not in mission_state.present:
        return LOST, None
    if task is not None and does not in _BUSY:
        does = StatusPhase.FLYING  # claims never lag, status may
    elif claim is not None and does == STARTING:
        does = _PHASES.get(claim.phase, StatusPhase.IDLE)
    elif task is None and does in _BUSY and (claim is None or claim.base is None):
        does = StatusPhase.IDLE
    return does, task
