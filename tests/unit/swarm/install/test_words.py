from __future__ import annotations

import pytest

from swarm.install.installation import kept_words, option_value, replaced, with_words

WORDS = ["--mission", "field", "--forward", "udp:a:1", "--forward=udp:b:2", "--rejoin"]


def test_option_is_found_in_both_spellings() -> None:
    assert option_value(WORDS, "--mission") == "field"
    assert option_value(WORDS[4:], "--forward") == "udp:b:2"
    assert option_value(WORDS, "--state") is None


def test_option_is_replaced_wherever_it_stands_or_added() -> None:
    assert replaced(WORDS, "--forward", "udp:c:3") == [
        *("--mission", "field", "--rejoin", "--forward", "udp:c:3")
    ]
    assert replaced(WORDS, "--state", "/s")[-2:] == ["--state", "/s"]


@pytest.mark.parametrize(
    "words",
    [
        WORDS,
        [],
        ["--tiles-credit", '© Some One\'s "maps"', ""],
        ["https://tile/{z}/{x}/{y}.png", "$HOME `id` 100% \\n #"],
        ["'", '"', "\\", "\\'"],
    ],
)
def test_options_survive_the_file_that_systemd_reads(words: list[str]) -> None:
    assert kept_words(with_words("# heading\n", words)) == words


def test_other_lines_of_the_file_stay() -> None:
    text = "# mine\nSWARM_OPTIONS='--rejoin'\nSWARM_LOG_LEVEL=debug\n"

    assert with_words(text, ["--mission", "field"]) == (
        '# mine\nSWARM_OPTIONS="--mission field"\nSWARM_LOG_LEVEL=debug\n'
    )


@pytest.mark.parametrize(
    "text",
    [
        "SWARM_OPTIONS=--mission field --rejoin\n",
        "SWARM_OPTIONS='--mission field --rejoin'",
        "SWARM_OPTIONS=\"--mission 'field' \\\n  --rejoin\"\n",
    ],
)
def test_options_written_by_hand_are_understood(text: str) -> None:
    assert kept_words(text) == ["--mission", "field", "--rejoin"]


def test_word_with_a_line_break_is_refused() -> None:
    with pytest.raises(ValueError, match="no option needs"):
        with_words("", ["a\nSWARM_X=1"])
