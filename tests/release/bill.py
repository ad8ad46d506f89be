"""Writes the bill of materials of a wheel, as CycloneDX: `make sbom`.

    python -m tests.release.bill dist/peckorder-0.1.0-cp311-cp311-linux_x86_64.whl

It lists what installing that wheel into an empty environment brings, which is what people
get on the day of the release, and what the wheel itself carries of others. The same packages
give the same bytes. Written beside the wheel, as ``peckorder-<version>.cdx.json``.
"""

from __future__ import annotations

import argparse
import json
import os
import re
import subprocess
import sys
import tempfile
import venv
import zipfile
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from packaging.utils import parse_wheel_filename

PROJECT = Path(__file__).parents[2] / "pyproject.toml"
LEAFLET = "coordinator/dashboard/static/vendor/leaflet/leaflet.js"


def install(wheel: Path, folder: Path, extra: str = "ground") -> Path:
    """A new environment in ``folder`` with that wheel and what it needs; its interpreter.

    Where it installs no compiler is to be found, and not even pip is there afterwards.
    """
    venv.create(folder, with_pip=False, symlinks=True)
    python = folder / "bin" / "python"
    pip = [sys.executable, "-m", "pip", "-qq", "--python", str(python)]
    nowhere = {"PATH": str(python.parent), "CC": "/nonexistent", "CXX": "/nonexistent"}
    subprocess.run(
        [*pip, "install", "--only-binary", ":all:", f"{wheel}[{extra}]"],
        check=True,
        env={**os.environ, **nowhere},
    )
    return python


def leaflet_version(wheel: Path) -> str:
    """The version of Leaflet that the wheel carries.

    Raises:
        ValueError: the file does not say.
    """
    with zipfile.ZipFile(wheel) as archive:
        head = archive.read(LEAFLET)[:200].decode()
    found = re.search(r"Leaflet (\d+(?:\.\d+)+)", head)
    if found is None:
        raise ValueError(f"{LEAFLET} does not say which version it is")
    return found[1]


def amended(bill: dict[str, Any], version: str, leaflet: str) -> dict[str, Any]:
    """``bill`` with what its maker cannot see: our own version, and what is built in."""
    component = bill["metadata"]["component"]
    component |= {"version": version, "purl": f"pkg:pypi/peckorder@{version}"}
    carried = [
        {
            "bom-ref": f"leaflet@{leaflet}",
            "type": "library",
            "name": "leaflet",
            "version": leaflet,
            "purl": f"pkg:npm/leaflet@{leaflet}",
            "description": "Maps of the dashboard; its files are in the wheel",
            "licenses": [{"license": {"id": "BSD-2-Clause", "acknowledgement": "declared"}}],
        },
        {
            "bom-ref": "nanobind",
            "type": "library",
            "name": "nanobind",
            "purl": "pkg:pypi/nanobind",
            "description": "Compiled into the kernels, in the version that pyproject.toml asks for",
            "licenses": [{"license": {"id": "BSD-3-Clause", "acknowledgement": "declared"}}],
        },
    ]
    bill["components"] = [*bill["components"], *carried]
    for needs in bill["dependencies"]:
        if needs["ref"] == component["bom-ref"]:
            needs["dependsOn"] = sorted(
                {*needs.get("dependsOn", ()), *(each["bom-ref"] for each in carried)}
            )
    bill["dependencies"] += [{"ref": each["bom-ref"]} for each in carried]
    return bill


def main(argv: Sequence[str] | None = None) -> int:
    """Write the bill of one wheel; the exit status."""
    parser = argparse.ArgumentParser(prog="python -m tests.release.bill")
    parser.add_argument("wheel", type=Path)
    wheel: Path = parser.parse_args(argv).wheel
    version = str(parse_wheel_filename(wheel.name)[1])
    with tempfile.TemporaryDirectory(prefix="peckorder-bill-") as folder:
        python = install(wheel, Path(folder))
        words = [sys.executable, "-m", "cyclonedx_py", "environment", str(python)]
        words += ["--output-reproducible", "--mc-type", "application", "--pyproject", str(PROJECT)]
        told = subprocess.run(words, check=True, capture_output=True, text=True).stdout
    bill = amended(json.loads(told), version, leaflet_version(wheel))
    path = wheel.parent / f"peckorder-{version}.cdx.json"
    path.write_text(json.dumps(bill, indent=1, sort_keys=True) + "\n", encoding="utf-8")
    print(f"{path}: {len(bill['components'])} components")
    return 0


if __name__ == "__main__":
    sys.exit(main())
