"""What goes into the agent's core and what comes out of it.

Its shell tells it of the bus and of the vehicle, and carries out what it wants: statements on the
bus, and orders to the vehicle. The MAVLink bridge (agent.vehicle) and the simulator's virtual
vehicle both speak this; the core knows nothing else of flying.
"""

from __future__ import annotations

from dataclasses import dataclass, field

from agent.core.station_words import StationAction, StationAsked
from swarm.model import Zone
from swarm.model.vehicles import VehicleKind
from swarm.protocol.events import CommonAction, CommonEvent, MessagesReceived


@dataclass(frozen=True, slots=True)
class Runway:
    """Where a vehicle touches down that cannot land upright."""

    position_enu_m: tuple[float, float, float]
    """The place [m; mission origin], on the ground."""
    heading_rad: float
    """In which it touches down, clockwise from north."""


@dataclass(frozen=True, slots=True)
class Prepare:
    """Get airborne and under command: wait until ready, arm, take off, reach the place."""

    position_enu_m: tuple[float, float, float]
    """Where to hover before the mission starts [m; mission origin, height included]."""
    speed_m_s: float
    """Cruise ground speed to set [m/s]."""
    resume: bool = False
    """A vehicle that flies already is ready where it is, and flies on meanwhile."""
    ground_up_m: float | None = None
    """Height of the ground on which the vehicle stands [m; mission origin]; None if not known."""
    left_in_air: bool = False
    """An earlier life of this agent had it in the air: one that stands on the ground now came
    down with nobody watching, and is not started; one that still climbs goes on where it is, as
    high above its home as the place lies above the ground."""
    acceleration_m_s2: float | None = None
    """To and from cruise speed, as the mission is planned; None: it does not say."""
    begun: bool = False
    """An earlier life of this agent had started its motors for this, and never had it ready: if
    they run, nobody else has taken it since and it is ours, on the ground or on its way up."""
    vehicle: VehicleKind = VehicleKind.COPTER
    """What it is to be; any other is not started."""
    runway: Runway | None = None
    """Where and how it lands, if it needs a runway for that."""


@dataclass(frozen=True, slots=True)
class GoTo:
    """Fly to a place, at once, in place of whatever was being flown to."""

    leg: int
    """Number of this order; `Arrived` repeats it, so that late news is recognised."""
    position_enu_m: tuple[float, float, float]
    """Target [m; mission origin, height included]."""
    stay_s: float = 0.0
    """How long the UAV is going to stay there [s]; a return home that stands on the vehicle
    waits at least that long."""
    idled: bool = False
    """Whether the UAV had found nothing to fly to before; no vehicle minds."""
    task: str | None = field(default=None, compare=False)
    """Id of the task there, for a payload; None for any other place."""
    attempt: int = field(default=1, compare=False)
    """How many times this UAV will then have tried that task."""
    via_enu_m: tuple[tuple[float, float, float], ...] = field(default=(), repr=False)
    """Corners to fly through before, in that order and without stopping [m; mission origin,
    height included]. A vehicle on the ground takes off first, straight up."""
    trigger_m: float | None = field(default=None, repr=False)
    """How far apart the camera takes pictures on the way [m], 0: it takes none; None: it is no
    concern, and is left alone."""
    look_at_m: tuple[float, float] | None = field(default=None, repr=False)
    """Where the camera looks along the way [m; east, north; mission origin], level with the target;
    None: nowhere in particular."""


@dataclass(frozen=True, slots=True)
class Swap:
    """Land on the spot, and get the battery changed.

    The vehicle says `Landed`, then `Swapped` once its battery is full. Where a person has to
    let it start again, it says so only after `Ready`.
    """

    leg: int
    """Number of this order; `Landed` and `Swapped` repeat it."""
    position_enu_m: tuple[float, float, float]
    """The place on the ground [m; mission origin, height included]."""
    swap_s: float = field(default=0.0, repr=False, compare=False)
    """How long a battery takes to be changed there [s], for vehicles that start by themselves."""
    speed_m_s: float | None = field(default=None, repr=False, compare=False)
    """Cruise ground speed from there on [m/s]; None: as before."""


@dataclass(frozen=True, slots=True)
class Ready:
    """A person has seen to the vehicle of that `Swap`, and lets it start again.

    It moves nothing: `Swapped` follows once the battery is full, too.
    """

    leg: int
    """Number of the `Swap`; of any other it means nothing."""


@dataclass(frozen=True, slots=True)
class KeepOut:
    """Where not to fly from now on, in place of what was said before.

    It moves nothing, and goes before the orders that heed it. Which way leads round is the
    agent's to say; a vehicle that is told to fly straight through refuses.
    """

    zones: tuple[Zone, ...]
    """In force, whatever their heights."""
    margin_m: float = 0.0
    """Distance to keep from them [m]."""


@dataclass(frozen=True, slots=True)
class Hold:
    """Stop and hover where the vehicle is, in place of whatever it does; on the ground, stay there.

    Targets are taken again afterwards; an unfinished preparation or return begins anew with
    a new order.
    """

    reason: str


@dataclass(frozen=True, slots=True)
class Return:
    """Return to launch and land.

    Ordered again without `via_enu_m`, a vehicle on its way there returns from where it is.
    """

    reason: str
    resume: bool = False
    """An earlier life of this agent flew the vehicle: look whether it is in the air."""
    via_enu_m: tuple[float, float, float] | None = None
    """Where to fly first [m; mission origin, height included], if nothing is in the way of it:
    return modes fly at a height of the vehicle's own. None to return at once."""
    path_enu_m: tuple[tuple[float, float, float], ...] = field(default=(), repr=False)
    """Corners to fly through before `via_enu_m`, in that order and without stopping."""
    land: bool = field(default=False, repr=False)
    """Land at `via_enu_m` rather than return to launch from there."""


