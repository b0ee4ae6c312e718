"""Numbers as text, and tables for a terminal, Markdown, HTML and CSV."""

import csv
import io
from collections.abc import Callable, Iterable, Mapping, Sequence
from functools import partial
from html import escape
from math import isfinite
from typing import TYPE_CHECKING, Any, NamedTuple

from beaver_ftc.documents.files import Document

if TYPE_CHECKING:
    from rich.table import Table

Rows = Sequence[Sequence[str]]
LEAST = 1e-3  # a number with a smaller magnitude is written as <0.001 or >-0.001


def finite(value: Any) -> Any:
    """Return a value for a JSON document: None for an infinite or missing number."""
    return None if isinstance(value, float) and not isfinite(value) else value


def all_finite(row: Mapping[str, Any]) -> Document:
    """A row with each value as `finite` returns it."""
    return {key: finite(value) for key, value in row.items()}


def number(value: Any, unit: str = "", none: str = "-", digits: int = 3) -> str:
    """A number with so many significant digits, or all digits before the point, without an exponent, and its
    unit. None and an empty text are `none`; another text stays as it is. An infinite number, and NaN, is
    `never`, followed by the unit."""
    if value is None or isinstance(value, str):
        return value or none
    return f"{_digits(float(value), digits)} {unit}".rstrip()


def _digits(value: float, digits: int) -> str:
    """A number as text; an infinite one, and NaN, is `never`."""
    if not isfinite(value):
        return "never"
    if 0.0 < abs(value) < LEAST:
        return f"<{LEAST:g}" if value > 0 else f">-{LEAST:g}"
    return f"{value:.0f}" if abs(value) >= 10 ** (digits - 1) else f"{value:.{digits}g}"


def percent(share: float | None, unit: str = " %") -> str:
    """A share in whole per cent; `none` without a share."""
    return "none" if share is None else f"{100.0 * share:.0f}{unit}"


bare_percent = partial(percent, unit="")  # in a column whose head has the unit
number_or_never = partial(number, none="never")


def estimate(values: Mapping[str, Any], form: Callable[[Any], str] = number_or_never) -> tuple[str, str]:
    """The value of an estimate and its interval as texts. form: from a number to its text."""
    value, low, high = (form(values[key]) for key in ("value", "low", "high"))
    return value, f"{low} to {high}"


def seconds(value: float | None, none: str = "never") -> str:
    """Return a time, s, as text; `none` if there is no time."""
    return none if value is None else f"{value:.2f} s"


Groups = dict[tuple[Any, ...], list[Document]]
"""Rows by the values of some of their columns."""


def grouped(rows: Iterable[Document], *names: str) -> Groups:
    """Rows by the values of some columns, in order of appearance."""
    groups: Groups = {}
    for row in rows:
        groups.setdefault(tuple(row[name] for name in names), []).append(row)
    return groups


def values_of(rows: Iterable[Mapping[str, Any]], key: str) -> list[Any]:
    """The value of each row under a key."""
    return [row[key] for row in rows]


def known_values(rows: Iterable[Mapping[str, Any]], key: str) -> list[Any]:
    """The values under a key that are not None."""
    return [value for value in values_of(rows, key) if value is not None]


def sum_of(rows: Iterable[Mapping[str, Any]], key: str) -> Any:
    """The sum of the values under a key; if they are flags, the number of rows that have it."""
    return sum(values_of(rows, key))


class Column(NamedTuple):
    """A column of a table: its head, and its cell of a row.

    of: a function from a row to its cell, or the key of a value in the row; `part.key` is a key inside a
    part. form, of the value of a key: a function from the value to its cell, or the unit of a number.
    """

    head: str
    of: str | Callable[[Any], str]
    form: str | Callable[[Any], str] = ""

    def cell(self, row: Any) -> str:
        """The cell of a row."""
        if not isinstance(self.of, str):
            return self.of(row)
        value = row
        for key in self.of.split("."):
            value = value[key]
        return number(value, self.form) if isinstance(self.form, str) else self.form(value)


Columns = Sequence[tuple[Any, ...]]  # the fields of each `Column`


def tabulated(columns: Columns, rows: Iterable[Any]) -> tuple[list[str], list[list[str]]]:
    """Head and rows of a table."""
    typed = [Column(*column) for column in columns]
    return [column.head for column in typed], [[column.cell(row) for column in typed] for row in rows]


def aligned(rows: Rows) -> str:
    """Return rows of cells as lines with aligned columns."""
    widths = [max(map(len, column)) for column in zip(*rows, strict=True)]
    lines = ("  ".join(f"{cell:{w}}" for cell, w in zip(row, widths, strict=True)) for row in rows)
    return "\n".join(line.rstrip() for line in lines)


def as_csv(rows: Sequence[Mapping[str, Any]]) -> str:
    """Rows with the same keys as CSV with a header. None is an empty cell. A part, a mapping in a row, has a
    column `name_key` for each of its keys. The text is empty without rows, since the columns are then
    unknown."""
    if not rows:
        return ""
    text = io.StringIO()
    flat = [_flat(row) for row in rows]
    writer = csv.DictWriter(text, fieldnames=list(flat[0]), lineterminator="\n")
    writer.writeheader()
    writer.writerows(flat)
    return text.getvalue()


def _flat(row: Mapping[str, Any]) -> dict[str, Any]:
    """A row with the keys of its parts as `name_key`."""
    flat: dict[str, Any] = {}
    for name, value in row.items():
        parts = value if isinstance(value, dict) else {"": value}
        flat |= {f"{name}_{key}".rstrip("_"): part for key, part in parts.items()}
    return flat


def markdown_table(head: Sequence[str], rows: Rows) -> str:
    """A table in Markdown."""
    lines = [head, ["---"] * len(head), *rows]
    return "\n".join("| " + " | ".join(cell.replace("|", "\\|") for cell in line) + " |" for line in lines)


def html_table(head: Sequence[str], rows: Rows) -> str:
    """A table in HTML; a cell that begins with a tick or a cross is coloured."""
    top = "".join(f'<th scope="col">{escape(cell)}</th>' for cell in head)
    body = "".join(f"<tr>{''.join(map(_cell, row))}</tr>" for row in rows)
    table = f"<table><thead><tr>{top}</tr></thead><tbody>{body}</tbody></table>"
    return f'<div class="wide">{table}</div>'


def _cell(text: str) -> str:
    """A cell of an HTML table."""
    kind = {"✓": ' class="met"', "✗": ' class="missed"'}.get(text[:1], "")
    return f"<td{kind}>{escape(text)}</td>"


def plain(title: str, head: Sequence[str], rows: Rows) -> "Table":
    """A table of rich with the first column aligned to the left, the others to the right."""
    from rich.table import Table

    table = Table(title=title, title_justify="left", box=None, pad_edge=False)
    for i, name in enumerate(head):
        table.add_column(name, justify="right" if i else "left", no_wrap=not i)
    for row in rows:
        table.add_row(*row)
    return table
