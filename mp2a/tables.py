"""Tables as plain data, and how they are written: for people, for Markdown, for spreadsheets, for programs."""

import csv
import io
import json
import shutil
import statistics
import sys
import textwrap
from collections.abc import Callable, Iterable, Iterator, Sequence
from typing import Any, NamedTuple

WIDTH = 80
"""Columns that a table takes at most where there is no terminal to ask."""

_GAP = "  "
_NARROWEST = 24
"""Characters that a last column of words keeps at least when its cells are wrapped."""


class Spread(NamedTuple):
    """The median of some values, and their quartiles."""

    median: float
    low: float
    """The lower quartile."""
    high: float
    """The upper quartile."""

    @classmethod
    def of(cls, values: Iterable[float]) -> "Spread":
        """Return the median and the quartiles of at least one value; of a single value all three are that one."""
        numbers = list(values)
        if len(numbers) == 1:
            return cls(numbers[0], numbers[0], numbers[0])
        low, median, high = statistics.quantiles(numbers, n=4, method="inclusive")
        return cls(median, low, high)


class Column(NamedTuple):
    """A column of a table."""

    heading: str
    show: Callable[[Any], str] = str
    """How a value is written for people; None is a dash, whatever this says."""
    unit: str = ""
    """The unit of the plain number, where `show` writes one of its own."""
    left: bool = False
    """Whether cells begin at the same place rather than end there; cells of a last column are then wrapped as well."""


class Table(NamedTuple):
    """Values in rows and columns."""

    title: str
    columns: Sequence[Column]
    rows: Sequence[Sequence[Any]]
    """Words, numbers, `Spread`, or None where there is nothing."""
    keys: int = 1
    """Leading columns that are repeated where the others do not fit beside each other."""


def show_seconds(value: float | Spread) -> str:
    """Write seconds with the unit that leaves one to three digits before the point, and quartiles where they differ."""
    largest = abs(value.median if isinstance(value, Spread) else value)
    units = ((1.0, "s"), (1e3, "ms"), (1e6, "µs"))
    factor, unit = next(((factor, unit) for factor, unit in units if largest * factor >= 1), (1e9, "ns"))
    return _show_scaled(value, factor, f" {unit}")


def show_ratio(value: float | Spread) -> str:
    """Write how many times one thing is another, and quartiles where they differ."""
    return _show_scaled(value, 1.0, "×")


def show_plain(value: float | Spread) -> str:
    """Write a number, and quartiles where they differ."""
    return _show_scaled(value, 1.0, "")


def _show_scaled(value: float | Spread, factor: float, unit: str) -> str:
    if not isinstance(value, Spread):
        return f"{_show_digits(factor * value)}{unit}"
    median, low, high = (_show_digits(factor * number) for number in value)
    return f"{median}{unit}" + (f" ({low}–{high})" if value.low != value.high else "")


def _show_digits(number: float) -> str:
    """Write three significant digits, and no exponent up to a million."""
    return f"{number:.0f}" if 100 <= abs(number) < 1e6 else f"{number:.3g}"


def show(tables: Sequence[Table], notes: Sequence[str] = (), style: str = "text") -> None:
    """Print tables and notes in one of `STYLES`, without a code for colours or the like.

    Parameters
    ----------
    tables
        What is printed, in order.
    notes
        Sentences that belong to the tables.
    style
        Name out of `STYLES`.
    """
    print(STYLES[style](tables, notes))


def as_text(tables: Sequence[Table], notes: Sequence[str] = ()) -> str:
    """Write tables for a terminal, as wide as it is, or `WIDTH`; one that is wider goes on below, keys repeated."""
    width = shutil.get_terminal_size((WIDTH, 24)).columns if sys.stdout.isatty() else WIDTH
    parts = []
    for table in tables:
        blocks = ("\n".join(_block(part, width)) for part in _parts_of(table, width))
        parts.append(_fill(table.title, width) + "\n" + "\n\n".join(blocks))
    return "\n\n".join((*parts, *(_fill(note, width) for note in notes)))


def as_markdown(tables: Sequence[Table], notes: Sequence[str] = ()) -> str:
    """Write tables as Markdown does, for a page of documentation."""
    parts = []
    for table in tables:
        headings = [column.heading for column in table.columns]
        rules = ["---" if column.left else "---:" for column in table.columns]
        lines = [f"| {' | '.join(cells)} |" for cells in (headings, rules, *_cells(table))]
        parts.append("\n".join((f"{table.title}:", "", *lines)))
    return "\n\n".join((*parts, *notes))


def as_csv(tables: Sequence[Table], notes: Sequence[str] = ()) -> str:
    """Write tables as comma-separated values: plain numbers; titles and notes as comments that begin with ``#``."""
    parts = []
    for table in tables:
        out = io.StringIO()
        writer = csv.writer(out, lineterminator="\n")
        records = list(_records(table))
        writer.writerow(dict.fromkeys(name for record in records for name in record))
        writer.writerows(record.values() for record in records)
        parts.append(f"# {table.title}\n{out.getvalue()}".rstrip())
    return "\n\n".join((*parts, *(f"# {note}" for note in notes)))


