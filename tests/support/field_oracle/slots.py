"""The schedules of all lists together: who waits for a slot of a base.

A base serves in the order of arrival, then the sequence, then the id. All arrivals of all UAVs
are gone through in that order, so each finds the slots as those before it leave them.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

from tests.support.field_oracle.flight import FlightTimes, Leg
from tests.support.field_oracle.scenario import FieldBase, FieldScenario, FieldUav
from tests.support.field_oracle.schedule import (
    Entry,
    Flight,
    Flown,
    Item,
    Refused,
    Swap,
    Work,
    departure_s,
    do_task,
    go_home,
    reach_base,
    swap_there,
    take_off,
)


@dataclass(slots=True)
class _Pilot:
    """One UAV on its way through its list."""

    uav: FieldUav
    items: Sequence[Item]
    rank: int
    flown: Flown
    next: int = 0
    entries: list[Entry] = field(default_factory=list)
    refused: Refused | None = None
    arrival: tuple[Flown, Leg, FieldBase] | None = None
    """Above a base, to be served."""

    def flight(self) -> Flight:
        return Flight(tuple(self.entries), self.flown.value, self.refused)


def fly_all(
    scenario: FieldScenario,
    times: FlightTimes,
    lists: Mapping[str, Sequence[Item]],
    sequence: Sequence[str] | None = None,
) -> dict[str, Flight]:
    """The schedules of ``lists``, by UAV.

    Args:
        scenario: what it is about.
        times: its legs.
        lists: by UAV; one that is not named has nothing to do.
        sequence: the priority sequence; the file's order when None.
    """
    ranks = list(sequence if sequence is not None else [uav.id for uav in scenario.uavs])
    pilots = [
        _Pilot(uav, lists.get(uav.id, ()), ranks.index(uav.id), take_off(uav))
        for uav in scenario.uavs
    ]
    for pilot in pilots:
        _fly_to_next_base(scenario, times, pilot)
    free_from_s: dict[str, list[float]] = {
        base.id: [0.0] * base.slots for base in scenario.bases if base.slots is not None
    }
    while waiting := [(p, p.arrival) for p in pilots if p.arrival is not None]:
        pilot, (arrived, leg, base) = min(
            waiting, key=lambda each: (each[1][0].time_s, each[0].rank, each[0].uav.id)
        )
        begin_s = arrived.time_s
        slots = free_from_s.get(base.id)
        if slots is not None:
            begin_s = max(begin_s, min(slots))
        step = swap_there(pilot.uav, pilot.flown, arrived, leg, base, begin_s)
        pilot.arrival = None
        pilot.next += 1
        if isinstance(step, Refused):
            pilot.refused = step
            continue
        pilot.flown, entry = step
        pilot.entries.append(entry)
        if slots is not None:
            leaves_s = pilot.flown.time_s
            if pilot.next < len(pilot.items):
                item = pilot.items[pilot.next]
                leaves_s = departure_s(scenario, times, pilot.uav, pilot.flown, item)
            slots[slots.index(min(slots))] = leaves_s
        _fly_to_next_base(scenario, times, pilot)
    return {pilot.uav.id: pilot.flight() for pilot in pilots}


def objective(flights: Mapping[str, Flight]) -> float | None:
    """J of eq. 1; None if a list can't be flown."""
    if any(flight.refused is not None for flight in flights.values()):
        return None
    return sum(flight.value for flight in flights.values())


def _fly_to_next_base(scenario: FieldScenario, times: FlightTimes, pilot: _Pilot) -> None:
    """On through the list up to the arrival at a base or to the end of the list."""
    while pilot.next < len(pilot.items):
        item = pilot.items[pilot.next]
        if isinstance(item, Swap):
            base = scenario.base(item.base)
            reached = reach_base(times, pilot.uav, pilot.flown, base)
            if isinstance(reached, Refused):
                pilot.refused = reached
            else:
                pilot.arrival = (*reached, base)
            return
        _work(scenario, times, pilot, item)
        if pilot.refused is not None:
            return
    if pilot.items:
        last = go_home(times, pilot.uav, pilot.flown)
        if isinstance(last, Refused):
            pilot.refused = last
        else:
            pilot.entries.append(last)


def _work(scenario: FieldScenario, times: FlightTimes, pilot: _Pilot, item: Work) -> None:
    step = do_task(scenario, times, pilot.uav, pilot.flown, item)
    if isinstance(step, Refused):
        pilot.refused = step
        return
    pilot.flown, entry = step
    pilot.entries.append(entry)
    pilot.next += 1
