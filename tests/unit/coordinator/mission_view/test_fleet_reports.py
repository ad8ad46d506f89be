"""What an observer keeps of reports when more names report than there are UAVs."""

from __future__ import annotations

from dataclasses import replace

from coordinator.mission_view.fleet_reports import FleetReports
from swarm.model.ids import COORDINATOR
from swarm.protocol.messages import Stamp
from swarm.protocol.registers import MOST_STRANGE, Replica
from swarm.protocol.uav_messages import StatusPhase
from tests.support.builders import brief, message, status, uav


def test_strangers_are_forgotten_before_they_fill_the_memory_and_the_fleet_is_not() -> None:
    replica = Replica()
    replica.join(message(COORDINATOR, brief(uav("u0"))))
    reports = FleetReports(replica)
    for number in range(2 * MOST_STRANGE):
        reports.take_status(f"made-up-{number}", Stamp(1, 1), status(StatusPhase.IDLE))
        reports.hear_from(f"made-up-{number}", 1.0)

    assert reports.take_status("u0", Stamp(1, 1), status(StatusPhase.IDLE)) is False
    reports.hear_from("u0", 2.0)
    assert reports.heard_s["u0"] == 2.0
    assert len(reports.statuses) == len(reports.heard_s) == MOST_STRANGE + 1


def test_another_life_of_an_agent_counts_on() -> None:
    reports = FleetReports(Replica())
    first = replace(status(), dropped={"stale": 2})
    assert reports.take_status("u0", Stamp(1, 5), first) is False
    assert reports.take_status("u0", Stamp(1, 5), first) is None
    second = replace(status(), dropped={"stale": 3})
    assert reports.take_status("u0", Stamp(2, 1), second) is True

    assert reports.dropped == {"u0": {"stale": 5}}
