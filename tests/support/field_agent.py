"""One agent's core in a mission with the field's constraints, its decisions told by the test."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

from agent.core.decision import DecisionTurn
from agent.core.field_decision import FieldRule, FieldTurnDecision
from agent.core.interface import (
    Action,
    GoTo,
    Landed,
    Return,
    Swap,
    Swapped,
    VehicleOrder,
    VehicleReady,
)
from agent.core.states import AgentState
from agent.core.verticals import Verticals
from swarm.allocation.field import FieldProblem
from swarm.allocation.field.ways import base_node, task_nodes
from swarm.model import BaseId, TaskId, UavId
from swarm.model.ids import OPERATOR
from swarm.protocol.board import TaskBoard
from swarm.protocol.events import Stop
from swarm.protocol.field_messages import BaseSpec, UavReady, ZoneEdit, ZoneSpec
from swarm.protocol.messages import CommandKind, OperatorCommand, Snapshot
from swarm.protocol.timing import Timing
from swarm.protocol.uav_messages import BaseStage, Claim, ClaimPhase, Outcome
from tests.support.builders import uav
from tests.support.lone_agent import TIMING, LoneAgent, orders, outcomes

ENDURANCE_S = 500.0
BUDGET_S = 400.0
"""Of a full battery, its reserve kept."""
SWAP_S = 20.0
BASE = BaseSpec("b0", (50.0, 0.0, 0.0), SWAP_S, 1)
FAR_BASE = BaseSpec("b1", (0.0, 300.0, 0.0), SWAP_S, None)


def square(name: str, east_m: float, north_m: float, half_m: float = 5.0) -> ZoneSpec:
    """A zone around that place, from the ground to the sky."""
    corners = ((-half_m, -half_m), (half_m, -half_m), (half_m, half_m), (-half_m, half_m))
    ring = tuple((east_m + east, north_m + north) for east, north in corners)
    return ZoneSpec(name, ring, (), None, None, False)


class Script:
    """Stands in for `decide_in_field`: each UAV's next items, taken one by one."""

    def __init__(self) -> None:
        self.items: list[str] = []
        """Task ids, ``-`` before the id of a line to fly backwards, ``base:`` before a base."""
        self.turns: list[DecisionTurn] = []

    def decide(
        self, problem: FieldProblem, board: TaskBoard, rule: FieldRule, turn: DecisionTurn
    ) -> FieldTurnDecision | None:
        """The next item, with the times that the problem gives."""
        self.turns.append(turn)
        if not self.items:
            return None
        item = self.items.pop(0)
        base = item.removeprefix("base:") if item.startswith("base:") else None
        backwards, task = item.startswith("-"), item.removeprefix("-")
        row = problem.uav_ids.index(UavId(turn.uav))
        legs_s = problem.legs_from_s(row, turn.place_enu_m)
        if base is not None:
            arrive_s = turn.now_s + float(legs_s[base_node(problem, base)])
            times_s = turn.now_s, arrive_s, arrive_s, arrive_s + SWAP_S
        else:
            column = problem.task_ids.index(TaskId(task))
            leg_s = float(legs_s[task_nodes(problem, column, backwards=backwards)[0]])
            opens_s = float(problem.opens_s[column])
            depart_s = turn.now_s
            if turn.landed_at is not None:
                depart_s = max(turn.now_s, opens_s - leg_s)
            begin_s = max(depart_s + leg_s, opens_s)
            line_s = float(problem.line_s[problem.kind[row], column, int(backwards)])
            end_s = begin_s + line_s + float(problem.service_s[column])
            times_s = depart_s, depart_s + leg_s, begin_s, end_s
        sortie_end_s = turn.sortie_end_s
        if turn.landed_at is not None:
            sortie_end_s = times_s[0] + float(problem.full_s[row])
        return FieldTurnDecision(
            0,
            None if base is not None else TaskId(task),
            None if base is None else BaseId(base),
            backwards,
            *times_s,
            sortie_end_s,
            None if base is not None else 1.0,
            None,
        )


