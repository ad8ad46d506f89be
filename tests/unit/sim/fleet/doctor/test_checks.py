"""What the doctor makes of what was read: software, machine, bus."""

from __future__ import annotations

import io
import json
from dataclasses import replace
from pathlib import Path

import pytest
from rich.console import Console

from sim.fleet.doctor.bus import BusView, DialResult, check_session, judge_dial
from sim.fleet.doctor.finding import (
    CheckFinding,
    CheckState,
    as_json,
    fails,
    fine,
    print_findings,
    warns,
)
from sim.fleet.doctor.host import (
    ClockReading,
    ResourceLimits,
    StateFolder,
    check_clock,
    check_kernels,
    check_key,
    check_limits,
    check_packages,
    check_port,
    check_python,
    check_state,
)

NOW = ClockReading(
    1.8e9, 1.79e9, synchronised=True, max_error_s=0.01, monotonic_s=0.021, slept_s=0.02
)
NEEDED = ["eclipse-zenoh<2,>=1.10.2", "numpy>=1.26", "distributed>=2025.1; extra == 'study'"]


def states(*findings: CheckFinding) -> list[CheckState]:
    return [finding.state for finding in findings]


def test_whatever_is_wrong_comes_with_a_remedy_and_nothing_else_does() -> None:
    with pytest.raises(ValueError, match="what to do"):
        CheckFinding("clock", CheckState.FAILS, "is wrong")
    with pytest.raises(ValueError, match="what to do"):
        CheckFinding("clock", CheckState.OK, "is right", "set it")


def test_one_line_each_off_a_terminal_and_objects_for_programs() -> None:
    findings = [fine("a", "is fine"), warns("b", "may\nbe", "look"), fails("c", "is not", "mend")]
    console = Console(file=io.StringIO(), width=20)
    print_findings(findings, console)

    assert isinstance(console.file, io.StringIO)
    lines = ["ok      a: is fine", "warning b: may be; look", "fails   c: is not; mend"]
    assert console.file.getvalue().splitlines() == lines
    told = json.loads(json.dumps(as_json(findings)))
    assert (told["ok"], told["counts"]) == (False, {"ok": 1, "warning": 1, "fails": 1})
    assert told["checks"][2] == {"check": "c", "state": "fails", "text": "is not", "remedy": "mend"}
    assert as_json(findings[:2])["ok"]


def test_an_old_python_fails() -> None:
    assert states(check_python((3, 11, 0), (3, 11)), check_python((3, 10, 9), (3, 11))) == [
        CheckState.OK,
        CheckState.FAILS,
    ]


@pytest.mark.parametrize(
    ("versions", "state", "text"),
    [
        ({"eclipse-zenoh": "1.10.2", "numpy": "2.0"}, CheckState.OK, "eclipse-zenoh 1.10.2"),
        (
            {"eclipse-zenoh": "1.9.9", "numpy": "2.0"},
            CheckState.FAILS,
            "eclipse-zenoh 1.9.9 (needed",
        ),
        (
            {"eclipse-zenoh": "2.0.0", "numpy": "2.0"},
            CheckState.FAILS,
            "eclipse-zenoh 2.0.0 (needed",
        ),
        ({"eclipse-zenoh": "1.10.2"}, CheckState.FAILS, "numpy missing"),
    ],
)
def test_packages_are_there_and_new_enough_or_named(
    versions: dict[str, str], state: CheckState, text: str
) -> None:
    found = check_packages(NEEDED, versions.get)

    assert found.state is state
    assert found.text.startswith(text)


def test_kernels_that_fail_or_compute_wrongly_are_told() -> None:
    def broken() -> dict[str, float]:
        raise ImportError("no _kernels")

    assert check_kernels(lambda: {"greedy": 118.4939, "exact": 120.3335}).state is CheckState.OK
    assert "greedy 1.0 instead of 118.4939" in check_kernels(lambda: {"greedy": 1.0}).text
    assert "ImportError: no _kernels" in check_kernels(broken).text


