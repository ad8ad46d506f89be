"""
Compiled kernels; call them through the typed functions of swarm.kernels.
"""
