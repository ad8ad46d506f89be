"""`swarm run`: all processes of one mission on this machine."""
