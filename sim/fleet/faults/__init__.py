"""Faults for real processes: relays between them, a recorder of what they say, and checks of it."""
