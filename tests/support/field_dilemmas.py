"""Tiny scenarios where being early is no virtue: short batteries, bases, openings far ahead.

`tests.support.field_oracle.made_up` seldom has all of these together in one place.
"""

from __future__ import annotations

import random

from tests.support.field_oracle.made_up import ADD, Draft, made_up


def dilemma(
    seed: int, n_uavs: int, n_tasks: int, *, slots: bool = False, extras: tuple[str, ...] = ()
) -> Draft:
    """A scenario, always the same of the same arguments.

    Args:
        seed: of everything.
        n_uavs: so many UAVs.
        n_tasks: so many tasks.
        slots: most bases have one slot.
        extras: further kinds of constraints, as `made_up` has them.
    """
    rng = random.Random(f"dilemma-{seed}-{n_uavs}-{n_tasks}-{slots}-{extras}")
    draft = made_up(seed, "energy", n_uavs=n_uavs, n_tasks=n_tasks)
    for base in draft["base"]:
        base["position_m"] = _in_the_middle(rng)
        base["swap_s"] = float(rng.randint(0, 90))
        if slots and rng.random() < 0.9:
            base["slots"] = 1
    for uav in draft["uav"]:
        uav["endurance_s"] = float(rng.randint(60, 140))
        uav["reserve_frac"] = 0.0
        uav["charge_frac"] = rng.choice([0.3, 0.5, 0.8, 1.0])
    for task in draft["task"]:
        task["position_m"] = _in_the_middle(rng)
        if rng.random() < 0.6:
            task["opens_s"] = float(rng.randint(0, 300))
        if rng.random() < 0.3:
            task["closes_s"] = task.get("opens_s", 0.0) + rng.randint(20, 150)
        if rng.random() < 0.2:
            task["due_s"] = task.get("opens_s", 0.0) + rng.randint(60, 200)
    for name in extras:
        ADD[name](rng, draft)
    return draft


def _in_the_middle(rng: random.Random) -> list[float]:
    return [rng.uniform(100.0, 300.0) for _ in range(2)]
