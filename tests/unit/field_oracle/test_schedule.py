"""The schedule of one list, rule by rule, told by hand."""

from __future__ import annotations

from collections.abc import Sequence

import pytest

from tests.support.field_oracle.flight import FlightTimes
from tests.support.field_oracle.scenario import FieldScenario
from tests.support.field_oracle.schedule import Flight, Item, Swap, Work, fly_alone
from tests.unit.field_oracle.conftest import Make


def fly(scenario: FieldScenario, *items: Item) -> Flight:
    return fly_alone(scenario, FlightTimes(scenario), scenario.uavs[0], items)


def stations(flight: Flight) -> list[tuple[str, float, float, float, float]]:
    return [(e.go, e.depart_s, e.arrive_s, e.begin_s, e.end_s) for e in flight.entries]


def refused(scenario: FieldScenario, items: Sequence[Item]) -> str | None:
    flight = fly(scenario, *items)
    return None if flight.refused is None else f"{flight.refused.item}: {flight.refused.reason}"


def test_departs_at_once_and_flies_home_at_the_end(make: Make) -> None:
    flight = fly(
        make({"t1": {"at": 10, "service_s": 5.0}, "t2": {"at": 4}}), Work("t1"), Work("t2")
    )

    assert stations(flight) == [
        ("t1", 0.0, 10.0, 10.0, 15.0),
        ("t2", 15.0, 21.0, 21.0, 21.0),
        ("start", 21.0, 25.0, 25.0, 25.0),
    ]
    assert flight.value == (1000.0 - 15.0) + (1000.0 - 21.0)


def test_nothing_to_do_is_no_schedule(make: Make) -> None:
    assert fly(make({"t1": {"at": 10}})) == Flight((), 0.0)


def test_value_knows_success_survival_and_due(make: Make) -> None:
    scenario = make(
        {"t1": {"at": 10, "value": 2.0, "kind": "dig"}, "t2": {"at": 30, "due_s": 50.0}},
        {"u1": {"success": {"dig": 0.5, "t2": 0.9}, "survival": {"t1": 0.8, "t2": 0.1}}},
    )

    flight = fly(scenario, Work("t1"), Work("t2"))

    assert flight.value == pytest.approx(0.5 * 2.0 * (1000.0 - 10.0) + 0.9 * 0.8 * (50.0 - 30.0))


def test_success_by_id_goes_before_success_by_kind(make: Make) -> None:
    uav = {"success": {"dig": 0.5, "t1": 0.0}}
    scenario = make({"t1": {"at": 1, "kind": "dig"}, "t2": {"at": 1, "kind": "dig"}}, {"u1": uav})

    assert refused(scenario, [Work("t1")]) == "t1: its p is 0"
    assert refused(scenario, [Work("t2")]) is None


def test_waits_in_the_air_until_it_opens(make: Make) -> None:
    flight = fly(make({"t1": {"at": 10, "opens_s": 60.0, "service_s": 3.0}}), Work("t1"))

    assert stations(flight)[0] == ("t1", 0.0, 10.0, 60.0, 63.0)


@pytest.mark.parametrize(("closes_s", "can"), [(10.0, True), (10.0 - 5e-7, True), (9.9, False)])
def test_begins_not_after_it_closes(make: Make, closes_s: float, can: bool) -> None:
    scenario = make({"t1": {"at": 10, "closes_s": closes_s, "service_s": 50.0}})

    assert (refused(scenario, [Work("t1")]) is None) is can


@pytest.mark.parametrize(("due_s", "can"), [(15.0, True), (15.0 - 5e-7, True), (14.9, False)])
def test_ends_not_after_it_is_due(make: Make, due_s: float, can: bool) -> None:
    scenario = make({"t1": {"at": 10, "due_s": due_s, "service_s": 5.0}})

    assert (refused(scenario, [Work("t1")]) is None) is can


def test_line_is_left_at_its_other_end(make: Make) -> None:
    scenario = make({"t1": {"path_m": [[10, 0], [30, 0]], "service_s": 4.0}, "t2": {"at": 40}})

    there, back = fly(scenario, Work("t1"), Work("t2")), fly(scenario, Work("t1", True))

    assert stations(there)[:2] == [("t1", 0.0, 10.0, 10.0, 34.0), ("t2", 34.0, 44.0, 44.0, 44.0)]
    assert there.entries[1].from_m == (30.0, 0.0)
    assert stations(back)[0] == ("t1", 0.0, 30.0, 30.0, 54.0)
    assert (back.entries[0].reversed, back.entries[0].via_m) == (True, ((30.0, 0.0),))
    assert back.entries[1].depart_s + 10.0 == back.entries[1].arrive_s


@pytest.mark.parametrize(
    ("uav", "can"),
    [
        ({"endurance_s": 100.0}, True),  # 80 s of it: 40 there, 40 back
        ({"endurance_s": 99.0}, False),
        ({"endurance_s": 100.0, "reserve_frac": 0.3}, False),
        ({"endurance_s": 100.0, "charge_frac": 0.9}, False),
        ({"endurance_s": 100.0, "charge_frac": 0.9, "reserve_frac": 0.1}, True),
    ],
)
def test_energy_reaches_home_without_the_reserve(
    make: Make, uav: dict[str, float], can: bool
) -> None:
    assert (refused(make({"t1": {"at": 40}}, {"u1": uav}), [Work("t1")]) is None) is can


