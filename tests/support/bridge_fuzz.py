"""Throws at a bridge whatever a link may carry, from one seed, in every phase.

An *episode* is one life of a bridge: a scripted vehicle brings it into a phase, then come
hostile bytes and messages, mixed with the vehicle's own, lost, doubled, late or damaged,
with time that jumps, links that break and orders good and bad. Seed and number of an
episode are all it needs to be played again. What must hold is in tests.support.bridge_watch.
"""

from __future__ import annotations

import math
from collections import Counter
from dataclasses import dataclass, replace
from random import Random

from agent.core.interface import (
    GiveWay,
    GoTo,
    Hold,
    KeepOut,
    Prepare,
    Ready,
    Return,
    Swap,
    VehicleOrder,
)
from agent.vehicle.activity import FlightPhase
from agent.vehicle.bridge import Bridge
from agent.vehicle.config import BridgeConfig, CommandStyle
from agent.vehicle.conversation import SendBytes
from agent.vehicle.session import BridgeEvent, BytesReceived, LinkClosed, LinkOpened, TimePassed
from agent.vehicle.signing import Signing, SigningKey
from swarm.model import Zone, ZoneId
from tests.support.bridge_flight import ORIGIN, UNIX_S
from tests.support.bridge_watch import BridgeWatch
from tests.support.fake_copter import (
    FakeCopter,
)
from tests.support.hostile_input import FLAVOURS, Hostile, is_frame
from tests.support.mavlink_frames import MESSAGES

KEY = SigningKey(bytes(range(1, 33)))
START = Prepare((5.0, 0.0, 10.0), 4.0)
STEPS_PER_EPISODE = 400
_EVENTS_PER_FLIGHT = 100
_BRING_UP_STEP_S = 0.1
_BRING_UP_STEPS = 600
_FENCE_RADIUS_M = 500.0
_FENCE_HEIGHT_M = 100.0
_PHASES = (
    FlightPhase.PREPARING,
    FlightPhase.HOVERING,
    FlightPhase.FLYING,
    FlightPhase.HOLDING,
    FlightPhase.YIELDING,
    FlightPhase.RETURNING,
    FlightPhase.LANDING,
    FlightPhase.STANDING,
    FlightPhase.HANDED_OVER,
)
_BASE = (5.0, 0.0, 0.0)
_WALLS = (
    Zone(ZoneId("wall"), ((15.0, -30.0), (25.0, -30.0), (25.0, 30.0), (15.0, 30.0))),
    Zone(ZoneId("round"), ((-3.0, -8.0), (12.0, -8.0), (12.0, 8.0), (-3.0, 8.0)), floor_m=5.0),
)


@dataclass(frozen=True, slots=True)
class Setting:
    """What stays the same in many episodes."""

    flavour: str
    signed: bool
    style: CommandStyle = CommandStyle.REPOSITION

    def __str__(self) -> str:
        return f"{self.flavour} {self.style} {'signed' if self.signed else 'unsigned'}"


def settings(flavour: str) -> list[Setting]:
    """Every setting of that flavour."""
    return [Setting(flavour, signed, style) for style in CommandStyle for signed in (False, True)]


def setting_of(name: str) -> Setting:
    """The setting of that name."""
    flavour, style, signed = name.split()
    return Setting(flavour, signed == "signed", CommandStyle(style))


