"""The keys of a run: new ones that leave nothing behind, or some that were made before."""

from __future__ import annotations

import shutil
import stat
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import pytest

from coordinator.mission_view.results import ProtectionSummary
from sim.fleet.firmware import FirmwareKind, SitlFirmware
from sim.fleet.keys import RunKeys, fresh_keys, keys_in
from sim.fleet.layout import BusKind, LaunchOptions
from sim.fleet.security import protected, security_of
from swarm.identity.authority import open_authority
from swarm.identity.folder import load_identity
from swarm.identity.roster import Role
from swarm.runtime.errors import InputError
from tests.support.builders import mission, task, uav
from tests.unit.sim.fleet.test_fleet import OPTIONS

FLEET = mission([uav("u1"), uav("u2")], [task("t0", 1.0)])
ROUTED = replace(OPTIONS, bus=BusKind.ROUTER)


@pytest.fixture
def made() -> Iterator[RunKeys]:
    with fresh_keys(FLEET, routers=2, strangers=["spy"]) as keys:
        yield keys


def role(folder: Path) -> Role:
    return load_identity(folder, mission=FLEET.name).role


def test_every_process_of_a_run_gets_an_identity_with_its_role(made: RunKeys) -> None:
    assert role(made.of_seat("u2")) is Role.UAV
    assert role(made.of_seat("coordinator")) is Role.COORDINATOR
    assert role(made.of_observer("onlooker")) is Role.VIEWER
    assert role(made.of_operator()) is Role.OPERATOR
    assert role(made.of_observer("spy")) is Role.UAV
    assert [made.of_router(number).name for number in range(3)] == ["router", "router-2", "router"]


def test_new_keys_are_private_and_gone_when_the_run_is_over() -> None:
    with fresh_keys(FLEET) as keys:
        folder = keys.folder
        modes = {stat.S_IMODE(path.stat().st_mode) for path in (folder, folder.parent)}
        assert modes == {0o700}
        assert folder.is_dir()
    assert not folder.parent.exists()


def test_a_name_that_keys_cannot_have_is_one_clear_line() -> None:
    clash = mission([uav("router")], [task("t0", 1.0)])
    with pytest.raises(InputError, match="router"), fresh_keys(clash):
        raise AssertionError


def test_keys_made_before_serve_a_run(made: RunKeys) -> None:
    assert keys_in(made.folder, FLEET, mesh=False) == replace(made, guests={})


def test_a_mesh_needs_keys_that_may_be_dialled(made: RunKeys) -> None:
    with pytest.raises(InputError, match=r"nobody else may be dialled .*; use --bus router"):
        keys_in(made.folder, FLEET, mesh=True)
    with fresh_keys(FLEET, mesh=True) as meshed:
        keys_in(meshed.folder, FLEET, mesh=True)


def test_keys_of_another_mission_or_of_too_few_are_a_line_each(made: RunKeys) -> None:
    shutil.rmtree(made.folder / "u1")
    open_authority(made.folder).revoke(["u2"])
    with pytest.raises(InputError) as raised:
        keys_in(made.folder, FLEET, mesh=False)
    assert [fault.source for fault in raised.value.faults] == [
        str(made.folder / "u1"),
        str(made.folder / "u2"),
    ]
    other = replace(FLEET, name="elsewhere")
    with pytest.raises(InputError, match="not 'elsewhere'"):
        keys_in(made.folder, other, mesh=False)


def test_a_run_needs_somebody_who_looks_on(made: RunKeys) -> None:
    open_authority(made.folder).revoke(["dashboard"])
    with pytest.raises(InputError, match="nobody in the roster is a viewer"):
        keys_in(made.folder, FLEET, mesh=False)


def test_a_plain_run_stays_plain() -> None:
    with protected(FLEET, ROUTED, secure=False, keys=None) as options:
        assert options is ROUTED


def told(options: LaunchOptions) -> ProtectionSummary:
    found = security_of(options, FLEET, [{"not signed": 2}, {"stale": 1}])
    assert found is not None
    return found


def test_a_secure_run_signs_mavlink_with_a_key_for_each_simulated_vehicle() -> None:
    with protected(FLEET, ROUTED, secure=True, keys=None) as options:
        assert options.keys is not None
        assert options.passthrough.signing_key == options.keys.folder
        assert "signed MAVLink" in told(options).measures
        assert "access control at the router" in told(options).measures
        assert told(options).lacking == ()
        assert told(options).refused == {"not signed": 2}


def test_firmware_has_been_given_no_keys_and_the_report_says_so() -> None:
    firmware = SitlFirmware(FirmwareKind.PX4, Path("px4"), Path("/tmp"))
    flown = replace(OPTIONS, bus=BusKind.MESH, autopilots=firmware)
    with protected(FLEET, flown, secure=True, keys=None) as options:
        assert options.passthrough.signing_key is None
        assert "signed MAVLink" not in told(options).measures
        assert "access control at every peer" in told(options).measures
        (lacking,) = told(options).lacking
        assert "MAVLink is not signed" in lacking


def test_nothing_is_told_of_the_protection_of_a_plain_run() -> None:
    assert security_of(ROUTED, FLEET, []) is None
