"""What the bill of materials says that its maker cannot see."""

from __future__ import annotations

from pathlib import Path
from zipfile import ZipFile

import pytest

from tests.release.bill import LEAFLET, amended, leaflet_version

ROOT = Path(__file__).parents[3]


def test_bill_names_our_version_and_what_the_wheel_carries() -> None:
    bill = {
        "metadata": {"component": {"bom-ref": "root-component", "name": "peckorder"}},
        "components": [{"bom-ref": "numpy==2", "name": "numpy"}],
        "dependencies": [{"ref": "root-component", "dependsOn": ["numpy==2"]}],
    }
    told = amended(bill, "1.2.3", "1.9.4")

    assert told["metadata"]["component"]["purl"] == "pkg:pypi/peckorder@1.2.3"
    assert [part["name"] for part in told["components"]] == ["numpy", "leaflet", "nanobind"]
    assert told["dependencies"][0]["dependsOn"] == ["leaflet@1.9.4", "nanobind", "numpy==2"]


def test_leaflets_version_is_read_from_its_own_file(tmp_path: Path) -> None:
    wheel = tmp_path / "x.whl"
    with ZipFile(wheel, "w") as packed:
        packed.write(ROOT / LEAFLET, LEAFLET)

    assert leaflet_version(wheel) == "1.9.4"
    with ZipFile(wheel, "w") as packed:
        packed.writestr(LEAFLET, "no version")
    with pytest.raises(ValueError, match="does not say"):
        leaflet_version(wheel)
