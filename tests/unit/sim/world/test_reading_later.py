"""Words of which nothing follows wait, and whoever looks at a core finds them read."""

from __future__ import annotations

from sim.faults.case import quick_plan
from sim.world.engine import Process
from sim.world.stochastic_world import StochasticWorld
from sim.world.uncertainty import Uncertainty
from swarm.model import Mission, Task, TaskId, Uav, UavId
from swarm.protocol.messages import Message
from swarm.protocol.uav_messages import Claim


class Compared(StochasticWorld):
    """Looks into an agent's core now and then."""

    steps_of_busy = 0
    differing = looks = 0

    def said(self, process: Process, message: Message) -> None:
        super().said(process, message)
        if isinstance(message.body, Claim):
            self.world.queue.after(0.0, self._look)

    def _look(self) -> None:
        onlooker, busy = self.world.mission_state.replica, self.world.agents["u0"].replica
        if self.world.processes["u0"].over:
            return
        self.looks += 1
        self.differing += busy.claims.get("u1") != onlooker.claims.get("u1")

    def stepped(self, process: Process) -> None:
        self.steps_of_busy += process.name == "u0"


def mission(separation_m: float | None = None) -> Mission:
    """One UAV with a task far away, and one that is done with its own soon after each other."""
    fleet = (
        Uav(UavId("u0"), (0.0, 0.0, 0.0), 10.0, {"far": 1.0}),
        Uav(UavId("u1"), (0.0, 40.0, 0.0), 10.0, {f"t{n}": 1.0 for n in range(20)}),
    )
    board = [Task(TaskId("far"), (2000.0, 0.0, 0.0), 1.0)]
    board += [Task(TaskId(f"t{n}"), (20.0 * n, 60.0, 0.0), 1.0) for n in range(20)]
    band_m = None if separation_m is None else (30.0, 110.0)
    return Mission(
        "reading", 900.0, fleet, tuple(board), 0.0, separation_m=separation_m, band_m=band_m
    )


def flown(mission: Mission) -> Compared:
    plan = quick_plan(mission, "greedy", 1)
    fate = Uncertainty().draw(mission, 200.0, 1)
    world = Compared(fate, lambda *_: plan, method="greedy", seed=1)
    assert world.run()
    return world


def test_one_on_its_way_makes_no_step_for_what_another_one_does_elsewhere() -> None:
    """It has said some 60 words, while the other one was on its way."""
    assert flown(mission()).steps_of_busy < 20


def test_where_air_is_shared_each_word_is_looked_at() -> None:
    assert flown(mission(6.0)).steps_of_busy > 40


def test_who_looks_into_a_core_finds_all_read_that_it_has_heard() -> None:
    world = flown(mission())

    assert world.looks > 20
    assert world.differing == 0
