"""What a firmware decides for the simulated vehicle; everything else is common."""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from collections.abc import Mapping
from dataclasses import dataclass
from types import MappingProxyType
from typing import TYPE_CHECKING

from pymavlink.dialects.v20 import ardupilotmega as mavlink

from agent.vehicle.firmware.kinematics import JerkCost
from sim.autopilot.config import VehicleConfig
from sim.autopilot.events import FirmwareEvent, OwnCommand, TextTemplate
from sim.autopilot.flight import FlightMode, RunwayPlaces
from sim.autopilot.parameters import (
    ENDLESS,
    ParameterBehaviour,
    ParameterEntry,
    ParameterRole,
    ParameterTable,
)
from sim.autopilot.readiness import PowerUpStage

if TYPE_CHECKING:
    from sim.autopilot.pilot import Pilot


@dataclass(frozen=True, slots=True)
class RefusalCodes:
    """MAV_RESULT of what is refused; 0 (accepted) for what is ignored in silence."""

    not_now: int
    """The vehicle can't do it in its state."""
    no_such_mode: int
    reposition_without_flag: int
    """DO_REPOSITION that may not change the mode, in another mode."""
    no_such_stream: int
    """SET_MESSAGE_INTERVAL of a message it doesn't stream."""
    no_such_place: int
    """A region of interest whose place is none."""
    no_such_message: int
    """REQUEST_MESSAGE of a message it doesn't have."""
    outside_fence: int
    """DO_REPOSITION to a place beyond the vehicle's own fence."""


@dataclass(frozen=True, slots=True)
class ModeBehaviour:
    """When modes change, by command and by themselves."""

    at_boot: FlightMode
    for_reposition: FlightMode
    """Mode in which DO_REPOSITION is flown."""
    by_hand: FlightMode
    """Mode in which a pilot flies who takes over."""
    unarmable: frozenset[FlightMode]
    """Modes in which a ground station can't arm."""
    change_speed: frozenset[FlightMode]
    """Modes in which DO_CHANGE_SPEED is obeyed."""
    set_mode_acknowledged_as: int
    """The command in the acknowledgement of the older message SET_MODE."""
    for_take_off: FlightMode | None = None
    """Mode that NAV_TAKEOFF enters, until the vehicle is up; None: it must be guided already."""
    after_flight: FlightMode | None = None
    """Mode entered by itself when the motors stop after an automatic flight."""
    reposition_needs_flag: bool = False
    """Whether DO_REPOSITION needs its flag also in the mode it is flown in."""
    told_at_once: bool = False
    """Whether a change of mode is followed by a heartbeat at once."""
    flies_when_armed: bool = False
    """Whether take-off and mission modes begin to fly as soon as the motors run."""
    acknowledgements: int = 1
    """How often DO_SET_MODE is acknowledged."""


@dataclass(frozen=True, slots=True)
class MissionBehaviour:
    """How missions are taken, flown and ended."""

    asks_for_int: bool = False
    """Whether items are asked for by MISSION_REQUEST_INT."""
    int_frames: bool = False
    """Whether items are given back in the ``_INT`` variant of their frame."""
    gives_up_silently: bool = False
    """Whether the upload of a fence that is cut off ends without an acknowledgement, and one of
    too few corners at the first of them."""
    marks_current: bool = False
    """Whether the current item says so when it is given back."""
    first_item: int = 0
    """Number of the first item that is flown: 1 where item 0 is home."""
    check_s: float = 0.0
    """Time after an upload [s] in which the mission mode is acknowledged but not entered."""
    restarts: bool = False
    """Whether a mission that is over begins again when its mode is entered again."""
    upload_rewinds: bool = False
    """Whether another mission is begun from its first item, and not from the current number."""
    climbs_first: bool = False
    """Whether the vehicle rises straight up before its first item, from the ground too."""
    repeats_reached: int = 0
    """How many times more MISSION_ITEM_REACHED is sent, once a second."""
    keeps_number: bool = False
    """Whether MISSION_CURRENT goes on telling the last item after the motors stopped."""
    gives_way: bool = False
    """Whether an item may let targets be told for a time."""
    item_radius: bool = False
    """Whether a waypoint may say how near is near enough, rather than the parameter alone."""
    tells_camera: bool = False
    """Whether the trigger of a camera is that of another component: an item for it is told on, and
    as reached; a command for it is left to that component, and not acknowledged. Items for regions
    of interest are told on, too, and acknowledged to who commands one."""
    lands_on_runways: bool = False
    """Whether it knows where a landing begins, and a circle on which to come down for it."""
    takes_off_by_itself: bool = False
    """Whether the mission mode leaves the ground, as soon as the motors run, where the mission
    begins with a take-off."""
    forgets_mode: bool = False
    """Whether the mode becomes another one at the end, or at an item that returns home."""


