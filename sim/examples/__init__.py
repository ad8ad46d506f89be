"""Short programs that show what ``import swarm`` can do: ``python -m sim.examples.NAME``."""
