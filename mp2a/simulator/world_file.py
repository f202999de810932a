"""World files: TOML with a table for each wall and obstacle."""

from collections.abc import Callable, Mapping
from functools import partial
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from mp2a.dependencies import parse_toml
from mp2a.exceptions import InputError
from mp2a.file_kinds import read_text
from mp2a.simulator.world import FARTHEST, World, box, disc

_MOST_SIDES = 360
_LEAST = 1e-3
"""m"""


class _Kind(NamedTuple):
    """One kind of entry: its corners from its fields, and whether it is solid."""

    corners: Callable[..., Any]
    fields: Mapping[str, "_Field"]
    solid: bool


class _Field(NamedTuple):
    """What a field has to be."""

    expected: str
    fits: Callable[[Any], bool]
    default: Any = None
    """None: the field is needed."""


def read_world(path: str | Path) -> World:
    """Read a world file.

    Parameters
    ----------
    path
        A TOML file; ``docs/simulator.md`` describes it.

    Returns
    -------
    World
        Its walls and obstacles.

    Raises
    ------
    InputError
        If the file cannot be read, is not TOML, or an entry is not what it has to be: the message names the file,
        the entry, what was given and what was expected.
    """
    return parse_world(read_text(path, "a world file", "TOML"), str(path))


def parse_world(text: str, where: str = "world") -> World:
    """Read a world from the text of a world file; ``where`` is what errors call it."""
    tables = parse_toml(text, where)
    name = tables.pop("name", Path(where).stem)
    if not isinstance(name, str):
        raise InputError(f"{where}: name: got {name!r}, expected a text")
    walls: list[Any] = []
    obstacles: list[Any] = []
    for word, entries in tables.items():
        kind = _KINDS.get(word)
        if kind is None:
            raise InputError(f"{where}: got {word!r}, expected 'name' or {_either(_KINDS)}")
        if not isinstance(entries, list) or not all(isinstance(entry, dict) for entry in entries):
            raise InputError(f"{where}: {word}: got {_short(entries)}, expected tables, each under [[{word}]]")
        for number, entry in enumerate(entries, start=1):
            corners = _entry(kind, entry, f"{where}: {word} {number}")
            (obstacles if kind.solid else walls).append(corners)
    return World(walls, obstacles, name)


def _entry(kind: _Kind, entry: Mapping[str, Any], where: str) -> Any:
    for name in entry:
        if name not in kind.fields:
            raise InputError(f"{where}: got {name!r}, expected {_either(kind.fields)}")
    values = {}
    for name, field in kind.fields.items():
        values[name] = entry.get(name, field.default)
        if values[name] is None:
            raise InputError(f"{where}: {name}: got nothing, expected it to be given")
        if not field.fits(values[name]):
            raise InputError(f"{where}: {name}: got {_short(values[name])}, expected {field.expected}")
    corners = kind.corners(*values.values())
    try:
        World(obstacles=[corners]) if kind.solid else World(walls=[corners])
    except InputError as error:
        raise InputError(f"{where}: {str(error).partition(': ')[2]}") from error
    return corners


def _is_number(value: Any, least: float = -FARTHEST) -> bool:
    return isinstance(value, int | float) and not isinstance(value, bool) and least <= value <= FARTHEST


def _are_two(value: Any, least: float = -FARTHEST) -> bool:
    return isinstance(value, list) and len(value) == 2 and all(_is_number(part, least) for part in value)


def _are_points(value: Any) -> bool:
    return isinstance(value, list) and bool(value) and all(map(_are_two, value))


def _is_count_of_sides(value: Any) -> bool:
    return isinstance(value, int) and not isinstance(value, bool) and 3 <= value <= _MOST_SIDES


def _room(centre: tuple[float, float], size: tuple[float, float], heading: float) -> Any:
    corners = box(centre, size, heading)
    return np.concatenate((corners, corners[:1]))


def _either(words: Mapping[str, Any]) -> str:
    return "one of " + ", ".join(repr(word) for word in words)


def _short(value: Any) -> str:
    try:
        text = repr(value)
    except (ValueError, RecursionError):  # a whole number of thousands of digits
        return type(value).__name__
    return text if len(text) <= 60 else f"{text[:57]}..."


_POINT = _Field(f"two coordinates [x, y] of at most {FARTHEST:g} m", _are_two)
_POINTS = _Field(f"a list of points [[x, y], [x, y], …] of at most {FARTHEST:g} m", _are_points)
_SIZE = _Field(f"two lengths [along x, along y] from {_LEAST:g} to {FARTHEST:g} m", partial(_are_two, least=_LEAST))
_RADIUS = _Field(f"a length from {_LEAST:g} to {FARTHEST:g} m", partial(_is_number, least=_LEAST))
_HEADING = _Field(f"a number of at most {FARTHEST:g}", _is_number, 0.0)
_SIDES = _Field(f"a whole number from 3 to {_MOST_SIDES}", _is_count_of_sides, 32)
_RECTANGLE = {"centre": _POINT, "size": _SIZE, "heading": _HEADING}
_KINDS = {
    "room": _Kind(_room, _RECTANGLE, solid=False),
    "wall": _Kind(list, {"points": _POINTS}, solid=False),
    "box": _Kind(box, _RECTANGLE, solid=True),
    "disc": _Kind(disc, {"centre": _POINT, "radius": _RADIUS, "sides": _SIDES}, solid=True),
    "polygon": _Kind(list, {"points": _POINTS}, solid=True),
}
