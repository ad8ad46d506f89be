"""Runs of this user on this machine: how they are told, found, chosen, and not believed."""

from __future__ import annotations

import json
import os
import stat
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path

import pytest

from swarm.bus import connection as seat_module
from swarm.bus.config import MeshTopology
from swarm.bus.connection import ConnectionOptions
from swarm.bus.local_runs import LocalRun, announced, begun, local_runs
from swarm.cli import main
from swarm.protocol.timing import LinkKind
from swarm.runtime.errors import InputError

ME = os.getpid()
RUN = LocalRun(
    pid=ME,
    begun=begun(ME),
    mission="table-1",
    mesh=True,
    endpoints=("tcp/127.0.0.1:10001", "tcp/127.0.0.1:10002"),
    link=LinkKind.CLEAN,
)
PARENT = replace(RUN, pid=os.getppid(), begun=begun(os.getppid()), mission="meadow", mesh=False)


@pytest.fixture(autouse=True)
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """Where the files of this test's runs are."""
    monkeypatch.setenv("XDG_RUNTIME_DIR", str(tmp_path))
    monkeypatch.setattr(seat_module, "accepts", lambda _: False)
    return tmp_path / "peckorder"


@contextmanager
def on(*runs: LocalRun) -> Iterator[None]:
    with announced(runs[0]) as fault:
        assert fault is None
        if len(runs) > 1:
            with on(*runs[1:]):
                yield
        else:
            yield


def refusal(seat: ConnectionOptions, mission: str | None = None) -> str:
    with pytest.raises(InputError) as refused:
        seat.found(mission)
    (fault,) = refused.value.faults
    return f"{fault.problem}: {fault.remedy}"


# -- telling and finding ------------------------------------------------------------------


def test_a_run_is_found_as_long_as_it_is_on(folder: Path) -> None:
    assert local_runs() == []
    with on(RUN):
        assert local_runs() == [RUN]
        modes = [stat.S_IMODE(path.stat().st_mode) for path in (folder, *folder.iterdir())]
        assert modes == [0o700, 0o600]
    assert local_runs() == []
    assert list(folder.iterdir()) == []


def test_a_run_that_was_killed_is_forgotten(folder: Path) -> None:
    gone = replace(RUN, pid=2**22 - 7, begun=None)
    another = replace(PARENT, begun=(PARENT.begun or 0) + 1)
    with on(gone, another, RUN):
        assert local_runs() == [RUN]
        assert [path.stem for path in folder.iterdir()] == [str(ME)]


def test_a_folder_or_file_that_others_may_write_is_not_believed(folder: Path) -> None:
    with on(RUN):
        file = folder / f"{ME}.json"
        file.chmod(0o644)
        assert local_runs() == []
        file.chmod(0o600)
        folder.chmod(0o755)
        assert local_runs() == []
        with announced(PARENT) as fault:
            assert fault == f"{folder} is open to others"
        folder.chmod(0o700)
        assert local_runs() == [RUN]


def test_links_and_folders_of_others_are_not_followed(folder: Path, tmp_path: Path) -> None:
    with on(RUN):
        aside = tmp_path / "aside.json"
        (folder / f"{ME}.json").rename(aside)
        (folder / f"{ME}.json").symlink_to(aside)
        assert local_runs() == []
    folder.rmdir()
    (tmp_path / "other").mkdir(mode=0o700)
    folder.symlink_to(tmp_path / "other")
    with announced(RUN) as fault:
        assert fault == f"{folder} is no folder"


def test_nonsense_is_passed_over(folder: Path) -> None:
    with on(RUN):
        told = json.loads((folder / f"{ME}.json").read_text())
        for number, wrong in enumerate(
            (
                "",
                "[]",
                "{}",
                json.dumps(told | {"endpoints": [1]}),
                json.dumps(told | {"pid": "7"}),
                json.dumps(told | {"link": "string"}),
                json.dumps(told | {"viewer_keys": 7}),
                "[" * 100_000,
            )
        ):
            (folder / f"x{number}.json").write_text(wrong)
            (folder / f"x{number}.json").chmod(0o600)
        os.mkfifo(folder / "fifo.json", 0o600)
        assert local_runs() == [RUN]
        (folder / f"{ME}.json").write_text(json.dumps(told | {"later": 1}))
        assert local_runs() == [RUN]


