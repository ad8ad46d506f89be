"""Who may look on: names of this server, tokens, and pages that come from elsewhere."""

from __future__ import annotations

import pytest

from coordinator.dashboard.access import access_for
from coordinator.foxglove.server import ViewerRules
from swarm.cli import main

TOKEN = "a-token-of-some-length"


def fault(
    origin: str | None, host: str | None = "127.0.0.1:8765", rules: ViewerRules | None = None
) -> str | None:
    alone = ViewerRules(access_for("127.0.0.1", (), None)[0])
    return (rules or alone).fault(host, origin, None)


@pytest.mark.parametrize(
    "origin",
    [
        None,
        "file://",
        "https://app.foxglove.dev",
        "http://localhost:8080",
        "http://127.0.0.1:8080",
        "http://[::1]",
    ],
)
def test_programs_foxglove_and_pages_of_this_machine_may_look_on(origin: str | None) -> None:
    assert fault(origin) is None


@pytest.mark.parametrize(
    "origin",
    [
        "https://elsewhere.example",
        "null",
        "",
        "https://app.foxglove.dev.elsewhere.example",
        "http://localhost.elsewhere.example",
        "http://[",
        "https://app.foxglove.dev,https://elsewhere.example",
    ],
)
def test_other_pages_may_not_unless_they_are_allowed(origin: str) -> None:
    told = fault(origin)

    assert told is not None
    assert told.endswith("may not look on; see --allow-origin")
    allowed = ViewerRules(access_for("127.0.0.1", (), None)[0], frozenset({origin}))
    assert fault(origin, rules=allowed) is None


def test_a_name_that_somebodys_dns_turns_here_is_refused() -> None:
    told = fault(None, host="elsewhere.example")

    assert told == "this server has another name; see --allow-host"
    assert fault(None, host=None) == told


def test_beyond_this_machine_everyone_needs_the_token_and_who_has_it_may_be_any_page() -> None:
    access, made = access_for("0.0.0.0", (), TOKEN)
    rules = ViewerRules(access)

    assert not made
    assert rules.fault("192.168.1.2:8765", "https://elsewhere.example", TOKEN) is None
    for token in (None, "", "wrong"):
        told = rules.fault("192.168.1.2:8765", None, token)
        assert told == "the token is missing or wrong: end the URL in ?token=TOKEN"


@pytest.mark.parametrize(
    ("words", "told"),
    [
        (
            ["--allow-origin", "lichtblick.example.org"],
            (
                "--allow-origin: 'lichtblick.example.org' is no origin; "
                "write SCHEME://HOST[:PORT], and nothing behind it"
            ),
        ),
        (["--mission", "a/b"], "--mission: 'a/b' is no id; give"),
        (["--host", "no such host"], "--host: no such host: no such host as no such host"),
    ],
)
def test_what_is_wrong_is_told_in_one_line(
    words: list[str], told: str, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["foxglove", *words]) == 2

    out, err = capsys.readouterr()
    assert out == ""
    assert err.startswith(told)
    assert err.count("\n") == 1
