"""The bus: one small port and the transports behind it."""
