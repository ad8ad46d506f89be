"""Ways to run a fleet that studies compare."""
