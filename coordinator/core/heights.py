"""What a person should know of the heights at which a mission is flown.

Layers of a large fleet may reach too high, and tasks at heights of their own take UAVs out of the
layers that keep them apart. By itself, so that planning need not load what a coordinator publishes.
"""

from __future__ import annotations

from itertools import pairwise

from swarm.model import Mission
from swarm.model.layers import HIGHEST_M, FlightLayers


def height_warnings(mission: Mission, layers: FlightLayers) -> tuple[str, ...]:
    """What there is to say, each with what to do behind a colon.

    Args:
        mission: as it is to be flown.
        layers: of its UAVs, where these share none.
    """
    warnings = _layers_too_high(mission, layers), _tasks_at_one_height(mission, layers)
    return tuple(warning for warning in warnings if warning is not None)


def _layers_too_high(mission: Mission, layers: FlightLayers) -> str | None:
    count = len(mission.uavs)
    above = sum(layers.layer_m(index) > HIGHEST_M for index in range(count))
    if not above:
        return None
    who = "1 UAV flies" if above == 1 else f"{above} UAVs fly"
    return (
        f"the highest of {count} height layers is {layers.layer_m(count - 1):g} m up, and {who} "
        f"above {HIGHEST_M:g} m, which many countries forbid: fly fewer UAVs, or let swarm "
        "coordinator lower --layer-spacing-m or --lowest-layer-m"
    )


def _tasks_at_one_height(mission: Mission, layers: FlightLayers) -> str | None:
    """Of tasks at heights of their own, where UAVs that do them meet at one height."""
    if mission.separation_m is not None or len(mission.uavs) < 2:
        return None
    heights_m = sorted(task.height_m for task in mission.tasks if task.height_m is not None)
    alike = [b for a, b in pairwise(heights_m) if b == a or b - a < layers.spacing_m]
    if not alike:
        return None
    many = f"{len(heights_m)} tasks have a height_m of their own"
    remedy = "give them heights that differ" if mission.terrain else "give [mission] separation_m"
    return f"{many}, such as {alike[0]:g} m, where no layers keep UAVs apart: {remedy}"
