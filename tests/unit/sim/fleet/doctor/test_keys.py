"""What the doctor makes of keys."""

from __future__ import annotations

from pathlib import Path

import pytest

from sim.fleet.doctor.finding import CheckState
from sim.fleet.doctor.inputs import check_folder, check_roster, read_keys
from swarm.identity import load_identity
from swarm.identity.founding import found_authority

NOW_S = 1.8e9
DAY_S = 86_400.0


@pytest.fixture(scope="module")
def keys(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("authority") / "keys"
    found_authority(folder, "m", ["uav1", "uav2"], now_s=NOW_S, days=30)
    return folder


def test_sound_keys_say_whose_they_are_and_for_how_long(keys: Path) -> None:
    identity, (found, folder) = read_keys(keys / "uav1", "m", NOW_S)

    assert identity is not None
    assert found.state is CheckState.OK
    assert "those of uav1@1, uav of m, valid until" in found.text
    assert folder.state is CheckState.OK


def test_keys_that_expire_within_a_week_are_doubtful(keys: Path) -> None:
    _, (found, _) = read_keys(keys / "uav1", None, NOW_S + 25.0 * DAY_S)

    assert found.state is CheckState.WARNING
    assert "swarm keys renew" in found.remedy


@pytest.mark.parametrize(
    ("name", "mission", "now_s", "says"),
    [
        ("uav1", "other", NOW_S, "for the mission 'm', not 'other'"),
        ("uav1", None, NOW_S + 40.0 * DAY_S, "expired on"),
        ("uav1", None, NOW_S - 40.0 * DAY_S, "is not valid before"),
        ("nobody", None, NOW_S, "no such folder"),
        (".", None, NOW_S, "is the folder of the authority"),
    ],
)
def test_keys_that_cannot_be_flown_with_fail_and_say_why(
    keys: Path, name: str, mission: str | None, now_s: float, says: str
) -> None:
    identity, (found,) = read_keys(keys / name, mission, now_s)

    assert identity is None
    assert found.state is CheckState.FAILS
    assert says in found.text


def test_a_folder_that_others_may_look_into_is_doubtful(tmp_path: Path) -> None:
    assert check_folder(tmp_path, 0o40750).state is CheckState.WARNING
    assert check_folder(tmp_path, 0o40700).state is CheckState.OK


def test_a_roster_without_a_uav_of_the_scenario_fails(keys: Path) -> None:
    identity = load_identity(keys / "coordinator", now_s=NOW_S)

    assert check_roster(identity, ["uav1", "uav2"], NOW_S).text == (
        "version 2: 2 uav, 1 coordinator, 1 router, 1 viewer, 1 operator"
    )
    lacking = check_roster(identity, ["uav1", "uav3", "uav4"], NOW_S)
    assert lacking.state is CheckState.FAILS
    assert "without uav3, uav4 of the scenario" in lacking.text
    late = check_roster(identity, [], NOW_S + 31.0 * DAY_S)
    assert late.state is CheckState.WARNING
    assert "keys of coordinator, dashboard, operator, router, uav1, uav2 have expired" in late.text