@dataclass(frozen=True, slots=True)
class FailsafeBehaviour:
    """How failsafes act, and what is said of them."""

    battery_words: tuple[TextTemplate, ...]
    """Said of a low battery [level, volts, used_mah]."""
    ground_regained: TextTemplate
    """Said when a ground station is heard again."""
    hold_s: float = 0.0
    """It warns for so long, holding its place, before it returns [s]."""
    words: tuple[TextTemplate, ...] = ()
    """Said whatever the cause, just before the mode changes; none: each cause has its own."""
    hold_words: tuple[TextTemplate, ...] = ()
    """Said when it begins to hold."""
    position_words: tuple[TextTemplate, ...] = ()
    """Said of a lost position."""
    critical_when_disarmed: bool = False
    """Whether the heartbeat says CRITICAL as long as there is a cause, motors or not; otherwise
    from then until the motors stand, cause or not."""
    deaf_after_s: float = math.inf
    """To who has not been heard for so long it says no texts any more [s]."""


@dataclass(frozen=True, slots=True)
class FenceBehaviour:
    """How an uploaded fence is heeded."""

    obstacle: str
    """Why a vehicle that breaks it can't be armed."""
    inclusions_add: bool = False
    """Whether it is enough to be in one of several areas to stay in."""
    needs_home_inside: bool = False
    """Whether a fence that keeps the vehicle out of its home is no fence."""
    tells_status: bool = False
    """Whether FENCE_STATUS is said."""
    switchable: bool = False
    """Whether it is switched on and off by command, until the next start."""
    critical: bool = False
    """Whether the heartbeat says CRITICAL until somebody changes the mode that was entered, and
    checks fail in flight too."""


@dataclass(frozen=True, slots=True)
class GcsFailsafe:
    """What the firmware does when it hears no ground station any more."""

    mode: FlightMode
    after_s: float
    """After so long without a heartbeat [s]."""
    listens: range
    """To the system ids of those."""
    spared: frozenset[FlightMode] = frozenset()
    """Modes in which it does nothing."""


def texts_of(
    by_severity: Mapping[int, Mapping[FirmwareEvent, str]],
) -> Mapping[FirmwareEvent, TextTemplate]:
    """The texts of a firmware, given by their MAV_SEVERITY."""
    return MappingProxyType(
        {
            occasion: TextTemplate(severity, text)
            for severity, texts in by_severity.items()
            for occasion, text in texts.items()
        }
    )


