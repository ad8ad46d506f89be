"""UAVs in the air that keep apart by `TacticalResolver` alone, in simulated time.

Points that speed up and brake evenly and do what they are advised a moment later; words between
them are lost and delayed, and positions are told wrongly by up to a bound.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, field

import numpy as np

from swarm.separation.tactical import Clear, TacticalResolver
from swarm.separation.tactical_advice import Advice, Maneuver, OwnFlight
from swarm.separation.tactical_motion import Place
from swarm.separation.tactical_traffic import (
    Grade,
    Precedence,
    TrafficPicture,
    TrafficRules,
    TrafficWord,
)

STEP_S = 0.05
_FAR_M = 1e9


@dataclass(slots=True)
class Flyer:
    """One UAV of a crowd."""

    uav: str
    place_m: np.ndarray
    path_m: list[Place]
    speed_m_s: float
    rank: int
    grade: Grade = Grade.FLYING
    velocity_m_s: np.ndarray = field(default_factory=lambda: np.zeros(3))
    arrived_s: float | None = None
    advice: Advice = field(default_factory=lambda: Advice(Maneuver.KEEP))
    waiting: list[tuple[float, Advice]] = field(default_factory=list)
    detour_m: list[Place] = field(default_factory=list)
    story: list[tuple[float, str]] = field(default_factory=list)
    next_tick_s: float = 0.0
    deaf_s: tuple[float, float] = (math.inf, math.inf)
    """From when until when nothing that is said reaches it, nor anybody from it."""
    braking_m_s2: float = 2.0
    dies_s: float = math.inf
    """From then on it says nothing and does as it was told last."""
    error_m: np.ndarray = field(default_factory=lambda: np.zeros(3))


Liar = Callable[["Crowd"], Iterable[tuple[str, TrafficWord]]]
"""What somebody says who flies nowhere, each time that others say something."""


class Crowd:
    """A crowd in the air."""

    def __init__(
        self,
        rules: TrafficRules,
        flyers: Sequence[Flyer],
        seed: int = 0,
        *,
        loss_frac: float = 0.0,
        delay_s: float = 0.05,
        command_s: float = 0.3,
        clear: Clear = lambda _path_m: True,
        liars: Sequence[Liar] = (),
        deaf: bool = False,
    ) -> None:
        self.rules = rules
        self.flyers = list(flyers)
        self._rng = np.random.default_rng(seed)
        self._loss_frac, self._delay_s, self._command_s = loss_frac, delay_s, command_s
        self._mail: list[tuple[float, str, str, TrafficWord, float]] = []
        self.pictures = {f.uav: TrafficPicture(rules, _FAR_M) for f in self.flyers}
        self.resolvers = {f.uav: TacticalResolver(f.uav, rules, clear) for f in self.flyers}
        self.now_s = self._lie_at_s = 0.0
        self.nearest_m = math.inf
        self.nearest: tuple[object, ...] = ()
        self.on_step: Callable[[], None] = lambda: None
        self._liars, self._deaf = liars, deaf
        for flyer in self.flyers:
            flyer.next_tick_s = float(self._rng.uniform(0.0, rules.tick_s))
            flyer.error_m = self._new_error()

    def _new_error(self) -> np.ndarray:
        way = self._rng.normal(size=3)
        return way / np.linalg.norm(way) * self._rng.uniform(0.0, self.rules.position_error_m)

    def fly(self, limit_s: float) -> bool:
        """Until all have arrived; whether they have."""
        while self.now_s < limit_s:
            self._step()
            if all(f.arrived_s is not None or f.dies_s <= self.now_s for f in self.flyers):
                return True
        return False

    def _step(self) -> None:
        self.now_s += STEP_S
        due = [mail for mail in self._mail if mail[0] <= self.now_s]
        self._mail = [mail for mail in self._mail if mail[0] > self.now_s]
        for at_s, to, of, word, said_s in due:
            if self.pictures[to].hear(of, word, self.now_s, at_s - said_s):
                each = next(each for each in self.flyers if each.uav == to)
                each.next_tick_s = min(each.next_tick_s, self.now_s + self.rules.tick_s)
        if self.now_s >= self._lie_at_s:
            self._lie_at_s += self.rules.tick_s
            for lie in self._liars:
                for of, word in lie(self):
                    for picture in self.pictures.values():
                        picture.hear(of, word, self.now_s, 0.0)
        for flyer in self.flyers:
            if self.now_s >= flyer.next_tick_s and self.now_s < flyer.dies_s:
                self._decide(flyer)
            while flyer.waiting and flyer.waiting[0][0] <= self.now_s:
                advice = flyer.waiting.pop(0)[1]
                if advice.path_enu_m != flyer.advice.path_enu_m or (
                    advice.maneuver is not flyer.advice.maneuver
                ):
                    flyer.detour_m = list(advice.path_enu_m)
                flyer.advice = advice
            self._move(flyer)
        self._measure()
        self.on_step()

    def told(self) -> str:
        """How it stands, for a test that fails."""
        lines = [f"at {self.now_s:.1f} s, nearest {self.nearest_m:.2f} m: {self.nearest}"]
        for each in self.flyers:
            place = each.place_m.round(1).tolist()
            lines.append(f"{each.uav} at {place}, arrived {each.arrived_s}: {each.story[-8:]}")
        return "\n".join(lines)

    def own(self, flyer: Flyer) -> OwnFlight:
        """As it knows itself."""
        told = flyer.place_m + flyer.error_m
        return OwnFlight(
            tuple(told.tolist()),
            tuple(flyer.velocity_m_s.tolist()),
            tuple(flyer.path_m),
            flyer.speed_m_s,
            Precedence(flyer.grade, flyer.rank),
        )

    def _decide(self, flyer: Flyer) -> None:
        # Errors of receivers wander slowly.
        flyer.error_m = 0.9 * flyer.error_m + 0.1 * self._new_error()
        own, resolver = self.own(flyer), self.resolvers[flyer.uav]
        before = resolver.advice
        advice = resolver.decide(own, self.pictures[flyer.uav], self.now_s)
        if (before.maneuver, before.braked) != (advice.maneuver, advice.braked):
            label = advice.maneuver.value + (" braked" if advice.braked else "")
            flyer.story.append((round(self.now_s, 2), f"{label} for {advice.because_of}"))
        flyer.next_tick_s += resolver.pace_s(own, self.pictures[flyer.uav], self.now_s)
        flyer.waiting.append((self.now_s + self._command_s, advice))
        word = resolver.word(own)
        for other in self.flyers:
            if other is not flyer and self._rng.random() >= self._loss_frac:
                at_s = self.now_s + self._delay_s * float(self._rng.uniform(0.2, 1.0))
                cut = any(a <= at_s < b for a, b in (other.deaf_s, flyer.deaf_s))
                if not (cut or self._deaf):
                    self._mail.append((at_s, other.uav, flyer.uav, word, self.now_s))

    def _move(self, flyer: Flyer) -> None:
        advice, path_m = flyer.advice, flyer.path_m
        speed_m_s = advice.speed_m_s or flyer.speed_m_s
        if advice.stands:
            path_m = []
        elif advice.path_enu_m:
            path_m = flyer.detour_m
        wanted = np.zeros(3)
        if path_m:
            way = np.array(path_m[0]) - flyer.place_m
            away_m = float(np.linalg.norm(way))
            last = len(path_m) == 1
            if away_m < (0.3 if last else 1.5):
                path_m.pop(0)
                if path_m is flyer.path_m and not path_m:
                    flyer.arrived_s, flyer.grade = self.now_s, Grade.FREE
            else:
                pace = min(speed_m_s, math.sqrt(2.0 * flyer.braking_m_s2 * away_m))
                if abs(way[2]) > 1e-6:
                    pace = min(pace, 2.0 * away_m / abs(way[2]))
                wanted = way / away_m * pace
        change = wanted - flyer.velocity_m_s
        most = flyer.braking_m_s2 * STEP_S
        size = float(np.linalg.norm(change))
        if size > most:
            change *= most / size
        flyer.velocity_m_s = flyer.velocity_m_s + change
        flyer.place_m = flyer.place_m + flyer.velocity_m_s * STEP_S

    def _measure(self) -> None:
        places = np.array([f.place_m for f in self.flyers])
        apart = np.linalg.norm(places[:, None] - places[None], axis=2)
        np.fill_diagonal(apart, np.inf)
        if (least := float(apart.min())) < self.nearest_m:
            i, j = np.unravel_index(int(apart.argmin()), apart.shape)
            self.nearest_m = least
            self.nearest = (round(self.now_s, 2), self.flyers[i].uav, self.flyers[j].uav)


def random_crowd(seed: int) -> Crowd:
    """2 to 10 UAVs with up to two corners on their ways, in a field as small as it is."""
    rng = np.random.default_rng(seed)
    count, speed_m_s = int(rng.integers(2, 11)), float(rng.uniform(4.0, 12.0))
    separation_m = float(rng.choice([5.0, 10.0, 15.0]))
    half_m = float(rng.uniform(2.0, 6.0)) * separation_m * math.sqrt(count)

    def spots() -> list[np.ndarray]:
        found: list[np.ndarray] = []
        while len(found) < count:
            spot = np.array([*rng.uniform(-half_m, half_m, 2), 30.0 + rng.uniform(-3.0, 3.0)])
            if all(np.linalg.norm(spot - other) >= 1.3 * separation_m + 3.0 for other in found):
                found.append(spot)
        return found

    starts, goals, ranks = spots(), spots(), rng.permutation(count)
    flyers = []
    for number in range(count):
        corners = [
            (*rng.uniform(-half_m, half_m, 2).tolist(), 30.0) for _ in range(rng.integers(0, 3))
        ]
        path = [*corners, tuple(goals[number].tolist())]
        own_m_s = speed_m_s * float(rng.uniform(0.5, 1.0))
        flyers.append(Flyer(f"u{number}", starts[number], path, own_m_s, int(ranks[number])))
    return Crowd(
        TrafficRules(separation_m, speed_m_s, low_m=10.0, high_m=110.0),
        flyers,
        seed,
        loss_frac=float(rng.uniform(0.0, 0.2)),
        delay_s=float(rng.choice([0.05, 0.3, 0.6])),
    )
