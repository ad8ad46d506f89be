"""A simulated autopilot that speaks MAVLink 2; a real one can take its place unchanged."""
