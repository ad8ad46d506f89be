"""The oracle's own schedules as the fixed JSON."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from tests.support.field_oracle.brute import reasons_left_out
from tests.support.field_oracle.flight import FlightTimes
from tests.support.field_oracle.scenario import FieldScenario
from tests.support.field_oracle.schedule import Flight


def plan_json(
    scenario: FieldScenario,
    times: FlightTimes,
    flights: Mapping[str, Flight],
    *,
    optimum: float | None = None,
    sequence: Sequence[str] | None = None,
) -> dict[str, Any]:
    """What `swarm plan --json` tells of a plan whose lists were flown as ``flights``."""
    work = {
        name: [entry for entry in flight.entries[:-1] if not entry.go.startswith("base:")]
        for name, flight in flights.items()
    }
    done = frozenset(entry.go for entries in work.values() for entry in entries)
    value = sum(flight.value for flight in flights.values())
    return {
        "scenario": scenario.name,
        "method": "exact",
        "objective": value,
        "sequence": list(sequence or [uav.id for uav in scenario.uavs]),
        "routes": {name: [entry.go for entry in entries] for name, entries in work.items()},
        "completion_s": {e.go: e.end_s for entries in work.values() for e in entries},
        "optimum": optimum,
        "gap": None if not optimum else (optimum - value) / abs(optimum),
        "evaluations": 1,
        "elapsed_s": 0.0,
        "seed": 0,
        "schedule": {
            name: [entry.as_json() for entry in flight.entries] for name, flight in flights.items()
        },
        "left_out": reasons_left_out(scenario, times, done),
    }
