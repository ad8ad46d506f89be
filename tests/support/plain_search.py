"""The search of a small team's lists in plain Python: nothing is remembered, each place is valued.

What `swarm.kernels.routes` promises of teams of fewer than ten UAVs, up to 150 tasks and no given
lists. Local search before and after it, which has a reference of its own, is left to the kernel.
"""

from __future__ import annotations

import math

import numpy as np

from swarm.allocation import Problem, TeamState
from swarm.allocation.rules import team_arrays
from swarm.kernels.routes import improve_routes
from tests.support.reference import list_worth, team_worth

Lists = list[list[int]]

_MASK = 2**64 - 1
_HOTTEST, _RATIO, _FULL_HEAT, _TORN = 5.0, 500.0 ** (-1.0 / 64.0), 800.0, 10.0


class PlainRandom:
    """xoshiro256** seeded by splitmix64 (doi:10.1145/3460772)."""

    def __init__(self, seed: int) -> None:
        self.state = []
        for _ in range(4):
            seed = (seed + 0x9E3779B97F4A7C15) & _MASK
            z = ((seed ^ (seed >> 30)) * 0xBF58476D1CE4E5B9) & _MASK
            z = ((z ^ (z >> 27)) * 0x94D049BB133111EB) & _MASK
            self.state.append(z ^ (z >> 31))

    def bits(self) -> int:
        s = self.state
        result = (_rotated((s[1] * 5) & _MASK, 7) * 9) & _MASK
        shifted = (s[1] << 17) & _MASK
        s[2] ^= s[0]
        s[3] ^= s[1]
        s[1] ^= s[2]
        s[0] ^= s[3]
        s[2] ^= shifted
        s[3] = _rotated(s[3], 45)
        return result

    def uniform(self) -> float:
        return (self.bits() >> 11) * 2.0**-53

    def below(self, n: int) -> int:
        return ((self.bits() >> 32) * n) >> 32

    def exponential(self) -> float:
        return -math.log(((self.bits() >> 11) + 1) * 2.0**-53)


def _rotated(x: int, by: int) -> int:
    return ((x << by) | (x >> (64 - by))) & _MASK


