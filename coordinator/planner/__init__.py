"""The upper level: which priority sequence, and how good is the plan it gives.

Pure: takes problems, limits and seeds, returns plans.
"""
