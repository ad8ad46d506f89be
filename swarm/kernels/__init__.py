"""Compiled kernels behind typed Python faces: arrays in, arrays out.

Every kernel has a plain definition in `swarm.allocation.reference` that it is tested
against. Leaves out: what a result is used for.
"""
