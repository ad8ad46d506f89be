"""Who waits for a slot of a base, told by hand."""

from __future__ import annotations

from typing import Any

import pytest

from tests.support.field_oracle.flight import FlightTimes
from tests.support.field_oracle.scenario import FieldScenario
from tests.support.field_oracle.schedule import Flight, Swap, Work
from tests.support.field_oracle.slots import fly_all, objective
from tests.unit.field_oracle.conftest import Make

ENDURANCE = {"endurance_s": 100.0, "reserve_frac": 0.0}


def swaps(flights: dict[str, Flight]) -> dict[str, tuple[float, float]]:
    return {
        name: (flight.entries[0].arrive_s, flight.entries[0].begin_s)
        for name, flight in flights.items()
        if flight.entries
    }


def three(make: Make, starts: tuple[float, ...] = (-1.0, -2.0, -3.0), **base: Any) -> FieldScenario:
    """Each goes to the base first, then to its own task."""
    uavs = {f"u{i + 1}": {"position_m": [x, 0.0], **ENDURANCE} for i, x in enumerate(starts)}
    tasks = {f"t{i + 1}": {"at": 10.0} for i in range(3)}
    return make(tasks, uavs, {"b0": {"at": 0.0, "swap_s": 20.0, **base}})


def fly(scenario: FieldScenario, sequence: list[str] | None = None) -> dict[str, Flight]:
    lists = {f"u{i}": (Swap("b0"), Work(f"t{i}")) for i in (1, 2, 3)}
    return fly_all(scenario, FlightTimes(scenario), lists, sequence)


def test_without_a_limit_nobody_waits(make: Make) -> None:
    assert swaps(fly(three(make))) == {"u1": (1.0, 1.0), "u2": (2.0, 2.0), "u3": (3.0, 3.0)}


def test_one_slot_serves_in_the_order_of_arrival(make: Make) -> None:
    scenario = three(make, (-3.0, -1.0, -2.0), slots=1)

    assert swaps(fly(scenario)) == {"u1": (3.0, 41.0), "u2": (1.0, 1.0), "u3": (2.0, 21.0)}


def test_two_slots_serve_two(make: Make) -> None:
    assert swaps(fly(three(make, slots=2))) == {
        "u1": (1.0, 1.0),
        "u2": (2.0, 2.0),
        "u3": (3.0, 21.0),
    }


def test_at_once_arrived_the_sequence_decides(make: Make) -> None:
    scenario = three(make, (-5.0, -5.0, -5.0), slots=1)

    flights = fly(scenario, ["u3", "u1", "u2"])

    assert swaps(flights) == {"u1": (5.0, 25.0), "u2": (5.0, 45.0), "u3": (5.0, 5.0)}


def test_slot_is_held_until_take_off(make: Make) -> None:
    """The first waits on the ground for its task to open."""
    uavs = {"u1": {"position_m": [-1.0, 0.0]}, "u2": {"position_m": [-2.0, 0.0]}}
    tasks = {"t1": {"at": 10.0, "opens_s": 60.0}, "t2": {"at": 10.0}}
    bases = {"b0": {"at": 0.0, "swap_s": 20.0, "slots": 1}}
    scenario = make(tasks, {name: row | ENDURANCE for name, row in uavs.items()}, bases)
    lists = {"u1": (Swap("b0"), Work("t1")), "u2": (Swap("b0"), Work("t2"))}

    flights = fly_all(scenario, FlightTimes(scenario), lists)

    assert swaps(flights) == {"u1": (1.0, 1.0), "u2": (2.0, 50.0)}


@pytest.mark.parametrize(("charge_frac", "can"), [(0.21, True), (0.2, False)])
def test_waiting_for_a_slot_takes_energy(make: Make, charge_frac: float, can: bool) -> None:
    uavs = {
        "u1": {"position_m": [-1.0, 0.0], **ENDURANCE},
        "u2": {"position_m": [-2.0, 0.0], **ENDURANCE, "charge_frac": charge_frac},
    }
    bases = {"b0": {"at": 0.0, "swap_s": 20.0, "slots": 1}}
    scenario = make({"t1": {"at": 10.0}, "t2": {"at": 10.0}}, uavs, bases)
    lists = {"u1": (Swap("b0"), Work("t1")), "u2": (Swap("b0"), Work("t2"))}

    flights = fly_all(scenario, FlightTimes(scenario), lists)

    assert (objective(flights) is not None) is can


def test_who_ends_there_for_good_takes_no_slot(make: Make) -> None:
    uavs = {"u1": {"position_m": [10.0, 0.0]}, "u2": {"position_m": [-30.0, 0.0]}}
    bases = {"b0": {"at": 0.0, "swap_s": 20.0, "slots": 1}}
    scenario = make(
        {"t1": {"at": 4.0}, "t2": {"at": -10.0}},
        {name: row | ENDURANCE for name, row in uavs.items()},
        bases,
    )
    lists = {"u1": (Work("t1"),), "u2": (Swap("b0"), Work("t2"))}

    flights = fly_all(scenario, FlightTimes(scenario), lists)

    assert flights["u1"].entries[-1].go == "base:b0"
    assert swaps(flights)["u2"] == (30.0, 30.0)