@dataclass(frozen=True, slots=True)
class GiveWay:
    """Leave the way of another UAV, and go on as ordered once the next `GiveWay` says nothing more.

    What the vehicle was ordered stays its order. It concerns a vehicle that flies to a target,
    hovers, or is on its way home by a place; for any other it means nothing.
    """

    path_enu_m: tuple[tuple[float, float, float], ...] = ()
    """Corners to fly through instead, the last to hover at [m; mission origin, height included];
    none: it flies as ordered."""
    stands: bool = False
    """Stop, and stay there."""
    speed_m_s: float | None = None
    """Fly as ordered, no faster than that; None: as fast as ever."""


VehicleWord = Ready | KeepOut
"""What a vehicle is told that moves nothing."""

VehicleOrder = Prepare | GoTo | Swap | Hold | Return | GiveWay | VehicleWord


@dataclass(frozen=True, slots=True)
class MotorsRun:
    """While it is being prepared: whether its motors run, or may run, because of us."""

    ours: bool


@dataclass(frozen=True, slots=True)
class VehicleReady:
    """The vehicle is airborne and takes targets; unless it was resumed, it hovers at its start."""


@dataclass(frozen=True, slots=True)
class NotReady:
    """What the vehicle still waits for, in words a person understands; may change often."""

    reason: str


@dataclass(frozen=True, slots=True)
class Caution:
    """What a person should know of the vehicle from now on; nothing else follows from it."""

    reason: str
    """In words; empty: what was said before is over."""


@dataclass(frozen=True, slots=True)
class FlightLimits:
    """How the vehicle flies by what is set on it; said before it takes off, as plans need it.

    Vehicles of the simulator's ideal world say nothing: they fly as they are told.
    """

    acceleration_m_s2: float | None = None
    """A leg from rest to rest takes length / speed + speed / this, with what its limit of jerk
    costs; None: not known, or as good as endless."""
    speed_m_s: float | None = None
    """It flies no faster over ground; None: not known."""


@dataclass(frozen=True, slots=True)
class Arrived:
    """The vehicle is at the target of that leg and has stopped there."""

    leg: int


@dataclass(frozen=True, slots=True)
class Landed:
    """The vehicle has touched down at the place of that `Swap`, and is disarmed."""

    leg: int


@dataclass(frozen=True, slots=True)
class Swapped:
    """The vehicle of that `Swap` has a full battery, and may take off."""

    leg: int


@dataclass(frozen=True, slots=True)
class AttemptFailed:
    """The attempt at the task of that leg fails, said before the UAV's stay there is over.

    It stays to the end of it all the same. Simulated vehicles say so; the MAVLink bridge does
    not, since it knows no payload that could tell.
    """

    leg: int


@dataclass(frozen=True, slots=True)
class Telemetry:
    """Where the vehicle is and how it does."""

    position_enu_m: tuple[float, float, float]
    """[m; mission origin]."""
    velocity_enu_m_s: tuple[float, float, float]
    battery_frac: float | None
    """Remaining charge, 0..1; None when the vehicle does not say."""


@dataclass(frozen=True, slots=True)
class Refused:
    """An order could not be carried out; the vehicle keeps what it did before."""

    order: VehicleOrder
    reason: str
    stands: bool = field(default=False, compare=False)
    """The vehicle that was to be prepared stands on the ground, its motors too."""
    passes: bool = field(default=False, compare=False)
    """What is in the way is another UAV, which goes on."""


@dataclass(frozen=True, slots=True)
class HandedOver:
    """The vehicle is no longer ours to command (pilot took over, rebooted, link lost)."""

    reason: str
    silent: bool = field(default=False, compare=False)
    """Nobody is known to have taken it: it is not heard, and looked for."""


@dataclass(frozen=True, slots=True)
class HandOverExplained:
    """More is known of a vehicle that was handed over: why, or what it has done since."""

    reason: str


@dataclass(frozen=True, slots=True)
class HeardAgain:
    """A vehicle handed over for its silence flies as it was left, and should go home now.

    It obeys again; nobody else would bring it down.
    """

    reason: str


@dataclass(frozen=True, slots=True)
class ReturnAdvised:
    """The vehicle is in the air and obeys, but should go home now.

    Its battery is low, it left its fence, its autopilot is alarmed, or it could not be
    prepared to the end.
    """

    reason: str


@dataclass(frozen=True, slots=True)
class Held:
    """The vehicle stands where it was told to by `Hold`: in the air, or on the ground."""


@dataclass(frozen=True, slots=True)
class ReturnBegun:
    """The vehicle was seen to return by itself: it lands at home whoever is there to see it."""


@dataclass(frozen=True, slots=True)
class Home:
    """The vehicle is on the ground and disarmed: it has landed, or has not taken off."""


VehicleReport = (
    VehicleReady
    | MotorsRun
    | NotReady
    | Caution
    | FlightLimits
    | Arrived
    | Landed
    | Swapped
    | AttemptFailed
    | Telemetry
    | Refused
    | HandedOver
    | HandOverExplained
    | HeardAgain
    | ReturnAdvised
    | ReturnBegun
    | Held
    | Home
)


@dataclass(frozen=True, slots=True)
class OrderVehicle:
    """Command the vehicle."""

    order: VehicleOrder


Event = CommonEvent | MessagesReceived | VehicleReport | StationAsked

Action = CommonAction | OrderVehicle | StationAction
