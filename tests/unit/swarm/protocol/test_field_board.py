"""What registers say of a mission in the field."""

from __future__ import annotations

import math
import random
from dataclasses import replace

import numpy as np

from swarm.allocation.field import FieldProblem
from swarm.kernels.field import FIELD_GREEDY
from swarm.model import Base, BaseId, Mission, Task, TaskId, Uav, UavId
from swarm.model.ids import COORDINATOR
from swarm.protocol.board import TaskBoard
from swarm.protocol.field_board import (
    anything_doable_in_field,
    doable_in_field,
    field_state,
)
from swarm.protocol.messages import Body
from swarm.protocol.registers import Replica
from swarm.protocol.uav_messages import AttemptResult, BaseStage, Claim, ClaimPhase, Outcome
from tests.support.builders import IDLE, MISSION, OUT, message
from tests.support.field_dilemmas import dilemma
from tests.support.field_missions import mission_of
from tests.support.field_registers import PlannedRun, brief_of, entries_of

FLIGHT = Mission(
    "flight",
    1000.0,
    (
        Uav(UavId("u0"), (0.0, 0.0, 0.0), 10.0, endurance_s=100.0, reserve_frac=0.0),
        Uav(UavId("u1"), (0.0, 10.0, 0.0), 10.0, endurance_s=100.0, reserve_frac=0.0),
    ),
    (
        Task(TaskId("near"), (100.0, 0.0, 0.0), 1.0),
        Task(TaskId("far"), (900.0, 0.0, 0.0), 1.0),
        Task(
            TaskId("line"),
            (0.0, 50.0, 0.0),
            1.0,
            path_enu_m=((0.0, 50.0, 0.0), (200.0, 50.0, 0.0)),
        ),
    ),
    bases=(Base(BaseId("b0"), (500.0, 0.0, 0.0), 30.0, 1),),
)


class Registers:
    def __init__(self, mission: Mission = FLIGHT) -> None:
        self._replica = Replica()
        self._said = 0
        self.board = TaskBoard(self._replica, MISSION)
        self.say(COORDINATOR, brief_of(mission))
        for entry in entries_of(mission):
            self.say(COORDINATOR, entry)
        for uav in mission.uavs:
            self.say(uav.id, IDLE)

    def say(self, writer: str, body: Body) -> Registers:
        self._said += 1
        self._replica.join(message(writer, body, self._said))
        return self

    @property
    def problem(self) -> FieldProblem:
        problem = self.board.field_problem
        assert problem is not None
        return problem

    def doable(self, *present: str, now_s: float = 0.0) -> list[str]:
        found = doable_in_field(self.problem, self.board, present, now_s)
        anything = anything_doable_in_field(self.problem, self.board, present, now_s)
        assert anything == bool(found)
        return found


def visit(stage: BaseStage, *, sortie_end_s: float | None = None, **more: float) -> Claim:
    claim = Claim(ClaimPhase.HELD, None, 0.0, 0, 90.0, base="b0", stage=stage)
    return replace(claim, arrives_s=60.0, sortie_end_s=sortie_end_s, **more)  # type: ignore[arg-type]


def test_who_flies_a_line_backwards_is_free_at_its_first_point() -> None:
    claim = Claim(ClaimPhase.HELD, "line", 0.0, 0, 44.0, sortie_end_s=100.0, reversed=True)
    registers = Registers().say("u0", claim)

    state = field_state(registers.problem, registers.board, {"u0": claim}, present={"u0", "u1"})

    legs_s = registers.problem.leg_s[0, registers.problem.enter[2, 0]]
    np.testing.assert_array_equal(state.first_s[0], legs_s)
    assert state.free_s.tolist() == [44.0, 0.0]
    assert state.sortie_end_s.tolist() == [100.0, 100.0]
    assert state.open.tolist() == [True, True, False]