class PlainLane:
    """Ruin and recreate with annealing on all lists of a team."""

    def __init__(self, problem: Problem, state: TeamState, lists: Lists, seed: int) -> None:
        self.problem, self.state, self.random = problem, state, PlainRandom(seed)
        self.lists = [list(route) for route in lists]
        self.best = [list(route) for route in lists]
        self.best_worth = team_worth(problem, state, lists)
        self.tasks = sorted(task for route in lists for task in route)
        self.uavs = [int(uav) for uav in np.flatnonzero(state.active)]
        self.until_blink = 1

    def run(self, iterations: int, temperature: float) -> None:
        for _ in range(iterations):
            before, worth = [list(route) for route in self.lists], self._worth()
            for task in self._order(self._ruin()):
                uav, place = self._best_place(task, may_blink=True) or self.place(task)
                self.lists[uav].insert(place, task)
            gain = self._worth() - worth
            if not gain > -temperature * self.random.exponential():
                self.lists = before
            elif worth + gain > self.best_worth:
                self.best, self.best_worth = [list(r) for r in self.lists], worth + gain

    def _worth(self) -> float:
        return team_worth(self.problem, self.state, self.lists)

    def _ruin(self) -> list[tuple[int, float]]:
        longest = min(10, max(1, len(self.tasks) // len(self.uavs)))
        strings = int(self.random.uniform() * (4.0 * _TORN / (1.0 + longest) - 1.0) + 1.0)
        first = self.tasks[self.random.below(len(self.tasks))]
        torn, touched = self._torn(first, longest)
        lists_touched = {touched}
        away_m = np.linalg.norm(self.problem.task_enu_m - self.problem.task_enu_m[first], axis=1)
        away_m[first] = -1.0
        for near in np.argsort(away_m, kind="stable")[1:49]:
            uav = self._uav_of(int(near))
            if len(lists_touched) < strings and uav is not None and uav not in lists_touched:
                more, touched = self._torn(int(near), longest)
                torn += more
                lists_touched.add(touched)
        return torn

    def _uav_of(self, task: int) -> int | None:
        return next((uav for uav in self.uavs if task in self.lists[uav]), None)

    def _torn(self, task: int, longest: int) -> tuple[list[tuple[int, float]], int]:
        uav = self._uav_of(task)
        assert uav is not None
        route, random = self.lists[uav], self.random
        length, kept = int(random.uniform() * min(longest, len(route)) + 1.0), 0
        if 1 < length < len(route) and random.uniform() < 0.5:
            kept = 1
            while length + kept < len(route) and random.uniform() > 0.01:
                kept += 1
        span, here = length + kept, route.index(task)
        low, high = max(0, here - span + 1), min(here, len(route) - span)
        begin = low + random.below(high - low + 1)
        gap = 1 + random.below(length) if kept else span
        taken = [k for k in range(span) if k < gap or k >= gap + kept]
        completed_s = self._completions_s(uav)
        torn = [(route[begin + k], completed_s[begin + k]) for k in taken]
        gone = {task for task, _ in torn}
        self.lists[uav] = [task for task in route if task not in gone]
        return torn, uav

    def _completions_s(self, uav: int) -> list[float]:
        now_s, here, times_s = float(self.state.free_s[uav]), self.state.place_enu_m[uav], []
        for task in self.lists[uav]:
            now_s += self.problem.travel_s(uav, here)[task] + self.problem.service_s[task]
            here = self.problem.task_enu_m[task]
            times_s.append(now_s)
        return times_s

    def _order(self, torn: list[tuple[int, float]]) -> list[int]:
        kind = self.random.below(10)
        keys = []
        for task, completion_s in torn:
            if kind < 4:
                key = self.random.uniform()
            elif kind < 8:
                key = -float(self.problem.value[task])
            else:
                key = completion_s if kind == 8 else -completion_s
            keys.append((key, task))
        return [task for _, task in sorted(keys)]

    def place(self, task: int) -> tuple[int, int]:
        place = self._best_place(task, may_blink=False)
        assert place is not None
        return place

    def _best_place(self, task: int, *, may_blink: bool) -> tuple[int, int] | None:
        best, most = None, -math.inf
        for uav in self.uavs:
            if not self.problem.capable[uav, task]:
                continue
            route = self.lists[uav]
            now = list_worth(self.problem, self.state, uav, route)
            for place in range(len(route) + 1):
                if may_blink and self._blinks():
                    continue
                longer = [*route[:place], task, *route[place:]]
                gain = list_worth(self.problem, self.state, uav, longer) - now
                if gain > most:
                    best, most = (uav, place), gain
        return best

    def _blinks(self) -> bool:
        self.until_blink -= 1
        if self.until_blink > 0:
            return False
        self.until_blink = 1 + int(99.5 * self.random.exponential())
        return True


def plain_search(problem: Problem, state: TeamState, seed: int, iterations: int) -> Lists:
    """Lists as `optimise_routes` makes them from nothing."""
    team = team_arrays(problem, state, state.active, 0.0)
    random = PlainRandom(seed)
    seeds = [random.bits(), random.bits()]
    begun = _begun(problem, state)
    mean_delay = _mean_delay(problem, state, begun)
    begun = improve_routes(team, begun)
    lanes = [PlainLane(problem, state, begun, seed) for seed in seeds]
    share = iterations / max(1.0, float(np.sum(state.open)) * _FULL_HEAT)
    done = 0
    while done < iterations:
        spent = done / iterations
        heat = min(1.0, share**0.25) * (1.0 - spent)
        cold = (1.0 - heat) * 64
        steps = int(cold)
        factor = _RATIO**steps * (1.0 - (cold - steps) * (1.0 - _RATIO))
        now = min(max(20, min(400, iterations // 2 // 64)), -(-(iterations - done) // 2))
        for lane in lanes:
            lane.run(now, _HOTTEST * mean_delay * factor)
        done += 2 * now
    return improve_routes(team, max(lanes, key=lambda lane: lane.best_worth).best)


def _begun(problem: Problem, state: TeamState) -> Lists:
    lane = PlainLane(problem, state, [[] for _ in range(problem.n_uav)], 0)
    able = problem.capable & state.active[:, None] & state.open
    most = np.where(able, problem.weight, -1.0).max(axis=0)
    for task in np.argsort(-most, kind="stable"):
        if able[:, task].any():
            uav, place = lane.place(int(task))
            lane.lists[uav].insert(place, int(task))
    return lane.lists


def _mean_delay(problem: Problem, state: TeamState, lists: Lists) -> float:
    delays = []
    for uav, route in enumerate(lists):
        survived, now_s, here = (
            float(state.survived[uav]),
            float(state.free_s[uav]),
            state.place_enu_m[uav],
        )
        for task in route:
            now_s += problem.travel_s(uav, here)[task] + problem.service_s[task]
            here = problem.task_enu_m[task]
            delays.append(survived * problem.weight[uav, task] * (now_s - state.free_s[uav]))
            survived *= problem.survival[uav, task]
    return float(np.mean(delays)) if delays else 0.0
