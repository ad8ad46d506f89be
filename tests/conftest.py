"""Settings of all tests: no property test depends on how fast the machine is, no run is found."""

from __future__ import annotations

import gc
import signal
from collections.abc import Iterator

import pytest
from hypothesis import settings

settings.register_profile("day", settings(deadline=None))
settings.register_profile("night", settings(deadline=None, max_examples=200))
settings.load_profile("night")


def pytest_configure(config: pytest.Config) -> None:
    """Where slow tests are left out, a property is tried with fewer examples, too."""
    if "not slow" in config.getoption("markexpr"):
        settings.load_profile("day")


# What is collected stays to the end: to search it for garbage is a third of what collecting costs.
gc.disable()
_SELDOM = (20_000, 10, 10)
"""Hardly anything in these tests is garbage in circles: looked for at 700 new things, as usual, it
takes a tenth of the time of a mission in virtual time."""


def pytest_collection_finish() -> None:
    gc.freeze()
    gc.set_threshold(*_SELDOM)
    gc.enable()


# What a shell starts with `&` ignores SIGINT, and so would every process that a test interrupts.
if signal.getsignal(signal.SIGINT) is signal.SIG_IGN:
    signal.signal(signal.SIGINT, signal.default_int_handler)


@pytest.fixture(scope="session", autouse=True)
def runs_of_its_own(tmp_path_factory: pytest.TempPathFactory) -> Iterator[None]:
    """Commands of these tests find no runs of the user, nor of tests that go on beside them."""
    with pytest.MonkeyPatch.context() as patch:
        folder = tmp_path_factory.mktemp("runtime")
        folder.chmod(0o700)
        patch.setenv("XDG_RUNTIME_DIR", str(folder))
        yield
