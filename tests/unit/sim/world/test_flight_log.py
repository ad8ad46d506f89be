"""What vehicles did, as a schedule, where an agent starts anew in the middle of it."""

from __future__ import annotations

from agent.core.fleet_air import STOP_LEG
from agent.core.interface import Arrived, GoTo, Telemetry
from sim.world.flight_log import FlightLog
from swarm.model import Mission, Origin, Task, TaskId, Uav, UavId
from swarm.protocol.uav_messages import AttemptResult, Outcome

LINE = ((100.0, 0.0, 0.0), (100.0, 50.0, 0.0), (100.0, 200.0, 0.0))
MISSION = Mission(
    "logged",
    600.0,
    (Uav(UavId("u0"), (0.0, 0.0, 0.0), 10.0),),
    (Task(TaskId("line"), LINE[0], 1.0, opens_s=30.0, path_enu_m=LINE),),
    origin=Origin(46.8, 9.7, 1100.0),
)


def at(place_enu_m: tuple[float, float, float]) -> Telemetry:
    """The vehicle stands there in the air."""
    return Telemetry(place_enu_m, (0.0, 0.0, 0.0), None)


def test_a_line_begins_when_it_is_flown_not_when_its_first_end_is_ordered_again() -> None:
    log = FlightLog(MISSION, {})

    log.ordered("u0", GoTo(1, LINE[0], task="line"), at((0.0, 0.0, 0.0)), 0.0)
    log.reported("u0", Arrived(1), 10.0)
    # Another life of its agent resumes the claim before the task opens.
    log.ordered("u0", GoTo(1, LINE[0], task="line"), at(LINE[0]), 12.0)
    log.reported("u0", Arrived(1), 12.0)
    along = GoTo(2, LINE[2], task="line", via_enu_m=(LINE[1],))
    log.ordered("u0", along, at(LINE[0]), 30.0)
    log.reported("u0", Arrived(2), 50.0)
    log.attempt_ended("u0", Outcome("line", AttemptResult.DONE, 1, 50.0), 50.0, 0.0)

    (entry,) = log.executed_schedule(0.0)[UavId("u0")]
    times_s = entry.depart_s, entry.arrive_s, entry.begin_s, entry.end_s
    assert times_s == (0.0, 10.0, 30.0, 50.0)
    assert not entry.is_reversed


def test_who_waits_at_one_end_and_takes_the_line_from_the_other_begins_it_there() -> None:
    log = FlightLog(MISSION, {})

    log.ordered("u0", GoTo(1, LINE[0], task="line"), at((0.0, 0.0, 0.0)), 0.0)
    log.reported("u0", Arrived(1), 10.0)
    # It lets go of the task before that opens, and takes it anew, from its other end.
    log.ordered("u0", GoTo(2, LINE[2], task="line"), at(LINE[0]), 12.0)
    log.reported("u0", Arrived(2), 28.0)
    log.ordered("u0", GoTo(3, LINE[0], task="line", via_enu_m=(LINE[1],)), at(LINE[2]), 30.0)
    log.reported("u0", Arrived(3), 50.0)
    log.attempt_ended("u0", Outcome("line", AttemptResult.DONE, 1, 50.0), 50.0, 0.0)

    (entry,) = log.executed_schedule(0.0)[UavId("u0")]
    assert (entry.begin_s, entry.end_s) == (30.0, 50.0)
    assert entry.is_reversed


def test_who_makes_room_before_it_may_fly_along_its_line_begins_that_when_it_does() -> None:
    log, beside = FlightLog(MISSION, {}), (LINE[0][0], LINE[0][1] + 20.0, LINE[0][2])

    log.ordered("u0", GoTo(1, LINE[0], task="line"), at((0.0, 0.0, 0.0)), 0.0)
    log.reported("u0", Arrived(1), 10.0)
    log.ordered("u0", GoTo(STOP_LEG, beside), at(LINE[0]), 12.0)
    log.reported("u0", Arrived(STOP_LEG), 14.0)
    along = GoTo(2, LINE[2], task="line", via_enu_m=(LINE[0], LINE[1]))
    log.ordered("u0", along, at(beside), 30.0)
    log.reported("u0", Arrived(2), 50.0)
    log.attempt_ended("u0", Outcome("line", AttemptResult.DONE, 1, 50.0), 50.0, 0.0)

    (entry,) = log.executed_schedule(0.0)[UavId("u0")]
    times_s = entry.depart_s, entry.arrive_s, entry.begin_s, entry.end_s
    assert times_s == (0.0, 10.0, 30.0, 50.0)


def test_an_attempt_of_which_is_told_late_ended_when_it_did() -> None:
    """Its agent hung in between; a clock that is a little slow is no reason."""
    for completed_s, end_s in ((45.0, 52.0), (52.6, 60.0), (53.0, 60.0)):
        log = FlightLog(MISSION, {})
        log.ordered("u0", GoTo(1, LINE[0], task="line"), at((0.0, 0.0, 0.0)), 7.0)
        log.reported("u0", Arrived(1), 40.0)
        log.attempt_ended("u0", Outcome("line", AttemptResult.DONE, 1, completed_s), 60.0, 7.0)

        (entry,) = log.executed_schedule(0.0)[UavId("u0")]
        assert entry.end_s == end_s
