"""`swarm status`: a look at a mission that is being flown elsewhere."""
