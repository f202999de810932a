"""World files: TOML with a table for each wall and obstacle."""

from collections.abc import Callable, Mapping
from functools import partial
from inspect import signature
from pathlib import Path
from typing import Any

import numpy as np

from mp2a.dependencies import parse_toml
from mp2a.exceptions import InputError
from mp2a.file_kinds import read_text
from mp2a.simulator.world import FARTHEST, World, box, disc

_MOST_SIDES = 360
_LEAST = 1e-3
"""m"""


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
        if word not in _KINDS:
            raise InputError(f"{where}: got {word!r}, expected 'name' or {_either(_KINDS)}")
        if not isinstance(entries, list) or not all(isinstance(entry, dict) for entry in entries):
            raise InputError(f"{where}: {word}: got {_short(entries)}, expected tables, each under [[{word}]]")
        make, solid = _KINDS[word]
        for number, entry in enumerate(entries, start=1):
            (obstacles if solid else walls).append(_corners_of(make, solid, entry, f"{where}: {word} {number}"))
    return World(walls, obstacles, name)


def _corners_of(make: Callable[..., Any], solid: bool, entry: Mapping[str, Any], where: str) -> Any:
    """Return the corners that a function makes of an entry, whose fields are the function's parameters."""
    parameters = signature(make).parameters
    for name in entry:
        if name not in parameters:
            raise InputError(f"{where}: got {name!r}, expected {_either(parameters)}")
    for name, parameter in parameters.items():
        expected, fits = _FIELDS[name]
        if name not in entry and parameter.default is parameter.empty:
            raise InputError(f"{where}: {name}: got nothing, expected it to be given")
        if name in entry and not fits(entry[name]):
            raise InputError(f"{where}: {name}: got {_short(entry[name])}, expected {expected}")
    corners = make(**entry)
    try:
        World(obstacles=[corners]) if solid else World(walls=[corners])
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


def _room(centre: tuple[float, float], size: tuple[float, float], heading: float = 0.0) -> Any:
    corners = box(centre, size, heading)
    return np.concatenate((corners, corners[:1]))


def _line(points: Any) -> Any:
    return points


def _either(words: Mapping[str, Any]) -> str:
    return "one of " + ", ".join(repr(word) for word in words)


def _short(value: Any) -> str:
    try:
        text = repr(value)
    except (ValueError, RecursionError):  # a whole number of thousands of digits
        return type(value).__name__
    return text if len(text) <= 60 else f"{text[:57]}..."


_FIELDS: dict[str, tuple[str, Callable[[Any], bool]]] = {
    "centre": (f"two coordinates [x, y] of at most {FARTHEST:g} m", _are_two),
    "points": (f"a list of points [[x, y], [x, y], …] of at most {FARTHEST:g} m", _are_points),
    "size": (
        f"two lengths [along x, along y] from {_LEAST:g} to {FARTHEST:g} m", partial(_are_two, least=_LEAST)
    ),
    "radius": (f"a length from {_LEAST:g} to {FARTHEST:g} m", partial(_is_number, least=_LEAST)),
    "heading": (f"a number of at most {FARTHEST:g}", _is_number),
    "sides": (f"a whole number from 3 to {_MOST_SIDES}", _is_count_of_sides),
}  # fmt: skip
"""Every field of an entry: what is expected, and whether a value is that."""
_KINDS: dict[str, tuple[Callable[..., Any], bool]] = {
    "room": (_room, False), "wall": (_line, False), "box": (box, True), "disc": (disc, True), "polygon": (_line, True),
}  # fmt: skip
"""Every kind of entry: what makes its corners of its fields, and whether it is solid."""
