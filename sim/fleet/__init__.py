"""A fleet of real processes on this machine: `swarm run`, and `swarm doctor` before it."""
