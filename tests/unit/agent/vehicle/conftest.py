"""The same tests for a vehicle of every firmware, commanded either way."""

from __future__ import annotations

import pytest

from agent.vehicle.config import BridgeConfig, CommandStyle
from tests.support.bridge_flight import ORIGIN, BridgeFlight
from tests.support.fake_copter import FakeCopter
from tests.support.fake_px4 import FakePx4


@pytest.fixture(params=[FakeCopter, FakePx4], ids=["arducopter", "px4"])
def fake(request: pytest.FixtureRequest) -> type[FakeCopter]:
    """A firmware's scripted vehicle."""
    kind: type[FakeCopter] = request.param
    return kind


@pytest.fixture(params=list(CommandStyle), ids=[style.value for style in CommandStyle])
def style(request: pytest.FixtureRequest) -> CommandStyle:
    """A way to command it."""
    chosen: CommandStyle = request.param
    return chosen


@pytest.fixture
def config(style: CommandStyle) -> BridgeConfig:
    """Of a bridge that commands it that way."""
    return BridgeConfig(1, ORIGIN, command=style)


@pytest.fixture
def flight(fake: type[FakeCopter], config: BridgeConfig) -> BridgeFlight:
    """Of such a vehicle; it has not begun."""
    return BridgeFlight(fake(ORIGIN), config)
