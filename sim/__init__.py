"""Simulated autopilots, virtual-time worlds and the one-machine launcher."""
