"""Random faults of random vehicles behind real bridges, on a network as it is, judged like all.

What must hold of every bridge is watched in every step (tests.support.bridge_watch).
"""

from __future__ import annotations

import numpy as np
import pytest

from agent.core.interface import GoTo, HandedOver, Refused, ReturnAdvised
from agent.vehicle.config import CommandStyle
from sim.autopilot.faults import FaultKind
from sim.autopilot.firmware import FirmwareModelName
from sim.faults.injector import FaultInjector
from sim.faults.invariants import InvariantChecker
from sim.world.bridged_vehicle import LinkQuality
from sim.world.engine import EventQueue
from sim.world.network import NetworkConditions
from sim.world.rough_network import RoughNetwork
from tests.support.bridged_fleet import FIELD, BridgedFleet
from tests.support.seeds import seeds

LASTING = sorted(set(FaultKind) - {FaultKind.REBOOT, FaultKind.BATTERY_LOW, FaultKind.FAILSAFE_RTL})
LIMIT_S = 500.0


def random_faults(rng: np.random.Generator) -> str:
    """One or two faults between power-up and landing, some of which end."""
    words = []
    for _ in range(int(rng.integers(1, 3))):
        kind = str(rng.choice(sorted(FaultKind)))
        at_s = 0.0 if rng.random() < 0.15 else float(rng.uniform(0.5, 40.0))
        lasts = f"+{rng.uniform(0.5, 30.0):.2f}" if kind in LASTING and rng.random() < 0.7 else ""
        words.append(f"{kind}@{at_s:.2f}{lasts}")
    return " ".join(words)


@pytest.mark.parametrize("seed", seeds(6, 24))
def test_whatever_befalls_two_vehicles_the_third_one_does_the_rest(seed: int) -> None:
    rng = np.random.default_rng([seed, 23])
    flavour = list(FirmwareModelName)[seed % 2]
    style = list(CommandStyle)[seed // 2 % 2]
    faults = {uav: random_faults(rng) for uav in ("u0", "u2")}
    judge, networks = InvariantChecker(), list[RoughNetwork]()

    def network(queue: EventQueue) -> RoughNetwork:
        networks.append(RoughNetwork(queue, NetworkConditions(), seed))
        return networks[0]

    fleet = BridgedFleet(
        flavour,
        style,
        faults=faults,
        seed=seed,
        link=LinkQuality(0.01, float(rng.choice([0.0, 0.05]))),
        network=network,
        watch=judge,
    )

    def excuse(uav: str, said: object) -> None:
        """Who has lost its vehicle, or sends it home, may leave any task; who is refused, one."""
        if isinstance(said, HandedOver | ReturnAdvised):
            for task in FIELD.tasks:
                judge.message_log.refused(uav, task.id)
        elif isinstance(said, Refused) and isinstance(said.order, GoTo):
            judge.refused(fleet.world.processes[uav], said.order)

    fleet.on_said = excuse
    judge.attend(fleet.world, networks[0], FaultInjector(fleet.world, networks[0], ()))
    ended = fleet.world.run(LIMIT_S)

    judge.conclude()
    told = "\n".join((str(faults), *fleet.told()))
    assert judge.broken is None, told
    assert ended, told
    assert {task.id for task in FIELD.tasks} == set(fleet.world.mission_state.result().done), told
    assert fleet.books["u1"].reasons(HandedOver) == [], told
