"""World files: TOML with a table for each wall and obstacle."""

import sys
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from mp2a.exceptions import InputError
from mp2a.file_kinds import kind_of_file
from mp2a.simulator.world import FARTHEST, World, box, disc

_MOST_SIDES = 360
_NEEDED = object()


class _Kind(NamedTuple):
    """One kind of entry: its corners from its fields, each with a reader and a default; and whether it is solid."""

    corners: Callable[..., Any]
    fields: Mapping[str, tuple[Callable[[Any], Any], Any]]
    solid: bool


class _Refused(Exception):
    """A value is not what its field has to be; says what it has to be."""


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
    try:
        text = Path(path).read_bytes().decode("utf-8")
    except (OSError, ValueError) as error:
        raise InputError(
            f"{path}: cannot be read as a world file: it is {kind_of_file(path)}, expected TOML"
        ) from error
    return parse_world(text, str(path))


def parse_world(text: str, where: str = "world") -> World:
    """Read a world from the text of a world file; ``where`` is what errors call it."""
    if sys.version_info >= (3, 11):
        import tomllib
    else:
        import tomli as tomllib

    try:
        tables = tomllib.loads(text)
    except (ValueError, RecursionError) as error:
        raise InputError(f"{where}: cannot be read as TOML ({error})") from error
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
    for name, (reader, default) in kind.fields.items():
        if name not in entry and default is _NEEDED:
            raise InputError(f"{where}: {name}: got nothing, expected it to be given")
        try:
            values[name] = reader(entry[name]) if name in entry else default
        except _Refused as refused:
            raise InputError(f"{where}: {name}: got {_short(entry[name])}, expected {refused}") from None
    corners = kind.corners(**values)
    try:
        World(obstacles=[corners]) if kind.solid else World(walls=[corners])
    except InputError as error:
        raise InputError(f"{where}: {str(error).partition(': ')[2]}") from error
    return corners


def _number(value: Any) -> float:
    if isinstance(value, bool) or not isinstance(value, int | float) or not abs(value) <= FARTHEST:
        raise _Refused(f"a number of at most {FARTHEST:g}")
    return float(value)


def _length(value: Any) -> float:
    if isinstance(value, bool) or not isinstance(value, int | float) or not 1e-3 <= value <= FARTHEST:
        raise _Refused(f"a length from 0.001 to {FARTHEST:g} m")
    return float(value)


def _point(value: Any) -> tuple[float, float]:
    if not isinstance(value, list) or len(value) != 2:
        raise _Refused("two coordinates [x, y] in m")
    return _number(value[0]), _number(value[1])


def _points(value: Any) -> list[tuple[float, float]]:
    if not isinstance(value, list) or not value:
        raise _Refused("a list of points [[x, y], [x, y], …] in m")
    return [_point(point) for point in value]


def _size(value: Any) -> tuple[float, float]:
    if not isinstance(value, list) or len(value) != 2:
        raise _Refused("two lengths [along x, along y] in m")
    return _length(value[0]), _length(value[1])


def _sides(value: Any) -> int:
    if isinstance(value, bool) or not isinstance(value, int) or not 3 <= value <= _MOST_SIDES:
        raise _Refused(f"a whole number from 3 to {_MOST_SIDES}")
    return value


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


_RECTANGLE = {"centre": (_point, _NEEDED), "size": (_size, _NEEDED), "heading": (_number, 0.0)}
_KINDS = {
    "room": _Kind(_room, _RECTANGLE, solid=False),
    "wall": _Kind(lambda points: points, {"points": (_points, _NEEDED)}, solid=False),
    "box": _Kind(box, _RECTANGLE, solid=True),
    "disc": _Kind(disc, {"centre": (_point, _NEEDED), "radius": (_length, _NEEDED), "sides": (_sides, 32)}, solid=True),
    "polygon": _Kind(lambda points: points, {"points": (_points, _NEEDED)}, solid=True),
}
