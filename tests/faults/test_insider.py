"""Somebody with valid keys lies about all others: they fly as if nothing had been said."""

from __future__ import annotations

import functools
from collections.abc import Collection
from dataclasses import dataclass, field, replace

import numpy as np
import pytest

from coordinator.mission_view.results import MissionResult
from sim.faults.case import Case, CaseResult, limit_s, play, quick_plan
from sim.faults.schedule import parse_schedule
from sim.world.engine import EventQueue
from sim.world.network import NetworkConditions, Node
from sim.world.rough_network import RoughNetwork
from sim.world.settings import WorldSettings
from sim.world.virtual_world import World
from swarm.bus.admission import RateLimiter
from swarm.model import UavId
from swarm.protocol.encoding import encode
from swarm.protocol.fields import MAX_COUNT
from swarm.protocol.key_space import KeySpace
from swarm.protocol.messages import Message, Stamp
from swarm.protocol.seal import Seal
from swarm.protocol.uav_messages import Outcome
from tests.chaos.insider import Insider
from tests.faults.sealed_network import SealedNetwork
from tests.support.builders import OUT
from tests.support.keyring import Keyring
from tests.support.seeds import seeds

LIAR = "u0"
EVERY_S = 0.05
"""Between two lies."""


@dataclass(slots=True)
class Flight:
    """One case, flown behind seals."""

    case: Case
    lies: bool = True
    keys: Keyring = field(init=False)
    verdict: CaseResult = field(init=False)
    network: SealedNetwork = field(init=False)

    def __post_init__(self) -> None:
        self.keys = keys_of(self.case)
        self.verdict = play(self.case, join=self._join)

    def _join(self, queue: EventQueue, conditions: NetworkConditions, seed: int) -> SealedNetwork:
        self.network = sealed(self.keys, queue, conditions, seed)
        if self.lies:
            self._set_liar_on(self.network, queue, self.keys.seal(LIAR))
        return self.network

    def _set_liar_on(self, network: SealedNetwork, queue: EventQueue, seal: Seal) -> None:
        mission = self.case.flown()
        others = [uav.id for uav in mission.uavs if uav.id != LIAR]
        tasks = [task.id for task in mission.tasks]
        rng = np.random.default_rng([self.case.seed, 8])
        insider = Insider(mission.name, seal, others, tasks, rng)
        network.overheard = insider.overhear

        def amend(writer: str, answer: bytes, nonce: bytes) -> bytes:
            return insider.amended(answer, nonce) if writer == LIAR else answer

        def lie() -> None:
            told = insider.lie()
            network.lie(told.key, told.payload)
            queue.after(EVERY_S, lie)

        network.amend = amend
        queue.after(EVERY_S, lie)


def keys_of(case: Case) -> Keyring:
    mission = case.flown()
    return Keyring(*(uav.id for uav in mission.uavs), mission=mission.name)


def sealed(
    keys: Keyring, queue: EventQueue, conditions: NetworkConditions, seed: int
) -> SealedNetwork:
    return SealedNetwork(
        queue,
        conditions,
        seed,
        keys.roster.mission,
        functools.cache(keys.seal),
        keys.seal("dashboard"),
    )


def case(seed: int, *lines: str) -> Case:
    drawn = Case(seed, 4, 10, popups=2)
    names = drawn.processes()
    tasks = [task.id for task in drawn.flown().tasks]
    return replace(drawn, schedule=parse_schedule(lines, "the test", names, tasks))


@pytest.mark.parametrize("seed", seeds(2, 4))
def test_all_fly_as_without_the_liar(seed: int) -> None:
    honest, lied_to = Flight(case(seed), lies=False), Flight(case(seed))

    assert lied_to.verdict.broken is None
    result = lied_to.verdict.world.mission_state.result()
    assert result == honest.verdict.world.mission_state.result()
    assert result.open == ()
    assert honest.network.ear.dropped == {}
    dropped = lied_to.network.ear.dropped
    assert dropped.keys() == {
        "not the signer's to say",
        "wrongly signed",
        "not signed",
        "said on another's key",
    }
    assert min(dropped.values()) > 20


FAULTS = [
    "5 crash u1 for 3 with disk",
    "8 cut u2 u3 for 4",
    "12 crash coordinator for 4 with disk",
    "15 lose u3",
    "18 crash u2 for 2 with none",
    "20 weather by 0.3 for 5",
]


