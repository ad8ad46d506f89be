"""Scenario files: TOML in, a validated mission out, one clear line per fault.

Everything is imported when it is first used: a process that only names scenarios reads none.
"""

from __future__ import annotations

from swarm.lazy_names import names_from

TYPE_CHECKING = False  # as typing has it, which everybody would have to import for it
if TYPE_CHECKING:
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

if not TYPE_CHECKING:  # a type checker must know no other name
    __getattr__ = names_from(
        __name__,
        {
            "swarm.scenario.files": ("resolve_scenario", "shipped_scenarios"),
            "swarm.scenario.plain": ("require_plain",),
            "swarm.scenario.read": ("load_scenario", "parse_scenario"),
            "swarm.scenario.write": ("format_scenario",),
        },
    )
