"""The type stub in the tree is that of the compiled module."""

from __future__ import annotations

import ast
from pathlib import Path

from nanobind.stubgen import StubGen  # type: ignore[import-untyped] # it carries none

import swarm.kernels
from swarm.kernels import _kernels


def test_stub_is_up_to_date() -> None:
    generator = StubGen(_kernels, include_private=True)
    generator.put(_kernels)
    kept = Path(swarm.kernels.__file__).with_name("_kernels.pyi").read_text(encoding="utf-8")

    assert ast.dump(ast.parse(kept)) == ast.dump(ast.parse(generator.get())), "run make kernels"
