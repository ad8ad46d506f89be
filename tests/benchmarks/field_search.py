"""What the method `guided` gains over greedy under the field's constraints, by processor time.

Run it: ``python -m tests.benchmarks.field_search [SECONDS …]``; seconds are of each of the two
lanes that a search has, so other load on the machine matters little. Missions of 10 UAVs and 50
tasks, and of 3 × 15: batteries that last for about 40 % of a list, two bases with one slot each,
four zones, wind, and windows for half the tasks. ``--missions K`` plans K of each size.
"""

from __future__ import annotations

import argparse
import random
import time
from collections.abc import Iterable, Sequence
from itertools import chain

from coordinator.planner.field_guided import field_guided_plan
from coordinator.planner.options import after_time
from swarm.allocation.field import FieldProblem, FieldState
from swarm.kernels.field import FIELD_GREEDY, fly_lists, run_rule
from tests.support.field_missions import mission_of
from tests.support.field_oracle.made_up import Draft

SIZES = ((10, 50, 2000.0), (3, 15, 1200.0))
"""UAVs, tasks, and the side of the square where all of them lie [m]."""
LIMITS_S = (1.0, 3.0, 10.0)
SEARCH_SEEDS = (0, 1)
LANES = 2
KEPT_OFF_M = 5.0


class ProcessorClock:
    """Processor time of this process alone."""

    def now_s(self) -> float:
        """Since it began [s]."""
        return time.process_time()

    def wall_delay_s(self, delay_s: float) -> float:
        """As if nothing else ran."""
        return delay_s


def draft_of(seed: int, n_uav: int, n_task: int, side_m: float) -> Draft:
    """A mission whose slots are scarce."""
    rng = random.Random(seed)
    middles = [
        (side_m * (0.3 + 0.4 * east) + rng.uniform(-80, 80), side_m * (0.3 + 0.4 * north))
        for east in (0, 1)
        for north in (0, 1)
    ]
    half_m = 0.07 * side_m

    def place_m() -> list[float]:
        while True:
            east_m, north_m = (round(rng.uniform(0.0, side_m), 1) for _ in range(2))
            off_m = half_m + KEPT_OFF_M
            if all(abs(east_m - x) > off_m or abs(north_m - y) > off_m for x, y in middles):
                return [east_m, north_m]

    def task(index: int) -> dict[str, object]:
        row: dict[str, object] = {
            "id": f"t{index:02}",
            "position_m": place_m(),
            "value": float(rng.randint(1, 9)),
            "service_s": float(rng.choice([0, 10, 30])),
        }
        if rng.random() < 0.5:
            opens_s = float(rng.randint(0, 500))
            row |= {"opens_s": opens_s, "closes_s": opens_s + rng.randint(60, 300)}
        return row

    def uav(index: int) -> dict[str, object]:
        return {
            "id": f"u{index:02}",
            "position_m": place_m(),
            "speed_m_s": round(rng.uniform(9.0, 14.0), 1),
            "airspeed_m_s": 15.0,
            "acceleration_m_s2": 2.0,
            "endurance_s": 250.0,
            "reserve_frac": 0.2,
        }

    def corners_m(x: float, y: float) -> list[list[float]]:
        return [[x + a * half_m, y + b * half_m] for a, b in ((-1, -1), (1, -1), (1, 1), (-1, 1))]

    return {
        "schema": 2,
        "name": f"{n_uav}x{n_task}-{seed}",
        "mission": {"horizon_s": 1500.0, "wind_m_s": [2.0, -1.0]},
        "uav": [uav(index) for index in range(n_uav)],
        "base": [
            {"id": f"b{index}", "position_m": place_m(), "swap_s": 60.0, "slots": 1}
            for index in range(2)
        ],
        "zone": [
            {"id": f"z{index}", "polygon_m": corners_m(*middle)}
            for index, middle in enumerate(middles)
        ],
        "task": [task(index) for index in range(n_task)],
    }


def left_out(problem: FieldProblem, lists: Iterable[Sequence[int]]) -> int:
    """Required tasks on none of the lists of items."""
    done = {item >> 1 for item in chain.from_iterable(lists) if item >= 0}
    return sum(bool(problem.required[task]) and task not in done for task in range(problem.n_task))


def main(limits_s: Sequence[float], n_mission: int) -> None:
    """Plan and print."""
    clock = ProcessorClock()
    for n_uav, n_task, side_m in SIZES:
        for seed in range(n_mission):
            draft = draft_of(seed, n_uav, n_task, side_m)
            problem = FieldProblem.from_mission(mission_of(draft))
            state = FieldState.at_start(problem)
            greedy = run_rule(problem.kernel, state, FIELD_GREEDY).lists(n_uav)
            greedy_value = float(fly_lists(problem.kernel, state, greedy).value.sum())
            said = [f"greedy {left_out(problem, greedy):2} out, J {greedy_value:7.0f}"]
            for limit_s in limits_s:
                plans = [
                    field_guided_plan(problem, seed=each, stop=after_time(clock, LANES * limit_s))
                    for each in SEARCH_SEEDS
                ]
                out = " and ".join(str(left_out(problem, plan.lists)) for plan in plans)
                values = " and ".join(f"{plan.objective:.0f}" for plan in plans)
                said.append(f"{limit_s:g} s: {out} out, J {values}")
            print(f"{draft['name']:8} {' | '.join(said)}", flush=True)


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("limits_s", nargs="*", type=float, default=LIMITS_S)
    parser.add_argument("--missions", type=int, default=6)
    given = parser.parse_args()
    main(given.limits_s, given.missions)
