"""Firmware works where its shell scripts can."""

from __future__ import annotations

from pathlib import Path

import pytest

from sim.fleet.firmware import firmware_workplace
from swarm.runtime.errors import InputError


@pytest.mark.parametrize("name", ["my files", "a*b", "$HOME", "a:b", "it's", "café", "a\nb", "(a)"])
def test_a_folder_that_means_something_to_a_shell_is_passed_by(tmp_path: Path, name: str) -> None:
    odd, plain = tmp_path / name, tmp_path / "plain"
    odd.mkdir()
    plain.mkdir()

    assert firmware_workplace([odd, plain]) == plain.resolve()
    with pytest.raises(InputError, match=r"^TMPDIR: "):
        firmware_workplace([odd])


def test_what_counts_is_the_folder_behind_a_link(tmp_path: Path) -> None:
    odd, link = tmp_path / "my files", tmp_path / "link"
    odd.mkdir()
    link.symlink_to(odd)

    with pytest.raises(InputError):
        firmware_workplace([link])


def test_a_folder_that_is_not_there_is_passed_by(tmp_path: Path) -> None:
    assert firmware_workplace([tmp_path / "gone", tmp_path]) == tmp_path.resolve()


def test_the_first_that_will_do_is_taken(tmp_path: Path) -> None:
    (tmp_path / "second").mkdir()

    assert firmware_workplace([tmp_path, tmp_path / "second"]) == tmp_path.resolve()


def test_no_place_at_all_is_one_clear_line(tmp_path: Path) -> None:
    with pytest.raises(InputError) as caught:
        firmware_workplace([tmp_path / "gone"])

    assert len(str(caught.value).splitlines()) == 1
    assert "letters, digits" in str(caught.value)
