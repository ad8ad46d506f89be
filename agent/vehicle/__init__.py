"""Fly one vehicle through MAVLink: the bridge, its activities, and data on firmwares; pure."""
