"""Offline planning and the coordinator daemon."""
