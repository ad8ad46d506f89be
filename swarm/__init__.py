"""What all processes share: model, scenarios, allocation, protocol, bus, identity, runtime."""

__version__ = "0.1.0"
