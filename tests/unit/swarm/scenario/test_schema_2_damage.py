"""Damaged files of schema 2 give a mission, or faults of a line each."""

from __future__ import annotations

import re

from hypothesis import given, settings
from hypothesis import strategies as st

from tests.support.small_scenario import faults
from tests.unit.swarm.scenario.test_schema_2_read import VALID
from tests.unit.swarm.scenario.test_write import VALUES, toml_of

NUMBERS = st.sampled_from(
    ["0", "-1", "1e300", "-1e7", "1e-300", "nan", "inf", "true", "1e7", "'a'"]
)
POINTS = st.lists(
    st.lists(st.sampled_from([0.0, 1.0, 100.0, 150.0, 1e7, -90.0]), max_size=4), max_size=6
)


@settings(deadline=None)
@given(st.data())
def test_any_value_anywhere_gives_a_mission_or_faults(data: st.DataObject) -> None:
    lines = VALID.splitlines(keepends=True)
    for _ in range(data.draw(st.integers(1, 3))):
        line = data.draw(st.integers(0, len(lines) - 1))
        key = lines[line].partition("=")[0].strip()
        match data.draw(st.sampled_from(["drop", "value", "points", "number"])):
            case "drop":
                lines[line] = "\n"
            case "value":
                lines[line] = f"{key} = {toml_of(data.draw(VALUES))}\n"
            case "points":
                lines[line] = f"{key} = {toml_of(data.draw(POINTS))}\n"
            case "number":
                number = data.draw(NUMBERS)
                lines[line] = re.sub(r"-?\d+(\.\d+)?(?=[\],\n])", number, lines[line], count=1)

    assert all(fault.startswith("s.toml: ") and "; " in fault for fault in faults("".join(lines)))


@settings(deadline=None)
@given(POINTS, POINTS, st.booleans())
def test_any_polygon_gives_a_mission_or_faults(
    corners: list[list[float]], hole: list[list[float]], inclusive: bool
) -> None:
    zone = (
        f'id = "z"\npolygon_m = {corners}\nholes_m = [{hole}]\ninclusive = {toml_of(inclusive)}\n'
    )
    text = VALID.replace("[[task]]\n", f"[[zone]]\n{zone}\n[[task]]\n", 1)

    assert all(fault.startswith("s.toml: ") and "; " in fault for fault in faults(text))
