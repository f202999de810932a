"""Read a scenario: every mistake of the text with its line and column, or the scenario."""

import itertools
import math
from collections.abc import Sequence

from mp2a.exceptions import InputError
from mp2a.formation.choreography.findings import Finding
from mp2a.formation.choreography.scenario import Circle, Group, Instruction, Move, NewLeader, Scenario, Shape
from mp2a.formation.choreography.syntax import INSTRUCTIONS, ScenarioLine, Word, lines, one_of
from mp2a.formation.constants import WAYPOINT_TOLERANCE

_MOST_ROBOTS = 2048
"""A check looks at every pair of them."""
_LARGEST = 10_000.0
"""Of any number, in m, degrees or rad/s: beyond it a scenario is a slip of the pen."""


def parse(text: str) -> Scenario:
    r"""Read a scenario.

    Parameters
    ----------
    text
        As chapter 6 of the thesis describes it; docs/choreography.md has the grammar.

    Returns
    -------
    Scenario
        Its robots, groups and instructions, of which all names and counts fit.

    Raises
    ------
    InputError
        With every mistake, a line each: where it is, what was given and what was expected.

    Examples
    --------
    >>> parse("robots R1 R2\nrow R1,R2 0 1.2\nmove 2 -90").instructions[1]
    Move(distance=2.0, angle=-90.0, group=None, line=3)
    """
    scenario, findings = read(text)
    serious = [str(finding) for finding in findings if finding.serious]
    if scenario is None:
        raise InputError("\n".join(serious))
    return scenario


def read(text: str) -> tuple[Scenario | None, list[Finding]]:
    """Read a scenario as far as it goes: the scenario, None if a mistake is serious, and all findings."""
    reader = _Reader()
    for line in lines(text):
        if isinstance(line, Finding):
            reader.skip(line)
        else:
            reader.take(line)
    return reader.finish()