class FieldAgent(LoneAgent):
    """The agent of `u0`, 1 m/s fast, with 400 s of battery, near the base `b0` with one slot."""

    def __init__(
        self,
        *others: str,
        timing: Timing = TIMING,
        bases: Sequence[BaseSpec] = (BASE,),
        zones: Sequence[ZoneSpec] = (),
        endurance_s: float | None = ENDURANCE_S,
        incarnation: int = 5,
        now_s: float = 100.0,
        memory: Snapshot | None = None,
        memory_age_s: float = 0.0,
        verticals: Verticals | None = None,
    ) -> None:
        fleet = (uav("u0"), *(uav(name, 10.0) for name in others))
        self._given = others, timing
        super().__init__(
            *fleet,
            timing=timing,
            incarnation=incarnation,
            now_s=now_s,
            memory=memory,
            memory_age_s=memory_age_s,
            verticals=verticals,
        )
        specs = tuple(replace(spec, endurance_s=endurance_s) for spec in self.brief.uavs)
        self.brief = replace(self.brief, uavs=specs, bases=tuple(bases), zones=tuple(zones))

    def next_life(self, *, down_s: float = 2.0) -> FieldAgent:
        """The next life of this agent, which has learned nothing from others yet."""
        memory = self.core.memory(self.now_s + down_s)
        others, timing = self._given
        incarnation, now_s = memory.incarnation + 1, self.now_s + down_s
        agent = FieldAgent(*others, timing=timing, incarnation=incarnation, now_s=now_s)
        agent.brief, agent._counters = self.brief, self._counters
        agent.learn_what_was_known_to(self)
        return agent

    # -- what happens ------------------------------------------------------------------

    def happen_ready(self) -> list[Action]:
        """Its vehicle is under command again."""
        return self.happen(VehicleReady())

    def stop(self, mission_s: float) -> list[Action]:
        """Its process is told to end."""
        return self.happen(Stop("told to stop"), mission_s)

    def touch_down(self, mission_s: float) -> list[Action]:
        return self.happen(Landed(self.leg), mission_s)

    def get_full(self, mission_s: float) -> list[Action]:
        return self.happen(Swapped(self.leg), mission_s)

    def told(self, kind: CommandKind, mission_s: float) -> list[Action]:
        """The operator says so to it."""
        return self.hear(OPERATOR, OperatorCommand("u0", kind, self.brief.run, ""), mission_s)

    def drawn(self, zone: ZoneSpec, mission_s: float, *, withdrawn: bool = False) -> list[Action]:
        """The operator draws a zone, or takes it away."""
        return self.hear(OPERATOR, ZoneEdit(zone, withdrawn, self.brief.run, ""), mission_s)

    def vouched(self, name: str, mission_s: float) -> list[Action]:
        """The operator says that a UAV on the ground is ready."""
        return self.hear(OPERATOR, UavReady(name, self.brief.run, ""), mission_s)

    # -- what came of it ---------------------------------------------------------------

    def state(self) -> AgentState:
        """What it is about; asked anew each time, as checkers take properties for constant."""
        return self.core.state

    @property
    def stage(self) -> BaseStage | None:
        return None if self.claim is None else self.claim.stage

    @property
    def last_order(self) -> VehicleOrder:
        return orders(self.log)[-1]

    @property
    def flight(self) -> GoTo:
        order = self.last_order
        assert isinstance(order, GoTo), order
        return order

    @property
    def landing(self) -> Swap:
        order = self.last_order
        assert isinstance(order, Swap), order
        return order

    @property
    def way_home(self) -> Return:
        order = self.last_order
        assert isinstance(order, Return), order
        return order

    @property
    def outcome(self) -> Outcome:
        return outcomes(self.log)[-1]


def visiting(stage: BaseStage, arrives_s: float, base: str = "b0", ready_s: float = 1e3) -> Claim:
    """What another UAV says that visits a base."""
    return Claim(
        ClaimPhase.HELD, None, 0.0, 1, ready_s, base=base, stage=stage, arrives_s=arrives_s
    )
