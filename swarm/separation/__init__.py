"""Keeping the UAVs of a fleet apart: shared height layers, who keeps which, and who is in the way.

Pure: claims in, answers out. Leaves out: asking and flying (agent.core.airway).
"""