def test_waiting_and_service_take_energy(make: Make) -> None:
    uav = {"u1": {"endurance_s": 100.0, "reserve_frac": 0.0}}
    long, late = {"at": 40, "service_s": 20.0}, {"at": 40, "opens_s": 60.0}

    assert refused(make({"t1": long}, uav), [Work("t1")]) is None
    assert refused(make({"t1": late}, uav), [Work("t1")]) is None
    assert refused(make({"t1": long | {"service_s": 20.1}}, uav), [Work("t1")]) is not None
    assert refused(make({"t1": late | {"opens_s": 60.1}}, uav), [Work("t1")]) is not None


def test_energy_is_checked_after_every_task_not_only_at_the_end(make: Make) -> None:
    """Back at the start there would be enough again, but not at the far task before."""
    scenario = make(
        {"far": {"at": 60}, "near": {"at": 0}},
        {"u1": {"endurance_s": 100.0, "reserve_frac": 0.0}},
    )

    assert str(refused(scenario, [Work("far"), Work("near")])).startswith("far: energy")


def test_home_is_the_nearest_base_or_the_own_start(make: Make) -> None:
    flight = fly(make({"t1": {"at": 40}}, bases={"b0": {"at": 50}}), Work("t1"))

    assert stations(flight)[1] == ("base:b0", 40.0, 50.0, 50.0, 50.0)


def test_swap_makes_the_battery_full(make: Make) -> None:
    uav = {"u1": {"endurance_s": 100.0, "reserve_frac": 0.0, "charge_frac": 0.3}}
    scenario = make({"t1": {"at": 70}}, uav, {"b0": {"at": 20, "swap_s": 30.0}})

    assert refused(scenario, [Work("t1")]) is not None
    assert stations(fly(scenario, Swap("b0"), Work("t1"))) == [
        ("base:b0", 0.0, 20.0, 20.0, 50.0),
        ("t1", 50.0, 100.0, 100.0, 100.0),
        ("base:b0", 100.0, 150.0, 150.0, 150.0),
    ]
    assert refused(make({"t1": {"at": 70.1}}, uav, {"b0": {"at": 20}}), [Swap("b0"), Work("t1")])


def test_base_must_be_reached_itself(make: Make) -> None:
    uav = {"u1": {"endurance_s": 100.0, "reserve_frac": 0.0, "charge_frac": 0.3}}
    scenario = make({"t1": {"at": 40}}, uav, {"b0": {"at": 31}})

    assert str(refused(scenario, [Swap("b0"), Work("t1")])).startswith("base:b0: energy")


def test_bases_in_a_row(make: Make) -> None:
    uav = {"u1": {"endurance_s": 50.0, "reserve_frac": 0.0}}
    bases = {"b0": {"at": 50, "swap_s": 1.0}, "b1": {"at": 100, "swap_s": 1.0}}
    scenario = make({"t1": {"at": 120, "opens_s": 300.0}}, uav, bases)

    assert stations(fly(scenario, Swap("b0"), Swap("b1"), Work("t1"))) == [
        ("base:b0", 0.0, 50.0, 50.0, 51.0),
        ("base:b1", 51.0, 101.0, 101.0, 102.0),
        ("t1", 280.0, 300.0, 300.0, 300.0),
        ("base:b1", 300.0, 320.0, 320.0, 320.0),
    ]


def test_waits_on_the_ground_after_a_swap_for_the_first_task_alone(make: Make) -> None:
    uav = {"u1": {"endurance_s": 100.0, "reserve_frac": 0.0}}
    tasks = {"t1": {"at": 20, "opens_s": 200.0}, "t2": {"at": 30, "opens_s": 260.0}}
    bases = {"b0": {"at": 10, "swap_s": 5.0}}
    scenario = make(tasks, uav, bases)

    flight = fly(scenario, Swap("b0"), Work("t1"), Work("t2"))

    assert stations(flight)[1:3] == [
        ("t1", 190.0, 200.0, 200.0, 200.0),
        ("t2", 200.0, 210.0, 260.0, 260.0),  # in the air, 70 s by now, and 20 s home
    ]
    assert flight.refused is None
    tasks["t2"]["opens_s"] = 271.0
    assert refused(make(tasks, uav, bases), [Swap("b0"), Work("t1"), Work("t2")]) is not None


def test_own_start_swaps_only_if_a_base_is_there(make: Make) -> None:
    uav = {"u1": {"endurance_s": 100.0, "reserve_frac": 0.0}}
    tasks = {"t1": {"at": 40}, "t2": {"at": -40}}

    assert refused(make(tasks, uav), [Work("t1"), Work("t2")]) is not None
    with_base = make(tasks, uav, {"b0": {"at": 0}})
    assert refused(with_base, [Work("t1"), Swap("b0"), Work("t2")]) is None
