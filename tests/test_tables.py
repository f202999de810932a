"""Tables hold their values in every format, and fit."""

import csv
import json
import statistics

import pytest
from hypothesis import given
from hypothesis import strategies as st

from mp2a import tables
from mp2a.tables import STYLES, Column, Spread, Table, as_csv, as_json, as_markdown, as_text, show_ratio, show_seconds

TABLE = Table(
    "times",
    [Column("n"), Column("name", left=True), Column("time", show_seconds, "s"), Column("over", show_ratio)],
    [[1, "a, b", Spread(0.002, 0.001, 0.0035), 2.0], [20, "c", None, None]],
)


def test_text():
    assert as_text([TABLE], ["A note."]).splitlines() == [
        "times",
        " n  name          time  over",
        "────────────────────────────",
        " 1  a, b  2 ms (1–3.5)    2×",
        "20  c                -     -",
        "",
        "A note.",
    ]


def test_markdown():
    assert as_markdown([TABLE], ["A note."]).splitlines() == [
        "times:",
        "",
        "| n | name | time | over |",
        "| ---: | --- | ---: | ---: |",
        "| 1 | a, b | 2 ms (1–3.5) | 2× |",
        "| 20 | c | - | - |",
        "",
        "A note.",
    ]


def test_csv_has_plain_numbers_and_quartiles():
    title, *lines = as_csv([TABLE]).splitlines()
    assert title == "# times"
    first, second = csv.DictReader(lines)
    assert first == {
        "n": "1",
        "name": "a, b",
        "time, s": "0.002",
        "time, s, lower quartile": "0.001",
        "time, s, upper quartile": "0.0035",
        "over": "2.0",
    }
    assert second["time, s"] == second["time, s, upper quartile"] == second["over"] == ""


def test_json_has_plain_numbers_and_quartiles():
    content = json.loads(as_json([TABLE, TABLE], ["A note."]))
    assert content["notes"] == ["A note."]
    first, second = content["tables"][1]["rows"]
    assert first["time, s, lower quartile"] == 0.001
    assert second["time, s"] is None


@pytest.mark.parametrize("style", STYLES)
def test_a_table_without_rows(style):
    assert "times" in STYLES[style]([TABLE._replace(rows=[])], [])


@given(st.lists(st.floats(1e-9, 1e9), min_size=1, max_size=9))
def test_quartiles_lie_about_the_median(values):
    spread = Spread.of(values)
    assert min(values) <= spread.low <= spread.median <= spread.high <= max(values)
    assert spread.median == pytest.approx(statistics.median(values))


@given(st.floats(1e-12, 1e12))
def test_seconds_are_written_to_three_digits(seconds):
    number, unit = show_seconds(seconds).split()
    assert float(number) * {"s": 1, "ms": 1e-3, "µs": 1e-6, "ns": 1e-9}[unit] == pytest.approx(seconds, rel=6e-3)
    assert "e" not in number or not 1e-9 < seconds < 1e5


@given(st.integers(1, 12), st.integers(1, 3), st.integers(0, 4), st.sampled_from([40, 80]))
def test_no_line_is_wider_than_there_is_room(columns, keys, rows, width):
    table = Table(
        "a title of quite a few words, which goes on in the next line",
        [Column(f"heading {'x' * (k % 5)} {k}", left=k % 3 == 1) for k in range(max(columns, keys))],
        [[10 ** (k % 6) for k in range(max(columns, keys))] for _ in range(rows)],
        keys=keys,
    )
    before, tables.WIDTH = tables.WIDTH, width
    try:
        printed = as_text([table])
    finally:
        tables.WIDTH = before
    assert max(map(len, printed.splitlines())) <= width
    for k in range(keys, max(columns, keys)):
        assert str(k) in printed


def test_a_last_column_of_words_is_wrapped():
    words = [f"{k}→{k + 1}" for k in range(100)]
    table = Table("", [Column("n"), Column("messages", left=True)], [[1, " ".join(words)]])
    lines = as_text([table]).splitlines()
    assert max(map(len, lines)) <= 80
    assert " ".join(line.removeprefix("1").strip() for line in lines[3:]).split() == words
