"""Scenario files: TOML in, a validated mission out, one clear line per fault."""

from swarm.scenario.files import resolve_scenario, shipped_scenarios
from swarm.scenario.plain import require_plain
from swarm.scenario.read import load_scenario, parse_scenario
from swarm.scenario.write import format_scenario

__all__ = [
    "format_scenario",
    "load_scenario",
    "parse_scenario",
    "require_plain",
    "resolve_scenario",
    "shipped_scenarios",
]
