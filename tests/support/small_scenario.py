"""A small scenario file that is right, and the lines that a wrong one takes."""

from __future__ import annotations

from swarm.runtime.errors import InputError
from swarm.scenario import parse_scenario

VALID = """\
schema = 1
name = "small"

[mission]
horizon_s = 60.0
success_default = 0.5

[origin]
lat_deg = 47.0
lon_deg = 8.0
alt_m = 400.0

[[uav]]
id = "uav1"
position_m = [0.0, 0.0]
speed_m_s = 10.0
success = { t1 = 0.9, photo = 0.8 }

[[uav]]
id = "uav2"
position_m = [5, 0, 2]
speed_m_s = 12
survival = { t2 = 0.99 }
kind = "quad"

[[task]]
id = "t1"
position_m = [100.0, 0.0]
value = 5.0

[[task]]
id = "t2"
lat_deg = 47.001
lon_deg = 8.001
alt_m = 430.0
value = 3
service_s = 10.0
kind = "photo"
appears_s = 20.0
"""
PROBABILITY = "give a probability within 0..1"


def faults(data: str | bytes, source: str = "s.toml") -> list[str]:
    """The lines that a wrong file takes; none for a right one."""
    try:
        parse_scenario(data.encode() if isinstance(data, str) else data, source)
    except InputError as error:
        return str(error).splitlines()
    return []
