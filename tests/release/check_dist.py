"""Judges a source distribution and a wheel as users meet them: `make check-dist`.

    python -m tests.release.check_dist dist

Both are built again and must come out the same to the last byte. Each is installed into an
empty environment, the wheel where no compiler is to be found, and its `swarm` is used from
another folder: it must name the same commands, plan the same, and fly a mission with real
processes; with the wheel pass tests of the source distribution, too. Needs git, a compiler, a
few minutes and the package index. One line per check; exit status 1 if one fails. Leaves out:
wheels for other machines (cibuildwheel tests each where it is built), and uploading.
"""

from __future__ import annotations

import argparse
import filecmp
import json
import os
import shutil
import subprocess
import sys
import tarfile
import tempfile
import tomllib
import venv
import zipfile
from collections.abc import Sequence
from email.message import Message
from email.parser import BytesParser
from pathlib import Path
from typing import Any

from packaging.metadata import Metadata

from swarm import __version__
from tests.release.bill import install

ROOT = Path(__file__).parents[2]
PACKAGES = ("agent", "coordinator", "sim", "swarm")
TESTED = ("agent", "swarm/allocation", "swarm/protocol")
"""Unit tests that need nothing but what is installed, and a few packages."""
TEST_PACKAGES = ("hypothesis", "jsonschema", "pytest", "pytest-timeout")


class Failure(Exception):  # noqa: N818 - a finding, told as it is
    """What is wrong with a distribution."""


def main(argv: Sequence[str] | None = None) -> int:
    """Check the one source distribution and the one wheel of a folder; the exit status."""
    parser = argparse.ArgumentParser(prog="python -m tests.release.check_dist")
    parser.add_argument("folder", type=Path)
    folder: Path = parser.parse_args(argv).folder.resolve()
    (source,) = folder.glob("*.tar.gz")
    (wheel,) = folder.glob("*.whl")
    try:
        with tempfile.TemporaryDirectory(prefix="peckorder-dist-") as rooms:
            _check(source, wheel, Path(rooms))
    except Failure as failure:
        print(f"WRONG  {failure}")
        return 1
    return 0


def _check(source: Path, wheel: Path, rooms: Path) -> None:
    tracked = _run(["git", "ls-files"], ROOT).splitlines()
    with tarfile.open(source) as archive:
        prefix = f"peckorder-{__version__}/"
        _same("source distribution", source_files(tracked), _names(archive, prefix))
        archive.extractall(rooms, filter="data")
        made_s = archive.getmember(f"{prefix}PKG-INFO").mtime
    unpacked = rooms / prefix
    with zipfile.ZipFile(wheel) as packed:
        within = [name for name in packed.namelist() if not name.endswith("/")]
        packages = {name for name in within if ".dist-info/" not in name}
        (kernels,) = (name for name in packages if name.endswith(".so"))
        _same("wheel", shipped(tracked) | {kernels}, packages)
        told = packed.read(f"peckorder-{__version__}.dist-info/METADATA")
    check_metadata(told)
    if (unpacked / "PKG-INFO").read_bytes() != told:
        raise Failure("wheel and source distribution differ in their metadata")
    _well("metadata: valid, the same in both, of version " + __version__)

    again = rooms / "again"
    words = [sys.executable, "-m", "build", "--outdir", str(again), str(unpacked)]
    _run(words, rooms, SOURCE_DATE_EPOCH=str(int(made_s)))
    for made in (source, wheel):
        if not filecmp.cmp(made, again / made.name, shallow=False):
            raise Failure(f"{made.name}: built again elsewhere, other bytes come out")
    _well("reproducible: both built again elsewhere are the same to the last byte")

    from_wheel = install(wheel, rooms / "wheel")
    _use("wheel, without a compiler", from_wheel, rooms)
    _test(from_wheel, unpacked, rooms)
    venv.create(rooms / "source", with_pip=False, symlinks=True)
    from_source = rooms / "source" / "bin" / "python"
    _pip(from_source, f"{source}[ground]")
    _use("source distribution", from_source, rooms)
    if _installed(from_source) != _installed(from_wheel):
        raise Failure("wheel and source distribution install different files")
    _well("both install the same files")


def source_files(tracked: Sequence[str]) -> set[str]:
    """What the source distribution has to hold, given what git tracks."""
    return {name for name in tracked if not name.startswith(".ci/")} | {"PKG-INFO"}


def shipped(tracked: Sequence[str]) -> set[str]:
    """What a wheel has to hold, given what git tracks, besides the compiled kernels."""
    return {
        name
        for name in tracked
        if name.startswith(tuple(f"{package}/" for package in PACKAGES))
        and not name.endswith((".cpp", ".hpp", ".md", "CMakeLists.txt"))
        and "/screenshots/" not in name
        and "/published/" not in name
    }


