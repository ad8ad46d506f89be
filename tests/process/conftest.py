"""Processes that are launched within these tests are forked from one server, too."""

from __future__ import annotations

import pytest

from tests.process.programs import fork_server


@pytest.fixture(scope="session", autouse=True)
def _forked_from_one_server() -> None:
    fork_server()
