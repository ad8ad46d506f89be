from __future__ import annotations

from sim.world.outcome import TaskVisit, value_of
from swarm.model import TaskId, UavId
from tests.support.builders import mission, task, uav
from tests.unit.sim.study.policies.play import fate_of


def test_a_withdrawn_task_is_worth_nothing_to_who_has_not_heard_of_it() -> None:
    fate = fate_of(
        mission([uav("u")], [task("t", 1.0, value=2.0)], horizon_s=100.0),
        withdrawn_at_s={"t": 10.0},
    )

    def worth(completed_s: float) -> float:
        return value_of(fate, [TaskVisit(UavId("u"), TaskId("t"), completed_s, done=True)])

    assert worth(10.0) == 180.0
    assert worth(10.5) == 0.0
