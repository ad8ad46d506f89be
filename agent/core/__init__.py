"""The agent's decisions: events in, actions out, without I/O and without a clock."""
