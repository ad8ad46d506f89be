"""Scenarios along a line, where every time can be told by heart."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import pytest

from tests.support.field_oracle.scenario import FieldScenario, read

Make = Callable[..., FieldScenario]


@pytest.fixture
def make() -> Make:
    """UAVs at 1 m/s that start at 0, tasks and bases by their distance east."""

    def scenario(
        tasks: dict[str, dict[str, Any]],
        uavs: dict[str, dict[str, Any]] | None = None,
        bases: dict[str, dict[str, Any]] | None = None,
        **mission: Any,
    ) -> FieldScenario:
        return read(
            {
                "schema": 2,
                "name": "line",
                "mission": {"horizon_s": 1000.0, **mission},
                "uav": [
                    {"id": name, "position_m": [0.0, 0.0], "speed_m_s": 1.0, **row}
                    for name, row in (uavs or {"u1": {}}).items()
                ],
                "base": [_placed(name, row) for name, row in (bases or {}).items()],
                "task": [{"value": 1.0, **_placed(name, row)} for name, row in tasks.items()],
            }
        )

    return scenario


def _placed(name: str, row: dict[str, Any]) -> dict[str, Any]:
    placed = {"id": name, **row}
    if "at" in placed:
        placed["position_m"] = [float(placed.pop("at")), 0.0]
    return placed
