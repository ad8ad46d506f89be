"""`swarm install`: services of systemd for the processes of a fleet, one machine at a time."""
