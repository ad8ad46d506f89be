"""The paper's tables, figures and theorems, computed again: `swarm reproduce`."""
