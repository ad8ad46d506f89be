"""Whether a fleet is so large that its height layers reach too high.

By itself, so that planning need not load what a coordinator publishes.
"""

from __future__ import annotations

from swarm.model import Mission
from swarm.model.layers import HIGHEST_M, FlightLayers


def height_warning(mission: Mission, layers: FlightLayers) -> str | None:
    """What to say of layers that reach too high, and what to do; None if they do not."""
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