def check_metadata(told: bytes) -> None:
    """Refuse metadata that an index would refuse, or that lack what people look for.

    Raises:
        Failure: what is wrong.
    """
    try:
        metadata = Metadata.from_email(told, validate=True)
    except ExceptionGroup as faults:
        raise Failure(f"metadata: {'; '.join(map(str, faults.exceptions))}") from faults
    mail: Message = BytesParser().parsebytes(told)
    if str(metadata.version) != __version__:
        raise Failure(f"metadata: version {metadata.version}, not {__version__}")
    for field in ("Summary", "Requires-Python", "License-Expression", "License-File", "Keywords"):
        if not mail.get(field):
            raise Failure(f"metadata: no {field}")
    if mail.get("Description-Content-Type") != "text/markdown" or not metadata.description:
        raise Failure("metadata: no description in Markdown")


def _names(archive: tarfile.TarFile, prefix: str) -> set[str]:
    return {each.name.removeprefix(prefix) for each in archive.getmembers() if not each.isdir()}


def _same(what: str, wanted: set[str], found: set[str]) -> None:
    if lacks := sorted(wanted - found):
        raise Failure(f"{what}: lacks {', '.join(lacks)}")
    if extra := sorted(found - wanted):
        raise Failure(f"{what}: should not hold {', '.join(extra)}")
    _well(f"{what}: exactly the {len(wanted)} files it should hold")


def _pip(python: Path, *what: str) -> None:
    pip = [sys.executable, "-m", "pip", "-qq", "--python", str(python)]
    _run([*pip, "install", *what], python.parent)


def _use(what: str, python: Path, rooms: Path) -> None:
    """Use an installed `swarm` as people do, away from the sources."""
    swarm = str(python.parent / "swarm")
    if (said := _run([swarm, "--version"], rooms).strip()) != f"swarm {__version__}":
        raise Failure(f"{what}: says {said!r} of itself")
    help_text = _run([swarm, "--help"], rooms)
    project = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]
    commands = project["entry-points"]["peckorder.commands"]
    if lacks := [name for name in commands if f" {name} " not in help_text]:
        raise Failure(f"{what}: does not know the commands {', '.join(lacks)}")
    for name in commands:
        _run([swarm, name, "--help"], rooms)
    plan = ["plan", "table-1", "--seed", "1", "--json"]
    ours, theirs = _plan([sys.executable, "-m", "swarm", *plan], ROOT), _plan([swarm, *plan], rooms)
    if ours != theirs:
        raise Failure(f"{what}: plans {theirs}, and the sources {ours}")
    run = [swarm, "run", "table-1", "--speedup", "5", "--dashboard", "0", "--json"]
    flown: dict[str, Any] = json.loads(_run(run, rooms))
    if len(flown["done"]) != len(ours["completion_s"]):
        raise Failure(f"{what}: of table-1 only {flown['done']} are done")
    _well(f"{what}: {len(commands)} commands, the same plan, and table-1 flown with a dashboard")


def _plan(words: Sequence[str], folder: Path) -> dict[str, Any]:
    said: dict[str, Any] = json.loads(_run(words, folder))
    del said["elapsed_s"]
    return said


def _test(python: Path, unpacked: Path, rooms: Path) -> None:
    """Run tests of the source distribution against what is installed."""
    bench = rooms / "bench"
    shutil.copytree(unpacked, bench, ignore=lambda *listed: _code(unpacked, *listed))
    _pip(python, *TEST_PACKAGES)
    words = [str(python), "-m", "pytest", "-q", "-p", "no:cacheprovider"]
    words += [f"tests/unit/{part}" for part in TESTED]
    _well(f"tests of the source distribution: {_run(words, bench).strip().splitlines()[-1]}")


def _code(unpacked: Path, folder: str, names: list[str]) -> list[str]:
    """What of a folder belongs to a package and is no page: that is installed already."""
    parts = Path(folder).relative_to(unpacked).parts
    if not parts or parts[0] not in PACKAGES:
        return []
    return [name for name in names if Path(folder, name).is_file() and not name.endswith(".md")]


def _installed(python: Path) -> set[str]:
    program = "from importlib.metadata import files\nprint(*files('peckorder'), sep='\\n')"
    lines = _run([str(python), "-c", program], python.parent).splitlines()
    own = ("direct_url.json", "INSTALLER", "REQUESTED", ".pyc")  # pip's own, and made in use
    return {line for line in lines if not line.endswith(own)}


def _run(words: Sequence[str], folder: Path, **environment: str) -> str:
    """The output of a program, which must succeed, in ``folder`` and without our packages."""
    own = {name: text for name, text in os.environ.items() if name != "PYTHONPATH"} | environment
    done = subprocess.run(words, cwd=folder, env=own, capture_output=True, text=True, check=False)
    if done.returncode != 0:
        last = "\n       ".join((done.stdout + done.stderr).strip().splitlines()[-20:])
        raise Failure(f"{' '.join(words)}: ended with {done.returncode}\n       {last}")
    return done.stdout


def _well(line: str) -> None:
    print(f"ok     {line}", flush=True)


if __name__ == "__main__":
    sys.exit(main())
