"""A plan, and what was flown of it, drawn over the map."""

from coordinator.plot.figure import PLOT_SUFFIXES, draw_plan, plan_figure
from coordinator.plot.flight import DrawnFlight, draw_flight, flight_figure

__all__ = [
    "PLOT_SUFFIXES",
    "DrawnFlight",
    "draw_flight",
    "draw_plan",
    "flight_figure",
    "plan_figure",
]
