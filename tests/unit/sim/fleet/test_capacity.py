"""A fleet that its machine cannot fly is told so before anything starts."""

from __future__ import annotations

from pathlib import Path

import pytest

from sim.fleet import capacity
from sim.fleet.capacity import BYTES_PER_UAV, CPU_FRAC_PER_UAV, MANY, cpu_frac, too_large
from swarm.cli import main

GIB = 1 << 30
SCENARIO = """
schema = 1
name = "crowd"
[mission]
horizon_s = 100.0
[[task]]
id = "t1"
position_m = [1.0, 1.0]
value = 1.0
"""


def test_what_fits_is_no_matter_and_one_more_is_told() -> None:
    most = int(2 / CPU_FRAC_PER_UAV)

    assert too_large(most, 2, 1000 * GIB) is None
    assert (
        too_large(most + 1, 2, 1000 * GIB) == f"{most + 1} UAVs, and 2 cores can fly about {most}"
    )


def test_a_machine_flies_more_whose_agents_share_processes() -> None:
    most = int(2 / CPU_FRAC_PER_UAV)

    assert too_large(most + 1, 2, 1000 * GIB, MANY - 1) is not None
    assert too_large(most + 1, 2, 1000 * GIB, MANY) is None
    assert too_large(2 * most, 2, 1000 * GIB, MANY) is not None


@pytest.mark.parametrize("per_process", [1, MANY])
def test_a_machine_flies_fewer_that_keep_apart(per_process: int) -> None:
    most = int(2 / cpu_frac(per_process, keeps_apart=True))

    assert most < int(2 / cpu_frac(per_process))
    assert too_large(most, 2, 1000 * GIB, per_process, keeps_apart=True) is None
    assert too_large(most + 1, 2, 1000 * GIB, per_process, keeps_apart=True) == (
        f"{most + 1} UAVs that keep apart, and 2 cores can fly about {most}"
    )


def test_memory_counts_where_it_is_known() -> None:
    assert too_large(50, 64, 50 * BYTES_PER_UAV) is not None
    assert too_large(50, 64, 0) is None


def crowd(folder: Path, n_uav: int, limits: str = "") -> Path:
    uavs = "".join(
        f'[[uav]]\nid = "u{n}"\nposition_m = [{n}.0, 0.0]\nspeed_m_s = 5.0\n' for n in range(n_uav)
    )
    path = folder / "crowd.toml"
    scenario = SCENARIO.replace("schema = 1", "schema = 2") if limits else SCENARIO
    scenario = scenario.replace("horizon_s = 100.0\n", f"horizon_s = 100.0\n{limits}")
    path.write_text(scenario + uavs, encoding="utf-8")
    return path


def test_a_run_of_too_many_ends_with_one_line(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(capacity, "usable_cores", lambda: 1)

    assert main(["run", str(crowd(tmp_path, 200))]) == 2
    told = capsys.readouterr().err
    assert "200 UAVs, and 1 core can fly about" in told
    assert "several machines" in told
    assert "--any-size" in told
    assert len(told.strip().splitlines()) == 1


def test_a_run_that_fits_where_agents_share_processes_is_told_so(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(capacity, "usable_cores", lambda: 1)

    assert main(["run", str(crowd(tmp_path, 100))]) == 2
    told = capsys.readouterr().err
    assert "share processes with --agents-per-process 25, or all the same with --any-size" in told


def test_a_run_of_too_many_that_keep_apart_ends_with_one_line(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(capacity, "usable_cores", lambda: 1)
    scenario = crowd(tmp_path, 30, "separation_m = 0.5\nband_m = [30.0, 110.0]\n")

    assert main(["run", str(scenario)]) == 2
    told = capsys.readouterr().err
    assert "30 UAVs that keep apart, and 1 core can fly about" in told
    assert "--agents-per-process 25" in told
