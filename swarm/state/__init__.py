"""The replicated state: registers that join, and who holds which task."""
