"""Short programs that show what ``import swarm`` can do: ``python -m sim.examples.NAME``.

Leaves out: what the commands of `swarm` do already.
"""
