"""Times and paths of legs: how a kind of UAV flies, and which way round zones is shortest.

Nothing else knows either. Leaves out: what is on the spot (service, lines) and energy.
"""

from swarm.allocation.legs.flight import FlightModel
from swarm.allocation.legs.network import Airspace, LegNetwork, Legs
from swarm.allocation.legs.planner import PathPlanner

__all__ = ["Airspace", "FlightModel", "LegNetwork", "Legs", "PathPlanner"]
