"""Key files."""

from __future__ import annotations

import os
from pathlib import Path

import pytest

from agent.vehicle.signing import load_signing_key, signing_key_of
from swarm.runtime.errors import InputError

SECRET = bytes(range(32))


def written(path: Path, content: bytes, mode: int = 0o600) -> Path:
    path.write_bytes(content)
    path.chmod(mode)
    return path


@pytest.mark.parametrize(
    "content",
    [
        SECRET,
        SECRET.hex().encode(),
        SECRET.hex().upper().encode() + b"\n",
        b"  " + SECRET.hex().encode() + b"\r\n",
    ],
)
@pytest.mark.parametrize("mode", [0o400, 0o600, 0o640])
def test_a_key_is_32_bytes_or_64_digits(tmp_path: Path, content: bytes, mode: int) -> None:
    assert load_signing_key(written(tmp_path / "key", content, mode)).secret == SECRET


@pytest.mark.parametrize(
    ("content", "problem"),
    [
        (b"", "0 bytes that are no signing key"),
        (SECRET[:31], "31 bytes that are no signing key"),
        (SECRET + b"\n", "33 bytes that are no signing key"),
        (b"g" * 64, "64 bytes that are no signing key"),
        (("٣" * 32).encode(), "64 bytes that are no signing key"),
        (b"ab " * 21 + b"a", "64 bytes that are no signing key"),
        (b"a" * 5000, "4096 bytes that are no signing key"),
        (bytes(32), "a signing key of zeros means no signing at all"),
    ],
)
def test_anything_else_is_one_clear_line(tmp_path: Path, content: bytes, problem: str) -> None:
    path = written(tmp_path / "key", content)
    with pytest.raises(InputError) as raised:
        load_signing_key(path)
    line = str(raised.value)
    assert line.startswith(f"{path}: {problem}; give a file of 32 bytes or 64 hexadecimal digits")
    assert "\n" not in line


@pytest.mark.parametrize("mode", [0o604, 0o602, 0o644])
def test_a_key_open_to_everyone_is_refused(tmp_path: Path, mode: int) -> None:
    path = written(tmp_path / "key", SECRET, mode)
    with pytest.raises(InputError, match=r"open to everyone .*; close it: chmod o= "):
        load_signing_key(path)


def test_a_file_that_cannot_be_read_is_one_clear_line(tmp_path: Path) -> None:
    pipe = tmp_path / "pipe"
    os.mkfifo(pipe, 0o600)
    for path, problem in (
        (tmp_path / "missing", "No such file or directory"),
        (tmp_path, "Is a directory"),
        (Path("nul\0byte"), "embedded null byte"),
    ):
        with pytest.raises(InputError, match=rf"cannot be read \({problem}\); give a file"):
            load_signing_key(path)
    with pytest.raises(InputError, match="0 bytes that are no signing key"):
        load_signing_key(pipe)


def test_of_a_missions_keys_each_uav_takes_its_own(tmp_path: Path) -> None:
    (tmp_path / "uav1").mkdir()
    own = written(tmp_path / "uav1" / "mavlink.key", SECRET)

    assert signing_key_of("uav1", tmp_path) == own
    assert signing_key_of("uav1", own) == signing_key_of("uav2", own) == own
