"""A plan drawn over the map."""

from coordinator.plot.figure import PLOT_SUFFIXES, draw_plan, plan_figure

__all__ = ["PLOT_SUFFIXES", "draw_plan", "plan_figure"]