def test_where_there_is_no_room_for_its_file_a_run_says_so(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "peckorder").write_text("in the way")
    with announced(RUN) as fault:
        assert fault == f"{tmp_path / 'peckorder'}: File exists"


# -- choosing -------------------------------------------------------------------------------


def test_where_no_run_is_on_a_command_looks_for_its_router_as_ever() -> None:
    assert ConnectionOptions().found(None) == ConnectionOptions()
    assert refusal(ConnectionOptions(bus="run")).startswith("no run of this user is on here")


def test_the_only_run_is_found_without_a_word() -> None:
    with on(RUN):
        place = ConnectionOptions().found(None)
        topology = place.config().topology
    assert isinstance(topology, MeshTopology)
    assert topology.dial == RUN.endpoints
    assert topology.listen.startswith("tcp/127.0.0.1:")
    assert topology.listen not in RUN.endpoints
    assert place.link is LinkKind.CLEAN
    with on(PARENT):
        assert ConnectionOptions().found(None).arguments()[:2] == ["--bus", "router"]


def test_whatever_is_named_counts() -> None:
    with on(RUN):
        for seat in (
            ConnectionOptions(connect=["tcp/127.0.0.1:7447"]),
            ConnectionOptions(bus="mesh", listen="tcp/127.0.0.1:7001"),
            ConnectionOptions(keys=Path("keys")),
        ):
            assert seat.found(None) == seat


def test_of_several_runs_the_mission_or_the_process_says_which() -> None:
    with on(RUN, PARENT):
        assert ConnectionOptions().found("meadow").connect == list(PARENT.endpoints)
        assert ConnectionOptions(bus=f"run:{ME}").found(None).bus == "mesh"
        assert ConnectionOptions().found("elsewhere") == ConnectionOptions()
        named = f"meadow (pid {PARENT.pid}), table-1 (pid {ME})"
        assert refusal(ConnectionOptions()) == (
            f"several runs are on here: {named}: name one with --mission"
        )
    with on(RUN, replace(PARENT, mission="table-1")):
        assert "give --bus run:" in refusal(ConnectionOptions(), "table-1")


def test_beside_a_router_nobody_guesses_which_is_meant(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(seat_module, "accepts", lambda endpoint: endpoint.endswith(":7447"))
    with on(RUN):
        text = refusal(ConnectionOptions())
        assert ConnectionOptions(bus="run").found(None).bus == "mesh"
    assert "--bus run for the run, or --connect tcp/127.0.0.1:7447 for the router" in text


def test_keys_of_the_run_are_those_of_who_asks_and_have_to_be_readable(tmp_path: Path) -> None:
    viewer, operator = tmp_path / "viewer", tmp_path / "operator"
    viewer.mkdir(mode=0o700)
    secure = replace(RUN, viewer_keys=str(viewer), operator_keys=str(operator))
    with on(secure):
        place = ConnectionOptions().found(None)
        assert place.keys == viewer
        assert place.listen.startswith("tls/")
        with pytest.raises(InputError, match="--keys DIR with those of an operator"):
            ConnectionOptions().found(None, operator=True)
        given = ConnectionOptions(bus="run", keys=viewer).found(None, operator=True)
        assert given.keys == viewer


@pytest.mark.parametrize("command", ["dashboard", "foxglove", "ros2"])
def test_who_shows_a_mission_finds_the_run_of_this_machine(
    command: str, capsys: pytest.CaptureFixture[str]
) -> None:
    with on(RUN):
        assert main([command, "--check", "--bus", "run"]) == 0
        assert main([command, "--check", "--bus", "run:1"]) == 2
    assert "--bus: run:1: no run of this user is on here" in capsys.readouterr().err
    with on(RUN, PARENT):
        assert main([command, "--check"]) == 2
    assert "several runs are on here" in capsys.readouterr().err
