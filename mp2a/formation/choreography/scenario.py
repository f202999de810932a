"""A scenario as plain data, and as text again (thesis, chapter 6)."""

import itertools
from collections.abc import Iterable
from dataclasses import dataclass, field

from mp2a.formation.constants import LEADER_LEAD


@dataclass(frozen=True)
class Group:
    """Robots that take instructions of their own."""

    name: str
    robots: tuple[str, ...]
    line: int = field(default=0, compare=False)


@dataclass(frozen=True)
class Shape:
    """A formation: ``row``, ``column``, ``triangle`` or ``square``.

    Attributes
    ----------
    name
        Of the shape.
    rows
        Roles of the robots, row by row from the front, each from left to right.
    distances
        Between one row and the next, m; one fewer than rows.
    spacings
        Between neighbours of each row, m; one fewer than robots in it.
    """

    name: str
    rows: tuple[tuple[str, ...], ...]
    distances: tuple[float, ...]
    spacings: tuple[tuple[float, ...], ...]
    line: int = field(default=0, compare=False)

    @property
    def robots(self) -> tuple[str, ...]:
        """All roles, from the front left."""
        return tuple(robot for row in self.rows for robot in row)

    def slots(self) -> dict[str, tuple[float, float]]:
        """Return where each robot stands, seen from its virtual leader (thesis, section 4.2 and chapter 6).

        The leader is `LEADER_LEAD` in front of the first row and in the middle across; every row is centred on it.

        Returns
        -------
        dict
            x (negative: behind the leader) and y (to the left) by role, m.

        Examples
        --------
        >>> Shape("row", (("R1", "R2"),), (), ((1.2,),)).slots()
        {'R1': (-0.5, 0.6), 'R2': (-0.5, -0.6)}
        """
        out = {}
        back = itertools.accumulate((LEADER_LEAD, *self.distances))
        for row, gaps, x in zip(self.rows, self.spacings, back, strict=True):
            left = sum(gaps) / 2
            for robot, across in zip(row, itertools.accumulate((0.0, *gaps)), strict=True):
                out[robot] = (-x, left - across)
        return out


@dataclass(frozen=True)
class Move:
    """A waypoint: turn by ``angle`` (degrees, positive to the left), then ``distance`` (m) straight on."""

    distance: float
    angle: float
    group: str | None = None
    line: int = field(default=0, compare=False)


@dataclass(frozen=True)
class Circle:
    """An arc about a point ``radius`` (m) to the left, or to the right if negative.

    Attributes
    ----------
    radius
        m.
    angle
        Of the arc, degrees, positive.
    rate
        Turn rate asked for, rad/s, positive.
    group
        Whom it is for; None: all.
    """

    radius: float
    angle: float
    rate: float
    group: str | None = None
    line: int = field(default=0, compare=False)


@dataclass(frozen=True)
class NewLeader:
    """``newVL``: the formations described just before get a virtual leader in front of their own middle."""

    line: int = field(default=0, compare=False)


Instruction = Shape | Move | Circle | NewLeader


@dataclass(frozen=True)
class Scenario:
    """Robots, groups and instructions in the order of the text.

    `mp2a.formation.choreography.reading.parse` makes one of which all names fit; lines are not compared.
    """

    robots: tuple[str, ...]
    groups: tuple[Group, ...]
    instructions: tuple[Instruction, ...]

    def members(self, group: str | None) -> tuple[str, ...]:
        """Robots of a group, or all of them."""
        return self.robots if group is None else next(g.robots for g in self.groups if g.name == group)


def format(scenario: Scenario) -> str:
    """Text of a scenario; `parse` of it gives the same scenario.

    Examples
    --------
    >>> print(format(Scenario(("R1",), (), (Shape("row", (("R1",),), (), ((),)), Move(2.0, -90.0)))), end="")
    robots R1
    start
    row R1 0 0
    move 2 -90
    """
    lines = [f"robots {' '.join(scenario.robots)}"]
    if scenario.groups:
        lines += ["groups", *(f"{group.name} {' '.join(group.robots)}" for group in scenario.groups)]
    return "\n".join([*lines, "start", *map(instruction_text, scenario.instructions)]) + "\n"


def instruction_text(instruction: Instruction) -> str:
    """Line of one instruction."""
    match instruction:
        case Shape(name, rows, distances, spacings):
            arrangement = ";".join(",".join(row) for row in rows)
            gaps = ";".join(_lengths(row, ",") for row in spacings) if any(spacings) else "0"
            return f"{name} {arrangement} {_lengths(distances, ';')} {gaps}"
        case Move(distance, angle, group):
            return " ".join(["move", _number(distance), _number(angle), *([group] if group else [])])
        case Circle(radius, angle, rate, group):
            return " ".join(["circle", *map(_number, (radius, angle, rate)), *([group] if group else [])])
        case NewLeader():
            return "newVL"


def _lengths(values: Iterable[float], separator: str) -> str:
    return separator.join(map(_number, values)) or "0"


def _number(value: float) -> str:
    return repr(value).removesuffix(".0")
