"""Recordings of missions: written while they are flown, read, played and told afterwards."""
