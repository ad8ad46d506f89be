"""Earlier releases, kept as sources in data/releases/, so that their processes can be started.

A folder made by `unpacked` holds the packages swarm, agent and coordinator as they were
released, without recordings, status and dashboard. The compiled kernels are those of this
build, since an archive of sources has none, called as those of the release were. Leaves out:
what the releases say to each other (tests/process/test_mixed_versions.py).
"""

from __future__ import annotations

import shutil
import sys
import tarfile
import tomllib
from importlib.util import find_spec
from pathlib import Path

_KEPT = Path(__file__).parents[1] / "data" / "releases"
_BEGIN = """
import sys
from pathlib import Path

release = sys.argv.pop(1)
# An editable installation puts its own packages before everything on the path.
sys.meta_path[:] = [each for each in sys.meta_path if "editable" not in type(each).__module__]
sys.path.insert(0, release)
import agent, coordinator, swarm

for package in (agent, coordinator, swarm):
    assert Path(release) in Path(package.__file__).parents, package
"""
_KERNELS = """
from swarm.kernels.present._kernels import *
from swarm.kernels.present import _kernels


def KernelProblem(*, weight, capable, **arrays):
    value = weight.max(axis=0, initial=0.0)
    value[value == 0.0] = 1.0
    return _kernels.KernelProblem(value=value, success=capable * (weight / value), **arrays)


def RouteInstance(task_m, speed_m_s, *arrays):
    return _kernels.KernelProblem(0.0 * speed_m_s[:, None] + task_m[0], task_m, speed_m_s, *arrays)


def evaluate_sequences(*arguments):
    return _kernels.run_sequences(*arguments)[:2]
"""
"""The kernels of 0.1.0, which knew two kinds of problem, by those of this build."""
_COMMAND = "from swarm.cli import console_main\nsys.exit(console_main())\n"


def kept_releases() -> list[str]:
    """The versions there are, oldest first."""
    names = (path.name for path in _KEPT.glob("peckorder-*.tar.xz"))
    versions = [name.removeprefix("peckorder-").removesuffix(".tar.xz") for name in names]
    return sorted(versions, key=lambda version: [int(part) for part in version.split(".")])


def unpacked(version: str, folder: Path) -> Path:
    """The packages of that release, ready to run, below ``folder``."""
    with tarfile.open(_KEPT / f"peckorder-{version}.tar.xz") as archive:
        archive.extractall(folder, filter="data")
    release = folder / f"peckorder-{version}"
    kernels = find_spec("swarm.kernels._kernels")
    assert kernels is not None
    assert kernels.origin is not None
    folder = release / "swarm" / "kernels"
    (folder / "present").mkdir()
    shutil.copy(kernels.origin, folder / "present")
    (folder / "_kernels.py").write_text(_KERNELS)
    # Its commands are those it was released with, wherever they have moved since.
    project = tomllib.loads((release / "pyproject.toml").read_text())["project"]
    commands = project["entry-points"]["peckorder.commands"]
    lines = [f"{name} = {place}" for name, place in commands.items()]
    told = release / f"peckorder-{version}.dist-info"
    told.mkdir()
    (told / "METADATA").write_text(f"Metadata-Version: 2.1\nName: peckorder\nVersion: {version}\n")
    (told / "entry_points.txt").write_text("\n".join(["[peckorder.commands]", *lines, ""]))
    return release


def python_of(release: Path, program: str = _COMMAND) -> list[str]:
    """The words that run a program with the packages of an unpacked release.

    Args:
        release: from `unpacked`.
        program: Python source; without one it is the command ``swarm``.
    """
    return [sys.executable, "-c", _BEGIN + program, str(release)]
