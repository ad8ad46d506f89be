"""What UAVs tell of how they fly, and what boards make of it."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from swarm.allocation.field.ways import way_to
from swarm.model import Base, BaseId, Mission, Task, TaskId, Uav, UavId
from swarm.model.ids import COORDINATOR
from swarm.protocol.board import TaskBoard
from swarm.protocol.calibration import FlightRates, flight_rates, noticeably_otherwise
from swarm.protocol.codec import Codec
from swarm.protocol.encoding import encode
from swarm.protocol.messages import Body
from swarm.protocol.registers import Replica
from swarm.protocol.uav_messages import Calibration
from tests.support.builders import MISSION, message
from tests.support.field_registers import brief_of, entries_of

FLIGHT = Mission(
    "flight",
    1000.0,
    (
        Uav(UavId("u0"), (0.0, 0.0, 0.0), 10.0, acceleration_m_s2=2.0),
        Uav(UavId("u1"), (0.0, 10.0, 0.0), 10.0, acceleration_m_s2=2.0),
    ),
    (
        Task(TaskId("near"), (20.0, 0.0, 0.0), 1.0),
        Task(TaskId("far"), (900.0, 0.0, 0.0), 1.0),
    ),
)
IN_FIELD = replace(
    FLIGHT,
    uavs=tuple(replace(uav, endurance_s=300.0) for uav in FLIGHT.uavs),
    bases=(Base(BaseId("b0"), (500.0, 0.0, 0.0), 30.0, 1),),
)
PLAIN = replace(FLIGHT, uavs=tuple(replace(uav, acceleration_m_s2=None) for uav in FLIGHT.uavs))


class Board:
    def __init__(self, mission: Mission) -> None:
        self.replica, self._said = Replica(), 0
        self.board = TaskBoard(self.replica, MISSION)
        self.say(COORDINATOR, brief_of(mission))
        for entry in entries_of(mission):
            self.say(COORDINATOR, entry)

    def say(self, writer: str, body: Body) -> None:
        self._said += 1
        self.replica.join(message(writer, body, self._said))


def test_times_of_one_uav_follow_where_speeds_change_in_time_alone() -> None:
    told = Board(FLIGHT)
    before = told.board.problem
    told.say("u1", Calibration(1.25, 1.0, 4))
    after = told.board.problem

    assert before is not None
    assert after is not None
    assert told.board.field_problem is None
    here = np.zeros(3)
    np.testing.assert_array_equal(after.travel_s(0, here), before.travel_s(0, here))
    np.testing.assert_allclose(after.travel_s(1, here), 1.25 * before.travel_s(1, here), 1e-12)


def test_legs_and_batteries_follow_in_the_field() -> None:
    told = Board(IN_FIELD)
    before = told.board.field_problem
    told.say("u1", Calibration(1.25, 1.5, 4))
    after = told.board.field_problem

    assert before is not None
    assert after is not None
    for uav, frac in ((0, 1.0), (1, 1.25)):
        old, new = before.leg_s[before.kind[uav]], after.leg_s[after.kind[uav]]
        np.testing.assert_array_equal(new, old * frac)
        np.testing.assert_array_equal(after.home_s[uav], before.home_s[uav] * frac)
        here = after.legs_from_s(uav, (3.0, 4.0, 0.0))
        np.testing.assert_array_equal(here, before.legs_from_s(uav, (3.0, 4.0, 0.0)) * frac)
    np.testing.assert_array_equal(after.full_s, before.full_s / [1.0, 1.5])
    np.testing.assert_array_equal(after.first_s, before.first_s / [1.0, 1.5])


def test_legs_that_end_or_begin_on_the_ground_take_longer_by_landing_and_climbing() -> None:
    told = Board(IN_FIELD)
    before = told.board.field_problem
    told.say("u1", Calibration(1.25, 1.0, 0, 20.0, 7.0))
    after = told.board.field_problem

    assert before is not None
    assert after is not None
    np.testing.assert_array_equal(after.leg_s[after.kind[0]], before.leg_s[before.kind[0]])
    old, new = before.leg_s[before.kind[1]] * 1.25, after.leg_s[after.kind[1]]
    start, base, near, far = 1, 2, 3, 4
    assert new[near, far] == old[near, far]
    assert new[near, base] == old[near, base] + 20.0
    assert new[near, start] == old[near, start] + 20.0
    assert new[base, far] == old[base, far] + 7.0
    assert new[base, base] == 0.0  # there it stands already
    np.testing.assert_array_equal(after.home_s[1], before.home_s[1] * 1.25 + 20.0)
    here = after.legs_from_s(1, (3.0, 4.0, 0.0)) - 1.25 * before.legs_from_s(1, (3.0, 4.0, 0.0))
    np.testing.assert_allclose(here, [20.0, 20.0, 20.0, 0.0, 0.0], atol=1e-9)
    assert after.landing_s(1, base) == 20.0
    # All are in the air, and wait there, while the last one climbs.
    np.testing.assert_array_equal(after.first_s, before.first_s - 7.0)
    np.testing.assert_array_equal(after.full_s, before.full_s)
    assert after.landing_s(1, near) == after.landing_s(0, base) == 0.0
    way = way_to(after, 1, (3.0, 4.0, 0.0), base)
    assert way is not None
    assert way.upright_s == 20.0
    np.testing.assert_array_equal(after.full_s, before.full_s)  # the tables hold it


def test_who_takes_no_time_to_land_says_what_every_release_understands() -> None:
    plain = encode(message("u0", Calibration(1.2, 1.1, 5)))
    assert b"land_s" not in plain
    assert len(plain) < len(encode(message("u0", Calibration(1.2, 1.1, 5, 20.0, 7.0))))


def test_who_tells_nothing_of_its_parameters_says_what_it_said_before() -> None:
    upright = Calibration(1.2, 1.1, 5, 20.0, 7.0)
    without = encode(message("u0", upright))
    told = encode(message("u0", replace(upright, acceleration_m_s2=2.5, speed_m_s=12.0)))
    for name in (b"acceleration_m_s2", b"speed_m_s"):
        assert name not in without
        assert name in told
    codec = Codec(MISSION)
    heard = codec.decode(message("u0", upright).key, told)
    assert heard is not None
    assert heard.body == replace(upright, acceleration_m_s2=2.5, speed_m_s=12.0)


# -- what vehicles tell of their parameters -----------------------------------------------

WITHOUT = replace(
    IN_FIELD, uavs=tuple(replace(uav, acceleration_m_s2=None) for uav in IN_FIELD.uavs)
)
"""The brief says nothing of accelerations, and counts on batteries."""


def limited(acceleration_m_s2: float | None = None, speed_m_s: float | None = None) -> Calibration:
    return Calibration(1.0, 1.0, 0, 0.0, 0.0, acceleration_m_s2, speed_m_s)


def test_legs_are_those_of_a_mission_that_says_what_the_vehicle_told() -> None:
    told = Board(WITHOUT)
    before = told.board.field_problem
    told.say("u1", limited(1.5, 8.0))
    slow = replace(WITHOUT.uavs[1], acceleration_m_s2=1.5, speed_m_s=8.0)
    briefed = Board(replace(WITHOUT, uavs=(WITHOUT.uavs[0], slow)))

    after, same = told.board.field_problem, briefed.board.field_problem
    assert before is not None
    assert after is not None
    assert same is not None
    assert told.board.field_problem is after
    for uav in (0, 1):
        np.testing.assert_array_equal(after.leg_s[after.kind[uav]], same.leg_s[same.kind[uav]])
        np.testing.assert_array_equal(after.home_s[uav], same.home_s[uav])
        here = after.legs_from_s(uav, (3.0, 4.0, 0.0))
        np.testing.assert_array_equal(here, same.legs_from_s(uav, (3.0, 4.0, 0.0)))
    np.testing.assert_array_equal(after.leg_s[after.kind[0]], before.leg_s[before.kind[0]])
    np.testing.assert_array_equal(after.full_s, before.full_s)


def test_what_was_measured_is_a_multiple_of_what_the_vehicle_told() -> None:
    told, slow = Board(WITHOUT), Board(WITHOUT)
    told.say("u1", limited(1.5))
    slow.say("u1", replace(limited(1.5), time_frac=1.25))
    before, after = told.board.field_problem, slow.board.field_problem
    assert before is not None
    assert after is not None
    np.testing.assert_array_equal(after.leg_s[after.kind[1]], before.leg_s[before.kind[1]] * 1.25)


def test_plain_legs_with_acceleration_follow_too() -> None:
    one_says = replace(FLIGHT, uavs=(FLIGHT.uavs[0], replace(PLAIN.uavs[1])))
    told, briefed = Board(one_says), Board(FLIGHT)
    told.say("u1", limited(2.0))
    after, same = told.board.problem, briefed.board.problem
    assert told.board.field_problem is None
    assert after is not None
    assert same is not None
    np.testing.assert_array_equal(after.travel_s(1, np.zeros(3)), same.travel_s(1, np.zeros(3)))


def test_where_tables_would_get_too_large_legs_are_as_briefed(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    told = Board(WITHOUT)
    before = told.board.field_problem
    monkeypatch.setattr("swarm.allocation.field.network.MOST_LEGS", 40)  # of 5 nodes for one kind
    told.say("u1", limited(1.7))  # no problem that was made before
    after = told.board.field_problem
    assert before is not None
    assert after is not None
    np.testing.assert_array_equal(after.leg_s, before.leg_s)


def test_the_scenario_goes_before_the_vehicle() -> None:
    told, fresh = Board(IN_FIELD), Board(IN_FIELD)
    told.say("u1", limited(0.5, 12.0))  # it could fly faster than it is told to
    assert flight_rates(told.replica) == {}
    after, same = told.board.field_problem, fresh.board.field_problem
    assert after is not None
    assert same is not None
    np.testing.assert_array_equal(after.leg_s, same.leg_s)


def test_parameters_that_nobody_would_believe_are_clamped() -> None:
    told = Board(WITHOUT)
    told.say("u0", limited(1e-6, 1e-6))
    told.say("u1", limited(1e6))
    rates = flight_rates(told.replica)
    assert (rates["u0"].acceleration_m_s2, rates["u0"].speed_m_s) == (0.1, 1.0)
    assert rates["u1"].acceleration_m_s2 == 50.0


def test_without_the_keys_of_the_field_parameters_do_not_count() -> None:
    told = Board(PLAIN)
    before = told.board.problem
    told.say("u0", limited(1.5, 8.0))
    after = told.board.problem
    assert flight_rates(told.replica) == {}
    assert before is not None
    assert after is not None
    np.testing.assert_array_equal(after.travel_between_s(0), before.travel_between_s(0))


def test_plans_are_made_anew_for_another_acceleration_or_speed() -> None:
    known = {"u0": FlightRates(acceleration_m_s2=2.0, speed_m_s=8.0)}
    for now, anew in (
        (FlightRates(acceleration_m_s2=2.05, speed_m_s=8.1), []),
        (FlightRates(acceleration_m_s2=1.5, speed_m_s=8.0), ["u0"]),
        (FlightRates(acceleration_m_s2=2.0, speed_m_s=7.0), ["u0"]),
        (FlightRates(acceleration_m_s2=2.0), ["u0"]),
    ):
        assert noticeably_otherwise(known, {"u0": now}) == anew
    assert noticeably_otherwise({}, known) == ["u0"]


@pytest.mark.parametrize("mission", [FLIGHT, IN_FIELD])
def test_who_flies_as_planned_changes_nothing(mission: Mission) -> None:
    told = Board(mission)
    told.say("u0", Calibration(1.0, 1.0, 9))
    fresh = Board(mission)

    assert flight_rates(told.replica) == {}
    known, same = told.board.field_problem, fresh.board.field_problem
    if known is not None and same is not None:
        np.testing.assert_array_equal(known.leg_s, same.leg_s)
        np.testing.assert_array_equal(known.full_s, same.full_s)
    plain, plain_too = told.board.problem, fresh.board.problem
    assert plain is not None
    assert plain_too is not None
    np.testing.assert_array_equal(plain.travel_between_s(0), plain_too.travel_between_s(0))


def test_problems_are_made_anew_when_somebody_flies_otherwise_and_only_then() -> None:
    told = Board(IN_FIELD)
    first = told.board.field_problem
    assert told.board.field_problem is first
    told.say("u0", Calibration(1.1, 1.0, 3))
    second = told.board.field_problem
    told.say("u0", Calibration(1.1, 1.0, 8))  # rests on more, and says the same
    assert second is not first
    assert told.board.field_problem is second


def test_without_the_keys_of_the_field_nothing_counts() -> None:
    told = Board(PLAIN)
    before = told.board.problem
    told.say("u0", Calibration(2.0, 2.0, 9))
    after = told.board.problem

    assert flight_rates(told.replica) == {}
    assert before is not None
    assert after is not None
    np.testing.assert_array_equal(after.speed_m_s, before.speed_m_s)


def test_unbelievable_words_are_clamped_and_concern_their_writer_alone() -> None:
    told = Board(IN_FIELD)
    told.say("u0", Calibration(1e3, 1e-3, 1))
    told.say("stranger", Calibration(2.0, 2.0, 1))

    assert flight_rates(told.replica) == {"u0": FlightRates(3.0, 0.8)}


def test_only_the_uav_itself_tells_how_it_flies() -> None:
    said = message("u0", Calibration(1.2, 1.1, 5))
    codec = Codec(MISSION)

    assert codec.decode(said.key, encode(said)) == said
    for other in ("u1", COORDINATOR):
        assert codec.decode(said.key, encode(replace(said, writer=other))) is None


@pytest.mark.parametrize("number", [0.0, -1.0, 1e9])
def test_numbers_that_nobody_could_mean_are_dropped(number: float) -> None:
    codec = Codec(MISSION)
    said = message("u0", Calibration(number, 1.0, 5))
    assert codec.decode(said.key, encode(said)) is None
    assert codec.dropped == {"malformed": 1}
