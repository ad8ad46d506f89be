"""The process that flies one UAV: it decides, claims and commands its autopilot."""