def as_json(tables: Sequence[Table], notes: Sequence[str] = ()) -> str:
    """Write tables as JSON: ``{"tables": [{"title": …, "rows": [{heading: value, …}, …]}, …], "notes": [...]}``."""
    content = {
        "tables": [{"title": table.title, "rows": list(_records(table))} for table in tables],
        "notes": list(notes),
    }
    return json.dumps(content, indent=1, ensure_ascii=False)


STYLES: dict[str, Callable[[Sequence[Table], Sequence[str]], str]] = {
    "text": as_text,
    "markdown": as_markdown,
    "csv": as_csv,
    "json": as_json,
}
"""The ways of writing tables, by the name that ``--format`` takes."""


def _cells(table: Table) -> list[list[str]]:
    return [
        ["-" if value is None else column.show(value) for column, value in zip(table.columns, row, strict=True)]
        for row in table.rows
    ]


def _records(table: Table) -> Iterator[dict[str, Any]]:
    """Yield each row by plain names, in plain numbers; a spread takes three of them."""
    spreads = [any(isinstance(row[k], Spread) for row in table.rows) for k in range(len(table.columns))]
    for row in table.rows:
        record: dict[str, Any] = {}
        for column, value, spread in zip(table.columns, row, spreads, strict=True):
            name = f"{column.heading}, {column.unit}" if column.unit else column.heading
            if spread:
                median, low, high = (None, None, None) if value is None else value
                record |= {name: median, f"{name}, lower quartile": low, f"{name}, upper quartile": high}
            else:
                record[name] = value
        yield record


def _parts_of(table: Table, width: int) -> Iterator[Table]:
    """Yield the table, or several with some of its columns each, none wider than it has to be."""
    cells = _cells(table)
    widths = [_least_width(table, cells, k) for k in range(len(table.columns))]
    keys = list(range(table.keys))
    taken = list(keys)
    for k in range(table.keys, len(table.columns)):
        if len(taken) > len(keys) and sum(widths[j] + len(_GAP) for j in taken) + widths[k] > width:
            yield _columns_of(table, taken)
            taken = list(keys)
        taken.append(k)
    yield _columns_of(table, taken)


def _least_width(table: Table, cells: list[list[str]], k: int) -> int:
    column = table.columns[k]
    words = max(map(len, column.heading.split()), default=0)
    widest = max((len(row[k]) for row in cells), default=0)
    wraps = column.left and k == len(table.columns) - 1
    return max(words, min(widest, _NARROWEST) if wraps else widest)


def _columns_of(table: Table, which: list[int]) -> Table:
    rows = [[row[k] for k in which] for row in table.rows]
    return table._replace(columns=[table.columns[k] for k in which], rows=rows)


def _block(table: Table, width: int) -> Iterator[str]:
    """Yield the lines of a table that is no wider than ``width``, if it can be."""
    cells, last = _cells(table), len(table.columns) - 1
    widths = [_least_width(table, cells, k) for k in range(last + 1)]
    if table.columns[last].left:
        room = width - sum(widths[:last]) - len(_GAP) * last
        widths[last] = max(widths[last], min(room, max((len(row[last]) for row in cells), default=0)))
    for k, column in enumerate(table.columns):  # where there is room, headings stay in one line
        room = width - sum(widths) - len(_GAP) * last
        widths[k] += min(max(len(column.heading) - widths[k], 0), max(room, 0))
    headings = [_wrap(column.heading, w) for column, w in zip(table.columns, widths, strict=True)]
    height = max(map(len, headings))
    yield from _lines([[""] * (height - len(lines)) + lines for lines in headings], table, widths)
    yield "─" * min(width, sum(widths) + len(_GAP) * last)
    for row in cells:
        yield from _lines([*([cell] for cell in row[:last]), _wrap(row[last], widths[last])], table, widths)


def _fill(text: str, width: int) -> str:
    return "\n".join(_wrap(text, width))


def _wrap(text: str, width: int) -> list[str]:
    """Wrap a text at its spaces only, so that paths and names stay whole."""
    return textwrap.wrap(text, width, break_long_words=False, break_on_hyphens=False) or [""]


def _lines(cells: list[list[str]], table: Table, widths: list[int]) -> Iterator[str]:
    for k in range(max(map(len, cells))):
        line = (
            (lines[k] if k < len(lines) else "").ljust(width)
            if column.left
            else (lines[k] if k < len(lines) else "").rjust(width)
            for lines, column, width in zip(cells, table.columns, widths, strict=True)
        )
        yield _GAP.join(line).rstrip()
