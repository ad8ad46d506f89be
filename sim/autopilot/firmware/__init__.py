"""What differs between autopilot firmwares, as models of them."""
