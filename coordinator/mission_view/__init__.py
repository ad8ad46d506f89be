"""The read model of a running mission, for all who show, record or command it."""
