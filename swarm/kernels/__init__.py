"""Compiled kernels behind typed Python faces: arrays in, arrays out.

Every kernel has a plain definition in `tests.support.reference` that it is tested
against.
"""
