"""Faults in virtual time: schedules of them, what must hold all the same, and the search."""