@pytest.mark.parametrize(
    ("clock", "state", "text"),
    [
        (NOW, CheckState.OK, "2027-01-15 08:00:00 UTC, synchronised"),
        (replace(NOW, synchronised=False), CheckState.WARNING, "not synchronised"),
        (replace(NOW, synchronised=None), CheckState.WARNING, "cannot be told"),
        (replace(NOW, max_error_s=3.0), CheckState.WARNING, "may be off by 3.0 s"),
        (replace(NOW, unix_s=0.0), CheckState.FAILS, "1970-01-01 00:00:00 UTC cannot be"),
        (replace(NOW, monotonic_s=0.0), CheckState.FAILS, "monotonic"),
    ],
)
def test_clocks_are_judged_by_date_synchronisation_and_running(
    clock: ClockReading, state: CheckState, text: str
) -> None:
    found = check_clock(clock)

    assert found.state is state
    assert text in found.text


def test_a_machine_is_judged_by_the_fleet_it_is_to_carry() -> None:
    small = ResourceLimits(cpus=1, open_files=1024, memory_bytes=5e9)

    assert states(*check_limits(small, 10)) == [CheckState.OK] * 3
    assert states(*check_limits(small, 120)) == [
        CheckState.FAILS,
        CheckState.WARNING,
        CheckState.WARNING,
    ]
    assert states(*check_limits(small, 40)) == [CheckState.OK] * 3
    assert states(*check_limits(small, 40, keeps_apart=True)) == [
        CheckState.OK,
        CheckState.WARNING,
        CheckState.OK,
    ]
    assert "ulimit -n 1088" in check_limits(small, 120)[0].remedy
    assert len(check_limits(replace(small, memory_bytes=None), 1)) == 2


def test_a_taken_port_names_who_has_it() -> None:
    taken = check_port("port", "8080", "Address already in use", "swarm dashboard (pid 7)")
    foreign = check_port("bus", "tcp/10.0.0.9:7447", "Cannot assign requested address", None)

    assert check_port("port", "8080", None, None).state is CheckState.OK
    assert taken.text == "8080 is taken by swarm dashboard (pid 7)"
    assert "address of this machine" in foreign.remedy


def test_a_state_folder_needs_rights_and_room() -> None:
    path = Path("/var/lib/peckorder")
    found = [
        check_state(StateFolder(path, None, 1e9)),
        check_state(StateFolder(path, None, 1e6)),
        check_state(StateFolder(path, "Permission denied", 0.0)),
    ]

    assert states(*found) == [CheckState.OK, CheckState.WARNING, CheckState.FAILS]


def test_a_signing_key_is_its_owners_alone() -> None:
    path = Path("uav1.key")
    found = [
        check_key(path, None, 0o600),
        check_key(path, None, 0o640),
        check_key(path, "uav1.key: this key is open to everyone; close it: chmod o= uav1.key", 0),
    ]

    assert states(*found) == [CheckState.OK, CheckState.WARNING, CheckState.FAILS]
    assert found[2].remedy == "close it: chmod o= uav1.key"


def test_one_router_of_several_is_enough() -> None:
    gone = DialResult("tcp/10.0.0.2:7447", 2.0, "no answer within 2 s")

    assert judge_dial(gone, enough=True).state is CheckState.WARNING
    assert judge_dial(gone, enough=False).state is CheckState.FAILS
    assert "swarm router --listen tcp/0.0.0.0:7447" in judge_dial(gone, enough=False).remedy
    assert (
        "after 3.2 ms" in judge_dial(replace(gone, problem=None, took_s=0.0032), enough=True).text
    )


def test_who_is_on_the_bus_is_told_and_slow_answers_change_the_advice() -> None:
    found = BusView(True, ("m",), ("coordinator", "uav1"), 2, 0.012)

    assert states(*check_session(found, "m")) == [CheckState.OK] * 3
    assert check_session(found, None)[2].text == "first of 2 answers after 12.0 ms"
    assert "--link bad" in check_session(replace(found, round_trip_s=0.4), "m")[2].remedy
    silent = check_session(replace(found, answers=0, round_trip_s=None), "m")
    assert silent[2].state is CheckState.WARNING
    assert check_session(replace(found, linked=False), None)[0].state is CheckState.WARNING
    absent = check_session(BusView(True, ("n",), (), 0, None), "m")
    assert states(*absent) == [CheckState.OK, CheckState.FAILS]
