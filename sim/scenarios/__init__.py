"""Scenario files that ship with the package; swarm.scenario finds them by name.

Leaves out: everything but the TOML files beside this one.
"""
