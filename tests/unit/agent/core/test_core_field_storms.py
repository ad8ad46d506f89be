"""Whatever happens in a mission of the field, in whatever order: nothing raises, nothing spins."""

from __future__ import annotations

from dataclasses import replace

from agent.core.interface import Event, Landed, Swap, Swapped, Telemetry
from agent.core.states import AT_BASE, VISITS_BASE, AgentState
from swarm.model.ids import OPERATOR
from swarm.protocol.field_messages import BaseSpec, UavReady, ZoneEdit
from swarm.protocol.messages import Body, TaskEntry
from swarm.protocol.uav_messages import BaseStage, Claim, ClaimPhase
from tests.support.field_agent import square
from tests.unit.agent.core.test_core_deadlines import BRIEF, Storm

STORMS, MOST_STORMS = 40, 160
"""So many at least, and more until every state was reached: else they would prove little."""
BASES = (BaseSpec("b0", (3.0, 0.0, 0.0), 1.0, 1), BaseSpec("b1", (0.0, 3.0, 0.0), 0.5, None))


class FieldStorm(Storm):
    """The same with bases, batteries, zones and windows."""

    brief = replace(
        BRIEF,
        uavs=tuple(replace(spec, endurance_s=30.0) for spec in BRIEF.uavs),
        bases=BASES,
    )

    def uav_body(self) -> Body:
        if self.rng.random() < 0.5:
            return super().uav_body()
        stage, at_s = self.pick(*BaseStage), float(self.rng.uniform(0.0, 20.0))
        phase = ClaimPhase.HELD
        if stage in (BaseStage.LANDED, BaseStage.PARKED):
            phase = self.pick(ClaimPhase.HELD, ClaimPhase.IDLE)
        base = self.pick("b0", "b0", "b1")
        return Claim(phase, None, at_s, 1, at_s + 5.0, base=base, stage=stage, arrives_s=at_s)

    def coordinator_body(self) -> Body:
        body = super().coordinator_body()
        if not isinstance(body, TaskEntry):
            return body
        opens_s = float(self.pick(0.0, self.rng.uniform(0.0, 60.0)))
        east_m, north_m, _ = body.position_enu_m
        line = ((east_m, north_m, 0.0), (east_m, north_m + 4.0, 0.0))
        return replace(
            body,
            opens_s=opens_s,
            due_s=self.pick(None, None, opens_s + 20.0),
            path_enu_m=self.pick((), (), line),
        )

    def event(self) -> Event:
        if self.rng.random() < 0.02:
            half_m = float(self.rng.uniform(0.2, 1.5))
            east_m, north_m = map(float, self.rng.uniform(0.0, 9.0, 2))
            zone = square("z", east_m, north_m, half_m)
            withdrawn = bool(self.rng.random() < 0.5)
            return self.heard(OPERATOR, ZoneEdit(zone, withdrawn, self.brief.run, ""))
        if self.rng.random() < 0.02:
            return self.heard(OPERATOR, UavReady(self.pick("u1", "u2"), self.brief.run, ""))
        return super().event()

    def report(self) -> Event:
        landings = [order.leg for order in self.ordered if isinstance(order, Swap)]
        east_m, north_m = map(float, self.rng.uniform(0.0, 9.0, 2))
        battery_frac = float(self.rng.uniform(0.3, 1.0))
        choices: list[Event] = [super().report(), super().report()]
        choices += [Telemetry((east_m, north_m, 10.0), (0.0, 0.0, 0.0), battery_frac)]
        if landings:
            choices += [Landed(landings[-1]), Swapped(landings[-1]), Swapped(landings[-1])]
        event: Event = self.pick(*choices)
        return event


def test_no_storm_in_the_field_raises_and_all_reach_every_state_of_a_visit_to_a_base() -> None:
    unreached: set[AgentState] = set(VISITS_BASE | AT_BASE)
    for seed in range(MOST_STORMS):
        storm = FieldStorm(seed)
        for _ in range(200):
            storm.blow()
            unreached.discard(storm.core.state)
        if seed + 1 >= STORMS and not unreached:
            return
    assert unreached == set()
