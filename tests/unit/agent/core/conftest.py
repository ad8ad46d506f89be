"""Decisions under the field's constraints as a test tells them."""

from __future__ import annotations

import pytest

from agent.core import field_decision
from tests.support.field_agent import Script


@pytest.fixture
def script(monkeypatch: pytest.MonkeyPatch) -> Script:
    """What the agents of this test decide next, in order."""
    told = Script()
    monkeypatch.setattr(field_decision, "decide_in_field", told.decide)
    monkeypatch.setattr(field_decision, "divert_in_field", lambda *_: None)
    return told
