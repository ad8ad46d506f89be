"""Random streams that depend on one seed and on what they are for, and on nothing else.

One purpose drawing more numbers leaves every other as it was, so that worlds which differ in
one respect can be compared.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

__all__ = ["stream", "uniforms"]


def stream(seed: int, *purpose: str) -> np.random.Generator:
    """The generator of ``seed`` for one ``purpose``, such as ("link", "u0", "u1")."""
    key = tuple("/".join(purpose).encode())
    return np.random.default_rng(np.random.SeedSequence(seed, spawn_key=key))


def uniforms(rng: np.random.Generator) -> Iterator[float]:
    """Numbers from 0 to 1 without end, drawn in blocks since single draws are slow."""
    while True:
        yield from rng.random(64).tolist()
