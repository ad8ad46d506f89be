"""A table of results: the same values for a terminal, for a document and for programs.

Rows hold values in SI units; columns say in which unit and with which digits people read them,
and what programs call them.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from rich.console import RenderableType
    from rich.text import Text

NONE = "–"
"""What stands where there is no value."""


@dataclass(frozen=True, slots=True)
class Column:
    """What the values of a column are, and how people read them."""

    name: str
    form: str | Callable[[Any], str | Text] = ""
    """How a value is shown: a format such as ``.2f``, or a function. Words stay as they are."""
    unit: str = ""
    """In which numbers are shown; it stands behind the name."""
    scale: float = 1
    """How many of these units are one SI unit."""
    key: str = ""
    """Name of the values in JSON; without one they are for people only."""
    words: bool = False
    """Whether to begin them at the left, as words do, not to end them at the right."""
    none: str = NONE
    """What is shown for None."""
    style: str = ""
    """In a terminal."""

    @property
    def heading(self) -> str:
        """Name and unit."""
        return f"{self.name} [{self.unit}]" if self.unit else self.name

    def shown(self, value: Any) -> str | Text:
        """``value`` for people."""
        if value is None:
            return self.none
        if not isinstance(self.form, str):
            return self.form(value)
        if isinstance(value, int | float):
            return format(self.scale * value, self.form)
        found: str | Text = value
        return found


@dataclass(frozen=True, slots=True)
class ResultTable:
    """Rows of values under their columns."""

    columns: Sequence[Column]
    rows: Sequence[Sequence[object]]
    title: str = ""
    """Stands above it."""
    note: str = ""
    """Stands below it."""

    def cells(self) -> list[list[str]]:
        """What people read, without headings."""
        return [[str(cell) for cell in row] for row in self._shown()]

    def as_records(self) -> list[dict[str, object]]:
        """One object per row for `json.dumps`, of the columns that have a key."""
        return [
            {
                column.key: value
                for column, value in zip(self.columns, row, strict=True)
                if column.key
            }
            for row in self.rows
        ]

    def as_markdown(self) -> str:
        """For a document; title and note are paragraphs of their own."""
        rules = ["---" if column.words else "--:" for column in self.columns]
        lines = [[column.heading for column in self.columns], rules, *self.cells()]
        escaped = [" | ".join(cell.replace("|", "\\|") for cell in line) for line in lines]
        table = "\n".join(f"| {line} |" for line in escaped)
        title = f"**{self.title}**" if self.title else ""
        return "\n\n".join(part for part in (title, table, self.note) if part)

    def __rich__(self) -> RenderableType:
        """For a terminal; without any heading there is no line of them."""
        from rich.console import Group
        from rich.table import Table
        from rich.text import Text

        table = Table(
            box=None,
            pad_edge=False,
            padding=(0, 2, 0, 0),
            header_style="dim",
            show_header=any(column.heading for column in self.columns),
        )
        for number, column in enumerate(self.columns):
            table.add_column(
                Text(column.heading),
                justify="left" if column.words else "right",
                style=column.style,
                no_wrap=not number,
            )
        for row in self._shown():
            # What is a string is no markup.
            table.add_row(*(Text(cell) if isinstance(cell, str) else cell for cell in row))
        above = [Text(self.title, style="bold")] if self.title else []
        below = [Text(self.note)] if self.note else []
        return Group(*above, table, *below) if above or below else table

    def _shown(self) -> list[list[str | Text]]:
        return [
            [column.shown(value) for column, value in zip(self.columns, row, strict=True)]
            for row in self.rows
        ]
