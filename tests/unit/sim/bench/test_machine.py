from __future__ import annotations

import platform
from pathlib import Path

import pytest

from sim.bench import machine
from sim.bench.machine import peak_memory_bytes, this_machine


def test_machine_says_what_it_is() -> None:
    told = this_machine()
    assert told.cpu
    assert told.cores >= 1
    assert told.memory_bytes > 2**20
    assert told.versions["Python"] == platform.python_version()
    line = str(told)
    assert f"{told.cores} cores" in line
    assert "GiB RAM" in line
    assert "\n" not in line


def test_peak_memory_grows_and_stays() -> None:
    before = peak_memory_bytes()
    block = b"x" * before  # more than ever fitted beside the rest
    during = peak_memory_bytes()
    assert len(block) == before > 2**20
    assert during > 1.2 * before
    del block
    assert peak_memory_bytes() > 0.9 * during  # the kernel counts in batches of pages


def test_systems_without_proc_are_described_too(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    monkeypatch.setattr(machine, "_CPU_INFO", tmp_path / "none")
    monkeypatch.setattr(machine, "_STATUS", tmp_path / "none")
    assert this_machine().cpu
    assert peak_memory_bytes() > 2**20
