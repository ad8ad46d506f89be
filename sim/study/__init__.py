"""Studies: many simulated missions side by side, and the missions they draw."""
