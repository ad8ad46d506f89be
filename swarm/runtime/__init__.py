"""What every process has: its shell, clock, log, memory, errors and common options."""
