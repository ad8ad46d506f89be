"""The same tests for a vehicle of every firmware."""

from __future__ import annotations

import pytest

from tests.support.fake_copter import FakeCopter
from tests.support.fake_px4 import FakePx4


@pytest.fixture(params=[FakeCopter, FakePx4], ids=["arducopter", "px4"])
def fake(request: pytest.FixtureRequest) -> type[FakeCopter]:
    """A firmware's scripted vehicle."""
    kind: type[FakeCopter] = request.param
    return kind
