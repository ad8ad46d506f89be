"""Study files that ship with the package; `swarm study` finds them by name.

Leaves out: everything but the TOML files beside this one.
"""
