"""Small area missions, written as scenarios are."""

from __future__ import annotations

from swarm.model import Mission
from swarm.scenario.read import parse_scenario

_PADDOCK = """
schema = 2
name = "paddock"
task = []
[mission]
horizon_s = 600.0
zone_margin_m = 5.0
[[uav]]
id = "uav1"
position_m = [10, -30]
speed_m_s = 10.0
{endurance}
[[uav]]
id = "uav2"
position_m = [22, -30]
speed_m_s = 10.0
{endurance}
[[base]]
id = "barn"
position_m = [30, -50]
swap_s = 20.0
{slots}
"""
_AREA = """
[[area]]
id = "{name}"
polygon_m = {polygon}
value = 100.0
spacing_m = 30.0
heading_deg = 0.0
max_line_m = {longest}
"""
SQUARE = "[[0, 0], [180, 0], [180, 180], [0, 180]]"
"""Six strips, each of two lines of 90 m."""


def paddock(
    *, endurance_s: float | None = None, slots: int = 0, areas: tuple[str, ...] = (SQUARE,)
) -> Mission:
    """Two UAVs at the south-western corner, and areas mown from south to north."""
    endurance = "" if endurance_s is None else f"endurance_s = {endurance_s}"
    text = _PADDOCK.format(endurance=endurance, slots=f"slots = {slots}" if slots else "")
    for number, polygon in enumerate(areas, start=1):
        text += _AREA.format(name=f"field{number}", polygon=polygon, longest=100.0)
    return parse_scenario(text.encode(), "paddock.toml")
