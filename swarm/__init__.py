"""Shared vocabulary of the runtime: model, wire, state, allocation, bus, clock."""

__version__ = "0.1.0"
