"""A scenario laid out as arrays: what each robot's virtual leader does, one column a step."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from mp2a.exceptions import InputError
from mp2a.formation.choreography.scenario import Circle, Group, Instruction, Move, NewLeader, Scenario, Shape
from mp2a.spatial import Array

END, MOVE, CIRCLE, SHAPE, MEET = range(5)
"""Kinds of step. MEET is a formation with newVL: its robots wait for each other and get a new leader."""


@dataclass(frozen=True, eq=False)
class LeaderProgram:
    """Steps of n robots, each row ending with `END`.

    Attributes
    ----------
    kind
        ``(n, L)``.
    values
        ``(n, L, 3)``: of MOVE distance and angle, of CIRCLE radius, angle and turn rate (m, rad, rad/s), of SHAPE and
        MEET the robot's slot behind the leader, x and y (m).
    instruction
        ``(n, L)``: index in the scenario's instructions, -1 at the end.
    meeting
        ``(n, L)``: which meeting a MEET is, else -1.
    members
        Robots (indices) of every meeting.
    first_rows
        Which of them are to be in the first row.
    """

    kind: NDArray[np.intp]
    values: Array
    instruction: NDArray[np.intp]
    meeting: NDArray[np.intp]
    members: tuple[NDArray[np.intp], ...]
    first_rows: tuple[NDArray[np.intp], ...]

    def __len__(self) -> int:
        return len(self.kind)


def compile_program(scenario: Scenario) -> LeaderProgram:
    """Lay out a scenario: robot i of ``scenario.robots`` has row i.

    Every robot takes the instructions that name it, its group or nobody, in the order of the text; so the order in
    which two groups are written does not matter (thesis, listings 6.1 and 6.2).

    Raises
    ------
    InputError
        If a name does not fit, or a robot has no place at first; a scenario from a text fits.
    """
    _check_names(scenario)
    index = {robot: i for i, robot in enumerate(scenario.robots)}
    rows: list[list[tuple[int, tuple[float, ...], int, int]]] = [[] for _ in index]
    members: list[NDArray[np.intp]] = []
    first_rows: list[NDArray[np.intp]] = []
    for k, instruction in enumerate(scenario.instructions):
        if isinstance(instruction, Shape):
            meets = _gets_new_leader(scenario.instructions, k)
            meeting = len(members) if meets else -1
            for robot, slot in instruction.slots().items():
                rows[index[robot]].append((MEET if meets else SHAPE, (*slot, 0.0), k, meeting))
            if meets:
                members.append(np.array([index[robot] for robot in instruction.robots], dtype=np.intp))
                first_rows.append(np.array([index[robot] for robot in instruction.rows[0]], dtype=np.intp))
        elif not isinstance(instruction, NewLeader):
            if isinstance(instruction, Move):
                step = MOVE, (instruction.distance, np.deg2rad(instruction.angle), 0.0), k, -1
            else:
                step = CIRCLE, (instruction.radius, np.deg2rad(instruction.angle), instruction.rate), k, -1
            for robot in scenario.members(instruction.group):
                rows[index[robot]].append(step)
    for robot, row in zip(scenario.robots, rows, strict=True):
        if not row or row[0][0] not in (SHAPE, MEET):
            raise InputError(f"scenario: got no place for robot {robot} at first, expected a formation that it is in")
    length = 1 + max(len(row) for row in rows)
    end = (END, (0.0, 0.0, 0.0), -1, -1)
    padded = [row + [end] * (length - len(row)) for row in rows]
    kind, instructions, meetings = (np.array([[step[c] for step in row] for row in padded], np.intp) for c in (0, 2, 3))
    values = np.array([[step[1] for step in row] for row in padded], dtype=float)
    return LeaderProgram(kind, values, instructions, meetings, tuple(members), tuple(first_rows))


def _check_names(scenario: Scenario) -> None:
    """Check a scenario that may not come from a text."""
    if not isinstance(scenario, Scenario) or not scenario.robots:
        raise InputError(f"scenario: got {type(scenario).__name__}, expected a Scenario with at least one robot")
    groups = {None, *(group.name for group in scenario.groups)}
    for part in (*scenario.groups, *scenario.instructions):
        if isinstance(part, Group | Shape):
            unknown = [robot for robot in part.robots if robot not in scenario.robots]
            if unknown:
                raise InputError(f"scenario: got robot {unknown[0]!r} in {part.name}, expected one of its robots")
        elif isinstance(part, Move | Circle) and part.group not in groups:
            raise InputError(f"scenario: got group {part.group!r}, expected one of its groups")


def _gets_new_leader(instructions: tuple[Instruction, ...], k: int) -> bool:
    """Whether the formations around instruction k end with newVL."""
    after = next((x for x in instructions[k:] if not isinstance(x, Shape)), None)
    return isinstance(after, NewLeader)
