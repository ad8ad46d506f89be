"""Our key expressions mean what Zenoh's mean."""

from __future__ import annotations

import pytest
import zenoh
from hypothesis import given
from hypothesis import strategies as st

from swarm.bus.port import check_key, check_key_expr

CHUNKS = st.sampled_from(["a", "b", "ab", "@a", "@b", "*", "**"])
EXPRESSIONS = st.lists(CHUNKS, min_size=1, max_size=7).map("/".join)
TEXTS = st.text(alphabet="ab/*@#?é -", max_size=8)


def is_canonical(text: str) -> bool:
    """Whether Zenoh takes ``text`` as it is."""
    try:
        zenoh.KeyExpr(text)
    except zenoh.ZError:
        return False
    return True


def accepts(check: object, text: str) -> bool:
    assert callable(check)
    try:
        assert check(text) == text
    except ValueError:
        return False
    return True


@given(TEXTS | EXPRESSIONS)
def test_accepts_the_expressions_zenoh_accepts(text: str) -> None:
    assert accepts(check_key_expr, text) == is_canonical(text)


@given(TEXTS | EXPRESSIONS)
def test_keys_are_the_expressions_without_wildcards(text: str) -> None:
    assert accepts(check_key, text) == (is_canonical(text) and "*" not in text)


@pytest.mark.parametrize(
    "text", ["", "/a", "a/", "a//b", "a?b", "a#", "$*", "a*", "**/**", "**/*", "\udc80"]
)
def test_says_what_is_wrong(text: str) -> None:
    with pytest.raises(ValueError, match="not a key expression: "):
        check_key_expr(text)


def test_wildcards_inside_a_chunk_are_left_out() -> None:
    assert is_canonical("a/b$*")
    with pytest.raises(ValueError, match="reserved"):
        check_key_expr("a/b$*")
