"""A mission in a terminal: `swarm status`, the live picture and the report."""
