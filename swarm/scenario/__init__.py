"""Scenario files: TOML in, a validated mission out, one clear line per fault."""

from swarm.scenario.shipped import resolve_scenario, shipped_scenarios

__all__ = ["resolve_scenario", "shipped_scenarios"]
