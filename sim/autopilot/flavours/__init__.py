"""What differs between autopilot firmwares."""