def test_stages_at_a_base_tell_who_has_a_slot() -> None:
    slot = {
        BaseStage.APPROACHING: 60.0,
        BaseStage.WAITING: 60.0,
        BaseStage.LANDED: -math.inf,
        BaseStage.PARKED: math.inf,
    }
    for stage, arrives_s in slot.items():
        claim = visit(stage, sortie_end_s=100.0 if arrives_s == 60.0 else None)
        registers = Registers().say("u0", claim)
        state = field_state(registers.problem, registers.board, {"u0": claim}, present={"u0"})
        assert (state.landed_at[0], state.free_s[0]) == (0, 90.0)
        assert state.arrives_s[0] == arrives_s


def test_who_waits_on_the_ground_keeps_its_slot_until_it_departs() -> None:
    claim = replace(visit(BaseStage.LANDED), task="far", completion_s=300.0, departs_s=200.0)
    registers = Registers().say("u0", claim)

    state = field_state(registers.problem, registers.board, {"u0": claim}, present={"u0"})

    assert (state.landed_at[0], state.leaving[0], state.leaves_s[0]) == (-1, 0, 200.0)
    assert (state.free_s[0], state.sortie_end_s[0]) == (300.0, 300.0)


def test_the_lost_block_a_slot_or_are_nowhere() -> None:
    registers = Registers().say("u0", visit(BaseStage.LANDED))
    problem, board = registers.problem, registers.board

    gone = field_state(problem, board, {}, present={"u1"})
    stands = field_state(problem, board, {}, present={"u1"}, blocking={"u0": "b0"})

    assert gone.landed_at.tolist() == [-1, -1]
    assert (stands.landed_at.tolist(), stands.active.tolist()) == ([0, -1], [False, True])


def test_tasks_are_doable_as_long_as_energy_lasts_and_by_swaps() -> None:
    registers = Registers()

    assert registers.doable("u0", "u1") == ["near", "far", "line"]  # the far one by way of the base
    assert registers.doable("u0", now_s=95.0) == []
    assert registers.doable() == []
    standing = replace(visit(BaseStage.PARKED), phase=ClaimPhase.IDLE)
    assert registers.say("u0", standing).doable("u0", now_s=500.0) == ["near", "far", "line"]
    assert registers.say("u0", OUT).doable("u0") == []


def test_who_has_landed_away_from_all_bases_can_do_nothing_more() -> None:
    registers = Registers().say("u0", Outcome("near", AttemptResult.DONE, 1, 20.0))

    assert registers.doable("u0", now_s=20.0) == []
    airborne = replace(IDLE, sortie_end_s=100.0)
    assert registers.say("u0", airborne).doable("u0", now_s=20.0) == ["far", "line"]


def test_what_somebody_claims_counts_as_doable() -> None:
    claim = Claim(ClaimPhase.HELD, "far", 0.0, 0, 90.0, sortie_end_s=100.0)
    registers = Registers().say("u0", claim)

    assert "far" in registers.doable("u0", now_s=99.0)
    assert registers.doable("u1", now_s=99.0) == []


def test_who_has_just_told_of_its_outcome_has_left_for_what_comes_next() -> None:
    """From (100, 0) it is at the base just in time, at 50 s; there it swaps, for what is far."""
    claim = Claim(ClaimPhase.HELD, "near", 0.0, 0, 10.0, sortie_end_s=50.0)
    registers = Registers().say("u0", claim).say("u1", OUT)
    registers.say("u0", Outcome("near", AttemptResult.DONE, 1, 10.0))
    assert "far" in registers.doable("u0", now_s=10.1)

    registers.say("u0", replace(IDLE, decided_s=10.0, completion_s=10.0, sortie_end_s=50.0))
    assert "far" not in registers.doable("u0", now_s=10.1)


def test_at_the_end_of_a_planned_run_hardly_anything_is_doable() -> None:
    """What is told is open; of most runs nothing is left."""
    left = []
    for seed in range(10):
        mission = mission_of(dilemma(seed, 3, 6))
        problem = FieldProblem.from_mission(mission)
        order = random.Random(seed).sample(range(3), 3)
        last = list(PlannedRun(mission, problem, FIELD_GREEDY, order).moments())[-1]
        present = {str(uav) for uav in problem.uav_ids}
        found = doable_in_field(problem, last.board, present, last.turn.now_s)
        states = last.board.states
        assert all(states[task] == "open" for task in found)
        left.append(found)
    assert any(not found for found in left)