@pytest.mark.parametrize("seed", seeds(2, 4))
def test_whatever_else_goes_wrong_no_invariant_breaks(seed: int) -> None:
    verdict = Flight(case(seed, *FAULTS)).verdict

    assert verdict.broken is None
    assert verdict.world.mission_state.result().open == ()


@pytest.mark.parametrize("seed", seeds(2, 4))
def test_what_one_who_is_revoked_leaves_is_done_by_the_others(seed: int) -> None:
    """Its token and its words count no longer, so it is as good as lost; what it had done by
    then stays done."""
    flown = case(seed)
    keys, networks = keys_of(flown), list[SealedNetwork]()

    def join(queue: EventQueue) -> SealedNetwork:
        networks.append(sealed(keys, queue, NetworkConditions(), seed))
        return networks[0]

    world = World(
        flown.flown(),
        quick_plan,
        method=flown.method,
        seed=seed,
        timing=flown.link().timing,
        setting=WorldSettings(network=join, plan_s=0.05, telemetry_s=0.2),
    )
    before: list[MissionResult] = []

    def revoke() -> None:
        before.append(world.mission_state.result())
        networks[0].revoke(keys.signed(keys.without(LIAR)))

    world.queue.at(14.0, revoke)

    assert world.run(limit_s(flown))
    result = world.mission_state.result()
    assert result.open == ()
    assert before[0].executed_routes[UavId(LIAR)] == result.executed_routes[UavId(LIAR)]
    assert networks[0].ear.dropped["signer unknown"] > 0


@pytest.mark.parametrize("seed", seeds(2, 4))
def test_who_gets_new_keys_is_heard_whatever_a_thief_of_the_old_ones_has_said(seed: int) -> None:
    """Such as the largest stamps there are, above which nobody can speak under the same keys."""
    flown = case(seed, f"5 crash {LIAR} for 3 with none")
    keys = keys_of(flown)

    def join(queue: EventQueue, conditions: NetworkConditions, seed: int) -> SealedNetwork:
        network = SealedNetwork(
            queue, conditions, seed, flown.flown().name, keys.seal, keys.seal("dashboard")
        )
        stolen = keys.seal(LIAR)

        def lie() -> None:
            said = Message(flown.flown().name, LIAR, Stamp(MAX_COUNT, MAX_COUNT), OUT)
            network.lie(said.key, stolen.wrap(encode(said)))

        queue.at(6.0, lie)
        queue.at(7.0, lambda: network.reissue(LIAR, keys.signed(keys.renewed(LIAR))))
        return network

    verdict = play(flown, join=join)

    assert verdict.broken is None
    mission_state = verdict.world.mission_state
    assert mission_state.result().open == ()
    claimed = mission_state.replica.register(KeySpace(flown.flown().name).claim(LIAR))
    assert claimed is not None
    assert claimed.stamp < Stamp(MAX_COUNT, MAX_COUNT)
    done_s = [
        message.body.completed_s
        for message in mission_state.replica.messages({LIAR})
        if isinstance(message.body, Outcome)
    ]
    assert max(done_s) > 8.0, "it has taken tasks again"


class Storm(RoughNetwork):
    """Lets so little of each writer through that honest registers are lost all the time."""

    def __init__(self, queue: EventQueue, conditions: NetworkConditions, seed: int) -> None:
        super().__init__(queue, conditions, seed)
        self.lost = 0
        self._limiter = RateLimiter(1.5, 4)

    def publish(self, sender: Node, message: Message, to: Collection[str] | None = None) -> None:
        if self._limiter.allows(message.writer, self._queue.now_s()):
            super().publish(sender, message, to)
        else:
            self.lost += 1


@pytest.mark.parametrize("seed", seeds(2, 4))
def test_what_a_limit_keeps_out_comes_back_by_repetition_and_questions(seed: int) -> None:
    networks: list[Storm] = []

    def join(queue: EventQueue, conditions: NetworkConditions, seed: int) -> Storm:
        networks.append(Storm(queue, conditions, seed))
        return networks[0]

    verdict = play(case(seed, "5 crash u1 for 3 with disk", "15 lose u3"), join=join)

    assert networks[0].lost > 50
    assert verdict.broken is None
    assert verdict.world.mission_state.result().open == ()
