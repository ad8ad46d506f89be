"""Tables of results: what people read and what programs get from the same values."""

from __future__ import annotations

import io

from rich.console import Console

from swarm.runtime.table import NONE, Column, ResultTable

TABLE = ResultTable(
    (
        Column("who", words=True, key="who"),
        Column("took", ".1f", "ms", 1e3, key="took_s"),
        Column("done", "{} of 3".format),
        Column("tries", key="tries"),
    ),
    [("a[b]|c", 0.0125, 2, 7), ("d", None, 0, 0)],
    "Times",
    "A note.",
)


def test_people_read_values_in_the_units_and_digits_of_their_columns() -> None:
    assert TABLE.cells() == [["a[b]|c", "12.5", "2 of 3", "7"], ["d", NONE, "0 of 3", "0"]]


def test_programs_get_the_values_themselves_under_their_keys() -> None:
    assert TABLE.as_records() == [
        {"who": "a[b]|c", "took_s": 0.0125, "tries": 7},
        {"who": "d", "took_s": None, "tries": 0},
    ]


def test_markdown_keeps_columns_apart_and_aligns_numbers_to_the_right() -> None:
    title, table, note = TABLE.as_markdown().split("\n\n")

    assert (title, note) == ("**Times**", "A note.")
    assert table.splitlines()[:3] == [
        "| who | took [ms] | done | tries |",
        "| --- | --: | --: | --: |",
        "| a[b]\\|c | 12.5 | 2 of 3 | 7 |",
    ]


def test_terminals_show_brackets_as_they_are() -> None:
    stream = io.StringIO()
    Console(file=stream, width=60).print(TABLE)

    lines = [line.rstrip() for line in stream.getvalue().splitlines()]
    assert lines[:2] == ["Times", "who     took [ms]    done  tries"]
    assert lines[2].startswith("a[b]|c")
    assert lines[-1] == "A note."


def test_without_headings_there_is_no_line_of_them() -> None:
    stream = io.StringIO()
    Console(file=stream).print(ResultTable((Column(""), Column("")), [("J", 1)]))

    assert len(stream.getvalue().splitlines()) == 1
