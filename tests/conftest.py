"""Settings of all tests: no property test depends on how fast the machine is."""

from __future__ import annotations

from hypothesis import settings

settings.register_profile("any machine", settings(deadline=None))
settings.load_profile("any machine")