class Episode:
    """One life of a bridge among hostile input; `play` it once.

    Args:
        setting: which vehicle and link.
        seed: of the whole run.
        number: of this episode.
    """

    def __init__(self, setting: Setting, seed: int, number: int) -> None:
        self.setting = setting
        self.random = Random(f"{setting} {seed} {number}")
        self.now_s = self.random.uniform(0.0, 1e6)
        self.phases: Counter[FlightPhase] = Counter()
        """Steps taken in each phase."""
        self.story: list[str] = []
        """The last events, for whoever looks for a cause."""
        config = BridgeConfig(
            1,
            ORIGIN,
            command=setting.style,
            fence_radius_m=_FENCE_RADIUS_M,
            fence_height_m=_FENCE_HEIGHT_M,
        )
        fake = FLAVOURS[setting.flavour]
        signing = Signing(KEY, lambda: UNIX_S + self.now_s) if setting.signed else None
        self.bridge = Bridge(config, signing)
        self.watch = BridgeWatch(self.bridge, fake)
        self.copter = fake(ORIGIN)
        self.copter.now_s = self.now_s
        self.copter.power_on(self.now_s)
        self.hostile = Hostile(setting.flavour, self.random)
        self._forger: Signing | None = None
        if setting.signed:
            _give_key(self.copter)
            # Somebody who has the key, so that damage reaches what lies behind it.
            self._forger = Signing(KEY, lambda: UNIX_S + self.now_s, link_id=7)
        self._legs = 0
        self.copter.battery_percent = self.random.choice((80, 95))

    def play(self, steps: int = STEPS_PER_EPISODE) -> int:
        """Bring the bridge into a phase and be hostile for so many events; steps taken.

        Raises:
            BrokenError: something did not hold.
        """
        self._happen(LinkOpened())
        for place in range(steps):
            if place % _EVENTS_PER_FLIGHT == 0:
                self._bring_to(self.random.choice(_PHASES))
            self._happen_something()
        return self.watch.steps

    # The good part.

    def _bring_to(self, phase: FlightPhase) -> None:
        """Let the pilot give the vehicle back, if it was taken, and fly it into ``phase``."""
        if self.copter.airborne:
            self.copter.set_mode(self.copter.own_mode)
        if self.bridge.phase is FlightPhase.STANDING:
            self._happen(Return("enough"))
        self._happen(self._zones())
        self._happen(replace(START, resume=self.copter.airborne))
        patience = self.random.randrange(200) if phase is FlightPhase.PREPARING else _BRING_UP_STEPS
        for _ in range(patience):
            if self.bridge.phase is FlightPhase.HOVERING:
                break
            self._fly(_BRING_UP_STEP_S)
        if phase is FlightPhase.FLYING:
            self._happen(self._go_to(inside=True))
        elif phase is FlightPhase.YIELDING:
            if self.random.random() < 0.7:
                self._happen(self._go_to(inside=True))
                self._fly(1.0)
            self._happen(GiveWay(((*START.position_enu_m[:2], 22.0),)))
        elif phase is FlightPhase.RETURNING:
            self._happen(Return("enough"))
        elif phase in (FlightPhase.LANDING, FlightPhase.STANDING):
            self._happen(self._swap())
            if phase is FlightPhase.STANDING:
                self._stand()
        elif phase is FlightPhase.HOLDING:
            self._happen(Hold("wait"))
        elif phase is FlightPhase.HANDED_OVER:
            self.copter.set_mode(self.copter.pilot_mode)
        self._fly(_BRING_UP_STEP_S)

    def _stand(self) -> None:
        """Wait until it has landed, and perhaps until it departs."""
        departs = self.random.random() < 0.5
        for _ in range(_BRING_UP_STEPS):
            self._fly(_BRING_UP_STEP_S)
            if self.bridge.phase is FlightPhase.STANDING:
                break
        if departs:
            self._happen(Ready(self._legs))
            self._fly(1.0)
            self._happen(self._go_to(inside=True))
            for _ in range(self.random.randrange(100)):
                self._fly(_BRING_UP_STEP_S)

    def _fly(self, duration_s: float) -> None:
        """Let time pass with a vehicle that behaves."""
        self.now_s += duration_s
        for said in self.copter.advance(self.now_s):
            self._hear(said)
        if self.now_s >= self.bridge.next_deadline_s():
            self._happen(TimePassed())

    def _hear(self, said: bytes) -> None:
        self.hostile.remember(said)
        self._happen(BytesReceived(said))

    # The rest.

    def _happen_something(self) -> None:
        random = self.random
        dice = random.random()
        if dice < 0.55:
            self._happen(BytesReceived(self._signed(self.hostile.piece())))
        elif dice < 0.80:
            self._fly_badly(random.choice((0.0, 0.01, 0.1, 0.1, 0.5)))
        elif dice < 0.90:
            self.now_s += random.choice((0.0, 1e-6, 0.05, 0.3, 1.0, 3.0, 6.0, 60.0))
            self._happen(TimePassed())
        elif dice < 0.98:
            self._happen(self._order())
        else:
            self._happen(random.choice((LinkOpened(), LinkClosed())))

    def _fly_badly(self, duration_s: float) -> None:
        random = self.random
        self.now_s += duration_s
        said = self.copter.advance(self.now_s)
        if random.random() < 0.2:
            random.shuffle(said)
        for one in said:
            self.hostile.remember(one)
            for _ in range(random.choice((0, 1, 1, 1, 1, 1, 1, 2))):
                self._happen(BytesReceived(one))

    def _signed(self, piece: bytes) -> bytes:
        """The same, often signed by somebody who has the key, if it is one good frame."""
        if self._forger is None or self.random.random() < 0.3 or not is_frame(piece):
            return piece
        message_id = int.from_bytes(piece[7:10], "little")
        return self._forger.sign(piece, MESSAGES[message_id].crc_extra)

    def _order(self) -> VehicleOrder:
        random = self.random
        match random.randrange(15):
            case 0 | 1:
                speed_m_s = random.choice((4.0, 4.0, 4.0, 0.0, -1.0, math.nan, math.inf))
                return Prepare(self._place(), speed_m_s, resume=random.random() < 0.5)
            case 2 | 3 | 4 | 5:
                return self._go_to(inside=random.random() < 0.7)
            case 6 | 7:
                return Hold("wait")
            case 8:
                return self._swap()
            case 9 | 10:
                return Ready(self._legs + random.choice((0, 0, 0, -1)))
            case 11:
                return self._zones()
            case 12 | 13:
                pace_m_s = random.choice((None, 2.0, 0.0, -1.0, math.nan, math.inf))
                return GiveWay(self._corners(), random.random() < 0.3, pace_m_s)
            case _:
                via = self._place() if random.random() < 0.5 else None
                path = self._corners() if random.random() < 0.5 else ()
                resumes, lands = random.random() < 0.5, random.random() < 0.5
                return Return("enough", resumes, via, path, lands)

    def _zones(self) -> KeepOut:
        zones = tuple(zone for zone in _WALLS if self.random.random() < 0.3)
        return KeepOut(zones, self.random.choice((0.0, 3.0)))

    def _swap(self) -> Swap:
        self._legs += 1
        away = self.random.random()
        place = _BASE if away < 0.7 else (-20.0, 5.0, 0.0) if away < 0.9 else self._place()
        return Swap(self._legs, place, 5.0, self.random.choice((None, 4.0)))

    def _corners(self) -> tuple[tuple[float, float, float], ...]:
        uniform, wild = self.random.uniform, self.random.random() < 0.1
        corners = [(uniform(-50.0, 50.0), uniform(-50.0, 50.0), 10.0) for _ in range(2)]
        return (*corners, self._place()) if wild else tuple(corners[: self.random.randrange(3)])

    def _go_to(self, *, inside: bool) -> GoTo:
        self._legs += 1
        place = (self.random.uniform(-50.0, 50.0), self.random.uniform(-50.0, 50.0), 10.0)
        via = self._corners() if self.random.random() < 0.5 else ()
        stay_s = self.random.choice((0.0, 5.0))
        order = GoTo(self._legs, place if inside else self._place(), stay_s, via_enu_m=via)
        trigger_m = self.random.choice((None, None, 0.0, 15.0))
        look_at_m = self.random.choice((None, None, (5.0, 5.0), (-20.0, 30.0)))
        return replace(order, trigger_m=trigger_m, look_at_m=look_at_m)

    def _place(self) -> tuple[float, float, float]:
        random = self.random
        if random.random() < 0.5:
            return START.position_enu_m
        wild = (0.0, 10.0, -90.0, 499.0, 501.0, 1e9, math.nan, math.inf, -math.inf)
        return (random.choice(wild), random.choice(wild), random.choice(wild))

    def _happen(self, event: BridgeEvent) -> None:
        self.phases[self.bridge.phase] += 1
        self.story.append(f"{self.now_s:.6f} {self.bridge.phase.value}: {event}")
        del self.story[:-30]
        answers: list[bytes] = []
        for action in self.watch.step(event, self.now_s):
            if isinstance(action, SendBytes) and self.random.random() < 0.95:
                answers += self.copter.receive(action.data, self.now_s)
        for answer in answers:
            self._hear(answer)


def _give_key(copter: FakeCopter) -> None:
    """Let the scripted vehicle sign as pymavlink does, with one clock for both directions."""
    copter._sender.signing = copter._parser.signing
    copter._parser.signing.secret_key = KEY.secret
    copter._parser.signing.sign_outgoing = True