class FirmwareModel(ABC):
    """Numbers, names and habits of one firmware."""

    autopilot: int
    """MAV_AUTOPILOT."""
    capabilities: int
    """MAV_PROTOCOL_CAPABILITY."""
    vehicle_type: int = mavlink.MAV_TYPE_QUADROTOR
    vtol_state: int
    """MAV_VTOL_STATE."""
    version: int
    """``flight_sw_version`` of AUTOPILOT_VERSION."""
    modes: ModeBehaviour
    mode_names: Mapping[int, tuple[FlightMode, str]]
    """By ``custom_mode``: the mode, and what the firmware calls it when it talks to people."""
    told_modes: Mapping[FlightMode, str | int]
    """What AVAILABLE_MODES tells, in that order: its name, or MAV_STANDARD_MODE of one without."""
    tells_all_modes: bool = False
    """Whether whoever asks for all modes hears of all, rather than of the first."""
    custom_mode_bits: int = -1
    """Those of ``custom_mode`` that say the mode; -1: all."""
    missions: MissionBehaviour
    refusals: RefusalCodes
    failsafe_behaviour: FailsafeBehaviour
    fence_behaviour: FenceBehaviour
    parameter_habits: ParameterBehaviour
    disarm_delay_after_landing: ParameterRole
    """What says how long after landing the motors stop..."""
    jerk_cost_s: JerkCost
    """What a limit of jerk costs a leg."""
    disarms_at_once: frozenset[FlightMode] = frozenset()
    """...but in modes in which they stop at once."""

    take_off_above_home: bool = False
    """Whether NAV_TAKEOFF by command gives its height above home, rather than above the sea."""
    reads_frames: bool = False
    """Whether commands are read in their frame, rather than always above the sea."""
    forgets_speed: bool = False
    """Whether a speed ordered before the first target, after the commanded mode was entered
    or after a take-off, is lost."""
    obeys_leg_speed: bool = False
    """Whether DO_REPOSITION may give the speed of its leg."""
    pauses_anywhere: bool = False
    """Whether DO_REPOSITION without a place, height and heading stops the vehicle."""
    targets_end_look: bool = False
    """Whether a region of interest is forgotten with each new target and mode, rather than with a
    new mission."""
    looks_in_missions_alone: bool = False
    """Whether it turns the nose in missions alone; elsewhere DO_REPOSITION may give a heading."""
    tells_origin_when_armed: bool = False
    home_follows_landing: bool = False
    """Whether home is where the vehicle landed, as soon as the motors stand and whoever put it
    elsewhere, rather than from the next arming on unless somebody did."""
    constant_position_at_rest: bool = False
    """Whether the estimator says EKF_CONST_POS_MODE wherever the vehicle stands still, rather
    than only where it has no position."""
    coasting_s: float
    """How long after a loss the estimator goes on without calling its position constant [s]."""

    unasked_streams: Mapping[int, float] = MappingProxyType({})
    """Messages and intervals [s] streamed on a new channel; heartbeats go without saying."""
    fixed_streams: frozenset[int] = frozenset()
    """Messages whose interval can't be changed."""
    missing_messages: frozenset[int]
    """Messages the firmware doesn't know."""

    stage_texts: Mapping[PowerUpStage, TextTemplate] = MappingProxyType({})
    """What is said to people when something has become ready."""
    texts: Mapping[FirmwareEvent, TextTemplate]
    """What is said to people otherwise."""
    own_commands: Mapping[FirmwareEvent, OwnCommand] = MappingProxyType({})
    """Commands it sends to other components, which ground stations hear too."""
    numbers_texts: bool = False
    """Whether texts end in a tab, are numbered, and are sent in pieces if they are long."""

    def custom_mode(self, mode: FlightMode) -> int:
        """Number of the mode in a heartbeat."""
        return next(number for number, (each, _) in self.mode_names.items() if each is mode)

    def mode_name(self, mode: FlightMode) -> str:
        """What the firmware calls the mode when it talks to people."""
        return self.mode_names[self.custom_mode(mode)][1]

    def mode_of(self, custom_mode: int) -> FlightMode | None:
        """The mode of that number; None where the firmware, or its simulation, has none."""
        mode, _ = self.mode_names.get(custom_mode & self.custom_mode_bits, (None, ""))
        return mode

    def landing_enu_m(self, pilot: Pilot) -> RunwayPlaces | None:
        """Where its return mode lands along a runway [m]; None: it does not."""
        del pilot
        return None

    def lands_by_mission(self, pilot: Pilot) -> int | None:
        """Number of the item with which its return mode goes on in the mission mode, if so."""
        del pilot
        return None

    def disarm_delay(self, mode: FlightMode) -> ParameterRole | None:
        """What says how long after landing the motors stop; None where that is at once."""
        return None if mode in self.disarms_at_once else self.disarm_delay_after_landing

    @staticmethod
    def acceleration_entry(
        name: str, acceleration_m_s2: float | None, least_m_s2: float
    ) -> ParameterEntry:
        """The parameter of an acceleration; one that speeds up in no time cannot be told to."""
        return ParameterEntry(
            name,
            ENDLESS if acceleration_m_s2 is None else acceleration_m_s2,
            mavlink.MAV_PARAM_TYPE_REAL32,
            ParameterRole.ACCELERATION_M_S2,
            least=least_m_s2,
            read_only=acceleration_m_s2 is None,
        )

    @staticmethod
    def jerk_entry(name: str, jerk_m_s3: float | None) -> ParameterEntry:
        """The parameter of a jerk."""
        return ParameterEntry(
            name,
            ENDLESS if jerk_m_s3 is None else jerk_m_s3,
            mavlink.MAV_PARAM_TYPE_REAL32,
            ParameterRole.JERK_M_S3,
            least=1.0,
        )

    @abstractmethod
    def parameters(self, config: VehicleConfig) -> tuple[ParameterEntry, ...]:
        """The parameter table at power-up; it has every `ParameterRole` that has no default."""

    @abstractmethod
    def ground_lost(self, parameters: ParameterTable) -> GcsFailsafe | None:
        """What it does when its ground station falls silent; None if it flies on."""

    @abstractmethod
    def fence_radius_m(self, parameters: ParameterTable) -> float:
        """Radius of the vehicle's own fence around home [m]; 0: it has none."""

    @abstractmethod
    def fence_on(self, parameters: ParameterTable, switched: bool | None) -> bool:
        """Whether an uploaded fence counts; ``switched`` by command, or None."""

    @abstractmethod
    def fence_mode(self, parameters: ParameterTable) -> FlightMode | None:
        """The mode that is entered where it is broken; None: that is only said."""

    @abstractmethod
    def mode_commanded(self, main: float, sub: float) -> int | None:
        """``custom_mode`` from parameters 2 and 3 of DO_SET_MODE; None if they make no sense."""

    @abstractmethod
    def base_mode(self, pilot: Pilot) -> int:
        """MAV_MODE_FLAG bits of a heartbeat."""

    @abstractmethod
    def system_status(self, pilot: Pilot) -> int:
        """MAV_STATE of a heartbeat while no failsafe acts."""

    @abstractmethod
    def sensors(self, pilot: Pilot) -> tuple[int, int, int]:
        """Bits of SYS_STATUS: what is present, enabled and healthy."""

    @abstractmethod
    def mission_told(self, pilot: Pilot) -> tuple[int, int, int]:
        """``total``, ``mission_state`` (MISSION_STATE) and ``mission_mode`` of MISSION_CURRENT."""