class _Reader:
    """What is known of a scenario after some of its lines."""

    def __init__(self) -> None:
        self.findings: list[Finding] = []
        self.broken = False
        self.robots: dict[str, Word] | None = None
        self.groups: dict[str, Group] = {}
        self.heading = self.started = False
        """Whether there was a line ``groups``, and ``start``, which groups need."""
        self.instructions: list[Instruction] = []
        self.placed: set[str] = set()
        self.block: set[str] = set()
        """Robots of the formations since the last other instruction."""
        self.used: set[str] = set()

    def skip(self, finding: Finding) -> None:
        """Skip a line that is not one of the language; what it may have said is not missed later."""
        self.findings.append(finding)
        self.broken = True
        self.robots = {} if self.robots is None else self.robots

    def take(self, line: ScenarioLine) -> None:
        """Take one line."""
        if self.robots is None and line.kind != "robots":
            self.robots = {}
            got = f"got {line.keyword.text!r}"
            self.note(line.keyword, f"{got}, expected the list of robots first: robots R1 R2 …")
        if line.kind in ("formation", "move", "circle", "new_leader"):
            if self.heading and not self.started:
                got = f"got {line.keyword.text!r} before start"
                self.note(line.keyword, f"{got}, expected start after the groups")
            if line.kind != "formation":
                self.block = set()
        getattr(self, f"take_{line.kind}")(line)

    def finish(self) -> tuple[Scenario | None, list[Finding]]:
        """Look at the whole."""
        if self.robots is None:
            self.findings.append(Finding("scenario", "got nothing, expected the list of robots first: robots R1 R2 …"))
        elif not self.broken:
            if not self.instructions:
                end = "got no instruction, expected a formation: row, column, triangle or square"
                self.findings.append(Finding("scenario", end))
            for role, word in self.robots.items():
                if role not in self.placed and self.instructions:
                    self.note(word, f"robot {role}: in no formation, expected a place for every robot")
            for name, group in self.groups.items():
                if name not in self.used:
                    self.note(Word(name, group.line, 1), f"group {name}: no instruction uses it", serious=False)
        findings = sorted(dict.fromkeys(self.findings), key=lambda finding: (finding.line or 0, finding.column or 0))
        if any(finding.serious for finding in findings):
            return None, findings
        return Scenario(tuple(self.robots or ()), tuple(self.groups.values()), tuple(self.instructions)), findings

    def note(self, word: Word, message: str, serious: bool = True) -> None:
        """Note a mistake at a word."""
        self.findings.append(Finding("scenario", message, serious, word.line, word.column))

    # ---- lines -------------------------------------------------------------------------------------------------

    def take_robots(self, line: ScenarioLine) -> None:
        if self.robots:
            self.note(line.keyword, "robots: listed a second time, expected one list")
            return
        self.robots = {}
        for word in line.words:
            if word.text in self.robots:
                self.note(word, f"robot {word.text}: listed twice, expected every role once")
            self.robots.setdefault(word.text, word)
        if len(self.robots) > _MOST_ROBOTS:
            self.note(line.keyword, f"robots: got {len(self.robots)}, expected at most {_MOST_ROBOTS}")

    def take_groups(self, line: ScenarioLine) -> None:
        if self.heading or self.started or self.instructions:
            self.note(line.keyword, "groups: expected them once, after the robots and before start")
        self.heading = True

    def take_group(self, line: ScenarioLine) -> None:
        name, members = line.keyword, line.words
        if not self.heading or self.started or self.instructions:
            self.note(name, f"got {name.text[:40]!r}, expected {one_of(INSTRUCTIONS)}")
            return
        if name.text in self.groups:
            self.note(name, f"group {name.text}: defined twice, expected every name once")
            return
        if not members:
            self.note(name, f"group {name.text}: got no robot, expected at least one")
        self.known(members, f"group {name.text}")
        for member in members:
            for other in self.groups.values():
                if member.text in other.robots:
                    also = (
                        f"robot {member.text}: in groups {other.name} and {name.text}, takes the instructions of both"
                    )
                    self.note(member, also, serious=False)
        self.groups[name.text] = Group(
            name.text, tuple(dict.fromkeys(word.text for word in members)), line.keyword.line
        )

    def take_start(self, line: ScenarioLine) -> None:
        if self.started or self.instructions:
            self.note(line.keyword, "start: expected it once, before the first instruction")
        self.started = True

    def take_formation(self, line: ScenarioLine) -> None:
        shape, (arrangement, distances, spacings) = line.keyword, line.parts
        rows = tuple(tuple(word.text for word in row) for row in arrangement)
        members = [word for row in arrangement for word in row]
        self.known(members, shape.text)
        for word in members:
            if word.text in self.block:
                self.note(word, f"robot {word.text}: in two formations at a time, expected one")
        fits, expected = _SHAPES[shape.text]
        if not fits([len(row) for row in rows]):
            got = ";".join(str(len(row)) for row in rows)
            self.note(shape, f"{shape.text}: got rows of {got} robots, expected {expected}")
        between = self.gaps(tuple(itertools.chain(*distances)), len(rows) - 1, "distances between rows")
        beside = self.spacings(spacings, [len(row) for row in rows])
        self.block |= {word.text for word in members}
        self.placed |= self.block
        self.instructions.append(Shape(shape.text, rows, between, beside, shape.line))

    def take_move(self, line: ScenarioLine) -> None:
        distance, angle, *group = line.words
        metres, degrees = self.number(distance, "distance"), self.number(angle, "angle")
        if metres <= 0:
            self.note(distance, f"move: got {distance.text} m, expected more than 0, for the leader does not reverse")
        elif metres <= WAYPOINT_TOLERANCE:
            within = f"move: {distance.text} m are within the tolerance of {WAYPOINT_TOLERANCE} m, so nobody moves"
            self.note(distance, within, serious=False)
        self.instructions.append(Move(metres, degrees, self.addressed(line, group), distance.line))

    def take_circle(self, line: ScenarioLine) -> None:
        radius, angle, rate, *group = line.words
        values = [self.number(word, name) for word, name in ((radius, "radius"), (angle, "angle"), (rate, "rate"))]
        if values[0] == 0:
            self.note(radius, "circle: got a radius of 0, expected one to the left (positive) or right (negative)")
        for word, value, name in ((angle, values[1], "angle"), (rate, values[2], "turn rate")):
            if value <= 0:
                self.note(word, f"circle: got {name} {word.text}, expected more than 0; the radius has the direction")
        self.instructions.append(Circle(values[0], values[1], values[2], self.addressed(line, group), radius.line))

    def take_new_leader(self, line: ScenarioLine) -> None:
        if not self.instructions or not isinstance(self.instructions[-1], Shape):
            self.note(line.keyword, "newVL: expected it immediately after a formation")
        self.instructions.append(NewLeader(line.keyword.line))

    # ---- words -------------------------------------------------------------------------------------------------

    def known(self, words: Sequence[Word], whose: str) -> None:
        """Check that names are robots, each once."""
        seen: set[str] = set()
        for word in words:
            if self.robots and word.text not in self.robots:
                self.note(
                    word, f"{whose}: got unknown robot {word.text[:40]!r}, expected {one_of(self.robots, most=8)}"
                )
            if word.text in seen:
                self.note(word, f"{whose}: got robot {word.text} twice, expected it once")
            seen.add(word.text)

    def addressed(self, line: ScenarioLine, group: Sequence[Word]) -> str | None:
        """Check whom an instruction is for, and that they have places."""
        name = group[0].text if group else None
        if name is not None and name not in self.groups:
            known = one_of(self.groups, most=8) if self.groups else "none, for no group is defined"
            self.note(group[0], f"{line.kind}: got unknown group {name[:40]!r}, expected {known}")
            return name
        members = self.robots or {} if name is None else self.groups[name].robots
        if name is not None:
            self.used.add(name)
        lost = [role for role in members if role not in self.placed]
        if lost and not self.broken:
            whom = "no robot has a place" if not self.placed else f"{one_of(lost, 'and', 8)}: no place"
            self.note(line.keyword, f"{line.kind}: {whom} yet, expected a formation before")
        return name

    def number(self, word: Word, name: str) -> float:
        """Read a number within reason."""
        value = float(word.text)
        if not abs(value) <= _LARGEST:
            self.note(word, f"{name}: got {word.text[:40]}, expected at most {_LARGEST:g} in size")
            return math.copysign(_LARGEST, value)
        return value

    def gaps(self, words: Sequence[Word], wanted: int, name: str) -> tuple[float, ...]:
        """Read the distances of ``wanted`` gaps: as many numbers, or one for all, or 0 where there is no gap."""
        values = [self.number(word, name) for word in words]
        if len(values) == 1:
            values *= wanted
        if len(values) != wanted:
            self.note(words[0], f"{name}: got {len(words)} numbers, expected {max(wanted, 1)} or one for all")
            values = (values * wanted)[:wanted]
        for word, value in zip(words, values, strict=False):
            if value <= 0:
                self.note(word, f"{name}: got {word.text} m, expected more than 0")
        if wanted == 0 and any(float(word.text) != 0 for word in words):
            self.note(words[0], f"{name}: got {words[0].text} m, expected 0 where there is no gap")
        return tuple(values)

    def spacings(self, lengths: Sequence[Sequence[Word]], sizes: Sequence[int]) -> tuple[tuple[float, ...], ...]:
        """Read the spacings of every row; one row of numbers stands for all."""
        name = "spacings in a row"
        if len(lengths) == 1 and len(lengths[0]) == 1 and max(sizes) > 1:
            # One number for the whole formation: rows of one robot have no use for it.
            gaps = {size: self.gaps(lengths[0], size - 1, name) for size in sorted(set(sizes) - {1})}
            return tuple(gaps.get(size, ()) for size in sizes)
        if len(lengths) == 1:
            lengths = [lengths[0]] * len(sizes)
        if len(lengths) != len(sizes):
            self.note(
                lengths[0][0], f"{name}: got {len(lengths)} rows of numbers, expected {len(sizes)} or one for all"
            )
            return tuple(() for _ in sizes)
        return tuple(self.gaps(row, size - 1, name) for row, size in zip(lengths, sizes, strict=True))


_SHAPES = {
    "row": (lambda sizes: len(sizes) == 1, "one row"),
    "column": (lambda sizes: set(sizes) == {1}, "one robot in every row"),
    "triangle": (
        lambda sizes: len(sizes) == 2 and sizes[0] == 1 and sizes[1] > 1,
        "one robot in the first of two rows and more in the second",
    ),
    "square": (lambda sizes: sizes == [2, 2], "two rows of two robots"),
}
